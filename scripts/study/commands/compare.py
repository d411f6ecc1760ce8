"""Any number of runs beside one base: what got slower or faster, what differs."""

import argparse
import json
import math
import secrets
from collections.abc import Sequence
from pathlib import Path
from string import ascii_uppercase
from typing import Any

from study.core import cli, show, store
from study.core.cli import Outcome, StudyError
from study.core.registry import BASE
from study.core.store import Run
from study.measuring import again, changes, two_runs
from study.measuring.changes import INSTRUCTIONS, NONE, SLOWER, TIMES, Row
from study.measuring.two_runs import KINDS, MACHINE, UNCOUNTED, Fault, Side
from study.numbers import analysis, history, programs, significance, stats, summary
from study.numbers.significance import LEVEL

DESCRIPTION = """\
Compares the times of runs with those of a base, configuration by configuration. The ratio is that of the
medians, base over run: over 1, the run is faster. Its 95 % interval is a bootstrap over launches. Time is
cycles over clock: the ratios of cycles and of clocks stand beside it, and the one that changed is named.

"Slower" is the verdict of Mann and Whitney's exact rank test: the run takes longer by more than --least. All
verdicts of a comparison are corrected together (Benjamini and Hochberg). If no configuration is slower, one
or more is called so by chance in at most 2.5 % of comparisons. The same holds for "faster". A machine that
was busier during one of the runs adds more: launches of one run do not show that. --confirm does.
Launches in two modes of time get no verdict, unless each of one run is slower than all of the other.

With --by instructions the verdict is of exact counts. More instructions are slower unless the time is
faster. Where the counts agree, or time says slower, the verdict is that of time.

Runs of two machines, different scenes and other sizes of the picture are said first and get no verdict.

With --fail-on-slower the status is 1 for a configuration that is slower, or that the run lacks (vanished).
It is also 1 for a phase outside its tolerance (failed) or not judged (unverified), and for runs without
a verdict (machine, scene, size, uncounted, few launches). --allow names what is let through."""
STATUSES = {1: "with --fail-on-slower: see above"}
COLUMNS = [("spec", "phase"), ("scene", "scene"), ("size", "size"), ("threads", "threads"), ("run", "run")]
COLUMNS += [("base_ms", "A ms [95 %]"), ("ms", "run ms [95 %]"), ("time", "time A / run [95 %]")]
COLUMNS += [("cycles", "cycles A / run [95 %]"), ("clock", "clock run / A [95 %]")]
COLUMNS += [("baseline", "× baseline, run / A [95 %]"), ("instructions", "instructions A / run")]
COLUMNS += [("moved", "moved"), ("again", "again, A / run [95 %]")]
COLUMNS += [("p", "p, corrected"), ("verdict", "run is")]
EXPORTS = ("github-action-benchmark", "hyperfine")


