"""Hard cases with a known answer: how wrong each phase is, and at which strength of the case it first fails.

A wrong picture is a result and shown as such. A NaN, a crash, a hang, or a case that cannot run is a failure.
"""

from __future__ import annotations

import argparse
import os
from functools import partial
from pathlib import Path

from study.core import cli, registry, store
from study.core.run import GENERAL
from study.experiments import shards
from study.experiments.stability import cases as hard
from study.experiments.stability import tables as hard_page
from study.experiments.stability.cases import curves, measure, phase
from study.pictures.processes import in_processes

FILE = "stability.json"


def positive(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0
    if not 0 < value < 1e6:
        raise argparse.ArgumentTypeError(f"'{text}': must be a number of seconds above 0")
    return value


def arguments() -> argparse.Namespace:
    cores = len(os.sched_getaffinity(0))
    parser = cli.parser(__doc__, {1: "a phase wrote NaN, crashed or hung, or a case cannot run"})
    add = parser.add_argument
    add("--phase", nargs="+", metavar="PHASE", help=f"e.g. opt4, or opt2@opt4; default: the {measure.FAMILY}")
    add("--case", nargs="+", metavar="NAME", help="names or numbers; default: all")
    add("--strengths", choices=("few", "all"), default="all", help="few: the first, the middle, the last")
    add("--run", type=Path, metavar="DIR", help="for stability.json and curves; default: build/stability")
    add("--jobs", type=cli.at_least(1), default=cores, help="programs running at a time; default: CPUs")
    limit = phase.TIME_LIMIT
    add("--time-limit", type=positive, default=limit, metavar="S", help=f"of a picture; default: {limit:g} s")
    add("--list", action="store_true", help="say which cases there are, and run none")
    shards.option(parser, "cases")
    return parser.parse_args()


def units(args: argparse.Namespace) -> list[hard.Case]:
    """The units of work. Raises StudyError for a case that there is not."""
    return hard.find_cases(args.case)


def cell(row: dict) -> str:
    """What the terminal's table says of one phase and case."""
    if row["refused"]:
        return "refuses"
    if row["first_failure"] is None:
        return "·"
    state = row["states"][row["strengths"].index(row["first_failure"])]
    return curves.number(row["first_failure"]) + ("" if state == measure.WRONG else f" {state}")


def table(rows: list[dict], chosen: list[hard.Case], names: list[str]) -> str:
    """A line a case, a column a phase: the first strength that fails."""
    at = {(row["number"], row["phase"]): cell(row) for row in rows}
    lines = [["", "case", *names, "strength (easy … hard)"]]
    for case in chosen:
        ends = f"{case.strength} ({curves.number(case.strengths[0])} … {curves.number(case.strengths[-1])})"
        lines.append([str(case.number), case.title, *(at[case.number, name] for name in names), ends])
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    sides = [">", "<", *">" * len(names), "<"]
    form = "  ".join(f"{{:{side}{width}}}" for side, width in zip(sides, widths, strict=True))
    return "\n".join(form.format(*line).rstrip() for line in lines)


def listing(json: bool) -> None:
    if json:
        return cli.emit({"schema": 1, "cases": [measure.about(case) for case in hard.cases()]})
    for case in hard.cases():
        print(f"{case.number:2} {case.name}: {case.title}")


def drawn(folder: Path) -> str:
    """Draws the figures and pages of a run's stability.json; says where they are."""
    written = hard_page.read(folder / FILE)
    in_processes([partial(hard_page.draw, written, case, folder / "figures") for case in written["cases"]])
    index = hard_page.write(written, folder / "pages")
    return f"Curves: {folder}/figures; a page for each case: {index}"


def main() -> int:
    args = arguments()
    if args.list:
        return listing(args.json) or cli.OK
    chosen = shards.part(units(args), args.shard)
    folder = store.writable(args.run or registry.ROOT / "build" / "stability")
    names, skipped = measure.able(args.phase)
    for item in skipped:
        cli.say(f"skipped {item['phase']}: {item['reason']}")
    if not names:
        return cli.CANNOT_RUN
    # Hundreds of scenes: a kernel for each would take longer than all of them by all phases.
    if os.environ.setdefault("STEPWISE_CC", GENERAL["STEPWISE_CC"]) == "none":
        for name in names:
            if registry.find_phase(name.partition("@")[0]).embedded:
                cli.say(f"{name}: its general code; STEPWISE_CC=gcc holds kernels to the cases, in minutes")
    phases = [
        {"name": name, "precision": phase.Phase(name).precision, "sha256": measure.binary_sha256(name)}
        for name in names
    ]
    few = args.strengths == "few"
    rows = measure.sweep(names, chosen, few, args.jobs, time_limit=args.time_limit)
    about = [measure.about(case) | {"strengths": case.few() if few else case.strengths} for case in chosen]
    result = {"schema": 1, "phases": phases, "cases": about, "results": rows, "skipped": skipped}
    name = shards.file_name(FILE, args.shard)
    store.write_json(folder / name, shards.marked(result, args.shard))
    pages = f"Rows: {folder / name}" if args.shard else drawn(folder)
    if args.json:
        cli.emit(result, folder)
    else:
        print(table(rows, chosen, names))
        print("·: right at every strength that was run; else the first strength that fails.")
        print(pages)
    for line in measure.breaks(rows):
        cli.say(f"FAIL {line}")
    return measure.check(rows)
