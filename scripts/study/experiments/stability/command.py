"""Hard cases with known answers: where each phase first fails.

A wrong picture is a result and shown as such. A NaN, a crash, a hang, or a case that cannot run is a failure.
"""

import argparse
import hashlib
import os
from functools import partial
from pathlib import Path

import msgspec

from study.core import cli, registry
from study.core.cli import Outcome
from study.core.run import GENERAL
from study.experiments import running, shards
from study.experiments.stability import cases, tables
from study.experiments.stability.cases import curves, phase
from study.experiments.stability.cases.measure import FAMILY, WRONG, able, breaks, sweep
from study.experiments.stability.schema import FILE, Phase, Row, Stability
from study.numbers import summary
from study.pictures.processes import in_processes

STATUSES = {1: "a phase wrote NaN, crashed or hung, or a case cannot run"}


def options(parser: argparse.ArgumentParser) -> None:
    cores = len(os.sched_getaffinity(0))
    add = parser.add_argument
    add("--phase", nargs="+", metavar="PHASE", help=f"e.g. opt4, or opt2@opt4; default: the {FAMILY}")
    add("--case", nargs="+", metavar="NAME", help="names or numbers; default: all")
    add("--strengths", choices=("few", "all"), default="all", help="few: the first, the middle, the last")
    add("--run", type=Path, metavar="DIR", help="for stability.json and curves; default: build/stability")
    add("--jobs", type=cli.at_least(1), default=cores, help="programs running at a time; default: CPUs")
    limit, kind = phase.TIME_LIMIT, cli.at_least(1e-9, float)
    add("--time-limit", type=kind, default=limit, metavar="S", help=f"of a picture; default: {limit:g} s")
    add("--list", action="store_true", help="say which cases there are, and run none")
    parser.set_defaults(home="stability")
    shards.option(parser, "cases")


def units(args: argparse.Namespace) -> list[cases.Case]:
    """The units of work. Raises StudyError for a case that there is not."""
    return cases.find_cases(args.case)


def cell(row: Row) -> str:
    if row.refused:
        return "refuses"
    if row.first_failure is None:
        return "·"
    state = row.states[row.place]
    return curves.number(row.first_failure) + ("" if state == WRONG else f" {state}")


def table(data: Stability) -> str:
    """A line a case, a column a phase: the first strength that fails."""
    names = [one.name for one in data.phases]
    lines = []
    for case in data.cases:
        ends = f"{case.strength} ({curves.number(case.strengths[0])} … {curves.number(case.strengths[-1])})"
        cells = dict(zip(names, map(cell, data.rows_of(case)), strict=True))
        lines.append({"": str(case.number), "case": case.title, **cells, "strength (easy … hard)": ends})
    return summary.table(lines, [(name, name) for name in lines[0]])


def draw(data: Stability, folder: Path) -> None:
    """Each case's figure as FOLDER/hard-NN-name.svg and .png."""
    names = [one.name for one in data.phases]
    in_processes(
        [
            partial(curves.draw, case, data.rows_of(case), names, folder / tables.anchor(case))
            for case in data.cases
        ]
    )


def measured(args: argparse.Namespace, chosen: list[cases.Case]) -> Stability:
    names, skipped = able(args.phase)
    for item in skipped:
        cli.say(f"skipped {item.phase}: {item.reason}")
    # Hundreds of scenes: a kernel for each would take longer than all of them by all phases.
    if os.environ.setdefault("STEPWISE_CC", GENERAL["STEPWISE_CC"]) == "none":
        for name in names:
            if registry.find_phase(name.partition("@")[0]).embedded:
                cli.say(f"{name}: its general code; STEPWISE_CC=gcc holds kernels to the cases, in minutes")
    phases = []
    for name in names:
        one = phase.Phase(name)
        digest = hashlib.sha256(one.program().read_bytes()).hexdigest()
        phases.append(Phase(name=name, precision=one.precision, sha256=digest))
    few = args.strengths == "few"
    rows = sweep(names, chosen, few, args.jobs, time_limit=args.time_limit)
    shown = [c.about if not few else msgspec.structs.replace(c.about, strengths=c.few()) for c in chosen]
    return Stability(phases=phases, cases=shown, results=rows, skipped=skipped)


def measure(args: argparse.Namespace) -> Outcome:
    if args.list:
        about = [case.about for case in cases.cases()]
        return Outcome({"schema": 1, "cases": about}, [f"{c.number:2} {c.name}: {c.title}" for c in about])
    chosen = shards.part(units(args), args.shard)
    folder = running.folder(args, FILE)
    data = measured(args, chosen)
    result = cli.plain(data)
    path = shards.write(folder, FILE, result, args.shard)
    if not args.shard:
        draw(data, folder / "figures")
    where = f"Rows: {path}" if args.shard else f"Curves: {folder}/figures"
    legend = "·: right at every strength that was run; else the first strength that fails."
    return Outcome(result, [table(data), legend, where], folder, failed=breaks(data.results))