def options(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("runs", metavar="RUN", nargs="*", type=Path, help="folders of runs, the base first")
    add("--by", choices=(*TIMES, INSTRUCTIONS), default="time", help="of the verdict; default: time")
    about = "smallest change of time that counts, like 2%%; default: 0%%"
    add("--least", type=cli.percent, default=0.0, metavar="P", help=about)
    about = "with --by instructions: smallest change of work that counts; default: 0.1%%"
    add("--least-work", type=cli.percent, default=0.001, metavar="P", help=about)
    about = "launch what looks slower again, by turns with the base's program from that folder's build"
    add("--confirm", type=Path, metavar="CHECKOUT", help=about)
    about = "of order and padding with --confirm; default: random"
    add("--seed", type=cli.at_least(0), default=secrets.randbelow(2**32), help=about)
    about = "leave out launches whose timer is 0.01 %% off the run's rate, or whose core clock 3 %% off its "
    add("--leave-out-off-clock", action="store_true", help=about + "configuration's")
    add("--fail-on-slower", action="store_true", help="a gate: status 1, see above")
    about = f"do not fail for it (machine: and give a verdict): {', '.join(KINDS)}; may be repeated"
    add("--allow", action="append", default=[], choices=KINDS, metavar="KIND", help=about)
    about = "instead: this phase in all runs below the RUNs, by machine and date, with its steps; "
    add("--history", metavar="PHASE", help=about + "default: results")
    add("--scene", nargs="+", default=[], metavar="SCENE", help="of --history; default: all")
    about = "instead: the times of one RUN for other programs; with --by baseline over baseline's"
    add("--export", choices=EXPORTS, help=about)
    add("-o", "--out", type=Path, metavar="PATH", help="of --export; default: standard output")


def shown(sides: Sequence[Side], first: Sequence[Fault], found: Sequence[Row], by: str) -> list[str]:
    lines = [f"{side.letter}: {side.run}" for side in sides]
    lines += [*(f"{NONE} on {one.run}: {one.text}" for one in first), ""]
    if found:
        columns = [one for one in COLUMNS if by in ("baseline", INSTRUCTIONS) or one[0] != "baseline"]
        lines.append(summary.table(found, columns))
    return lines


def over_time(args: argparse.Namespace) -> Outcome:
    """A table a machine; `step` names how a point differs from the one above it."""
    places = args.runs or [store.RESULTS]
    points = history.points(history.runs(*places), args.history, args.scene)
    if not points:
        on = " on " + " ".join(args.scene) if args.scene else ""
        raise StudyError(f"no run below {', '.join(map(str, places))} has timed {args.history}{on}")
    lines = []
    for machine in dict.fromkeys(point.machine for point in points):
        rows = history.shown([point for point in points if point.machine == machine])
        lines += [machine, "", summary.table(rows, history.COLUMNS), ""]
    return Outcome({"points": points}, lines)


def benchmark(run: Run, by_baseline: bool) -> list[dict[str, Any]]:
    """What the tool `customSmallerIsBetter` of github-action-benchmark reads (its README, "Custom").

    `by_baseline`: the unit is baseline's time in the same run, which other hours and runners change least.
    """
    cells, found = analysis.by_key(analysis.cells_of(run.frames())), []
    for (scene, width, height, threads, spec), cell in sorted(cells.items()):
        base = cells.get((scene, width, height, threads, BASE))
        time = stats.median_interval(cell.values.ns / 1e6)
        if by_baseline and (base is None or spec == BASE):
            continue
        shown = base.over(cell) if by_baseline and base else time
        entry = {
            "name": " ".join(filter(None, (spec, scene, show.size(width, height))))
            + (f", {threads} threads" if threads > 1 else ""),
            "unit": "of baseline's time" if by_baseline else "ms",
            "value": shown.value,
            "extra": f"{time.launches} launches",
        }
        if shown.sufficient:
            entry["range"] = f"{shown.low:.4g} to {shown.high:.4g}"
        found.append(entry)
    return found


def confirmed(found: list[Row], sides: Sequence[Side], args: argparse.Namespace) -> list[Row]:
    """Measures again what looks slower in time. Raises StudyError: for more runs than two, and where a
    program is not the one that was measured."""
    if len(sides) != 2:
        raise StudyError(f"--confirm takes the base and one run, not {len(sides)} runs")
    if other := next((side.run for side in sides if side.run.plan.programs), None):
        how = "stepwise time --fail-on-slower -- OLD ::: NEW"
        raise StudyError(f"--confirm launches phases, and {other} is of other programs: {how}")
    work = args.least_work if args.by == INSTRUCTIONS else math.inf  # counts are exact
    seems = [row.key for row in found if row.verdict == SLOWER and row.more_work < work]
    if not seems:
        return found
    times = again.by_turns(sides[0].run, sides[1].run, args.confirm, seems, args.seed)
    return changes.confirmed(found, times, args.least)


def uncounted(found: Sequence[Row], by: str) -> list[Fault]:
    """What --by asks for and a run lacks. Instructions: of one thread, for they do not depend on threads."""
    if by != INSTRUCTIONS:
        lack = f"no {BASE} beside it" if by == BASE else f"no {by}"
        rows = [row for row in found if row.verdict == changes.UNMEASURED and (by, row.spec) != (BASE, BASE)]
        return [Fault(UNCOUNTED, row.run, f"{row.name}: {lack} in both runs") for row in rows]
    how = "count both runs with scripts/stepwise flops --measure"
    rows = [row for row in found if row.threads == 1 and not row.verdict.startswith(NONE)]
    told = {row: f"{row.spec} {row.scene}; {how} -n {row.height} --run RUN" for row in rows}
    return [
        Fault(UNCOUNTED, r.run, f"not counted in both: {told[r]}") for r in rows if r.instructions is None
    ]


def chance(found: Sequence[Row]) -> list[str]:
    """What is left of it, and what so few launches cannot tell."""
    judged = [row for row in found if row.p is not None]
    if not judged:
        return []
    several = "verdicts, corrected together (Benjamini and Hochberg)" if len(judged) > 1 else "verdict"
    said = f"by chance something is called slower in at most {100 * LEVEL:.3g} % of comparisons"
    lines = [f"{len(judged)} {several}: {said}"]
    fewest = min(min(row.base_ms.launches, row.ms.launches) for row in judged)
    if significance.family(fewest) < len(judged):
        lines.append(f"{fewest} launches are too few to tell a single slower one among {len(judged)}")
    return ["", *lines]


def run(args: argparse.Namespace) -> Outcome:
    if args.history or args.export:
        if args.history and args.export:
            raise StudyError("--history or --export, not both")
        if args.export and len(args.runs) != 1:
            raise StudyError(f"--export takes one RUN, not {len(args.runs)}")
        if args.history:
            return over_time(args)
        one = Run.open(args.runs[0])
        github = args.export == EXPORTS[0]
        made: Any = benchmark(one, args.by == "baseline") if github else programs.hyperfine(one)
        if args.out:
            store.write_json(args.out, made)
        return Outcome(made, [] if args.out else [json.dumps(cli.plain(made), indent=1)])
    if not 2 <= len(args.runs) <= len(ascii_uppercase):
        raise StudyError(f"2 to {len(ascii_uppercase)} runs are compared, not {len(args.runs)}")
    lettered = zip(ascii_uppercase, args.runs, strict=False)
    sides = [two_runs.read(letter, path, args.leave_out_off_clock) for letter, path in lettered]
    base, *others = sides
    if args.by != "time" and (other := next((s.run for s in sides if s.run.plan.programs), None)):
        raise StudyError(f"--by {args.by} is of phases, and {other} is of other programs: leave it out")
    lenient = MACHINE in args.allow
    found = [row for other in others for row in changes.rows(base, other, args.by, args.least, lenient)]
    found.sort(key=lambda row: (*row.key, row.run))
    found = changes.judged(found, args.by, args.least_work, args.least)
    if args.confirm:
        found = confirmed(found, sides, args)
    first = [fault for other in others for fault in two_runs.warnings(base, other, lenient)]
    if not found and not first:
        raise StudyError(f"{', '.join(str(side.run) for side in sides)}: no phase, scene and size in common")
    missing = [fault for other in others for fault in two_runs.faults(base, other)]
    missing += uncounted(found, args.by)
    new = [f"only in {other.letter}: {name}" for other in others for name in other.beyond(base)]
    differ = two_runs.differences(sides)
    told: dict[str, Any] = {"seed": args.seed} if args.confirm else {}
    told |= {"runs": {side.letter: str(side.run) for side in sides}, "rows": found}
    told |= {"no_verdict": first, "missing": missing, "new": new, "differences": differ}
    told |= {"off_clock": {side.letter: list(side.off) for side in sides}}
    left = "left out of" if args.leave_out_off_clock else "in"
    lines = [*shown(sides, first, found, args.by), *chance(found)]
    lines += [f"{left} {side.letter}: {one.text()}" for side in sides for one in side.off]
    lines += [*(fault.text for fault in missing), *new]
    known = all(side.run.context.git.commit for side in sides)  # not of what another tool measured
    same = "machine, compiler and commit are the same" if known else "what is known of both is the same"
    lines.append(f"\n{'what differs' if differ else same}")
    for name, values in differ.items():
        lines += [f"  {name}", *(f"    {letter}  {value}" for letter, value in values.items())]
    if read := [side.letter for side in sides if side.run.plan.read_from]:
        lines.append(f"no more is known of the machine of {', '.join(read)}: imported")
    if not args.fail_on_slower:
        return Outcome(told, lines)
    names = {row: f"{row.name} ({row.why(args.by)})" for row in found}
    kinds = {SLOWER: SLOWER, changes.FEW: two_runs.FEW}
    bad = [row for row in found if row.verdict in kinds]
    told_of = [Fault(kinds[row.verdict], row.run, f"{row.verdict} in {row.run}: {names[row]}") for row in bad]
    stopping = [one for one in (*first, *missing, *told_of) if one.kind not in args.allow]
    return Outcome(told, lines, failed=[one.text for one in stopping])
