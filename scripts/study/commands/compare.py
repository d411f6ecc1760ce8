"""Any number of runs beside one base: what got slower, what faster, what moved, and what differs."""

import argparse
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from operator import attrgetter
from pathlib import Path
from string import ascii_uppercase
from typing import Any, Self

import pandas as pd

from study.bounds import ceilings
from study.core import cli, show, store
from study.core.cli import Outcome, StudyError
from study.core.registry import BASE
from study.core.store import Run
from study.numbers import accuracy, analysis, clocks, history, stats, summary
from study.numbers.schema import Verify
from study.numbers.stats import Interval

DESCRIPTION = """\
Compares the times of runs with those of a base, configuration by configuration. The ratio is that of the
medians, base over run: over 1, the run is faster. Its 95 % interval is a bootstrap over launches. Time is
cycles over clock: the ratios of cycles and of clocks stand beside it, and the one that changed is named.
"Slower" and "faster" mean that the interval excludes 1. Of forty configurations without a change, two are
called so by chance. A machine that was busier during one of the runs adds more: launches of one run do not
show that.

Runs of two machines, different scenes and other sizes of the picture are said first and get no verdict.

With --fail-on-slower the status is 1 for a configuration that is slower, or that the run lacks (vanished).
It is also 1 for a phase outside its tolerance (failed) or not judged (unverified), and for runs without
a verdict (machine, scene, size). --allow names what is let through."""
STATUSES = {1: "with --fail-on-slower: see above"}
KEY = ["scene", "width", "height", "threads", "spec"]
LIMITS = ["hit_distance", "max_steps", "scene_hash"]
COLUMNS = [("spec", "phase"), ("scene", "scene"), ("size", "size"), ("threads", "threads"), ("run", "run")]
COLUMNS += [("base_ms", "A ms [95 %]"), ("ms", "run ms [95 %]"), ("time", "time A / run [95 %]")]
COLUMNS += [("cycles", "cycles A / run [95 %]"), ("clock", "clock run / A [95 %]")]
COLUMNS += [("baseline", "× baseline, run / A [95 %]"), ("moved", "moved")]
COLUMNS += [("verdict", "run is")]
CONTEXT = (
    *("compiler", "libc", "kernel", "system", "hypervisor", "governor", "no_turbo", "memory_kib"),
    *(f"cpu.{name}" for name in ("model", "microarchitecture", "stepping", "microcode", "logical_cpus")),
    *("pinned.core_type", "git.commit", "git.dirty", "git.diff_sha256"),
)
EXPORTS = ("github-action-benchmark",)
MOVED = 0.005  # a quantity that changed by less is not what moved, however narrow its interval
SLOWER, SAME, FEW = "slower", "the same within noise", "unknown (too few launches)"
NONE = "no verdict"
KINDS = ("vanished", "failed", "unverified", "machine", "scene", "size")
VANISHED, BROKEN, UNVERIFIED, MACHINE, SCENE, SIZE = KINDS


@dataclass(frozen=True)
class Fault:
    """What stands in the way of a gate: its kind (KINDS, or SLOWER), the run's letter, and a line."""

    kind: str
    run: str
    text: str


@dataclass(frozen=True)
class Side:
    """One run of the comparison: its letter, frames, and launches whose clock is off."""

    letter: str
    run: Run
    frames: pd.DataFrame
    off: Sequence[clocks.Off] = ()

    def beyond(self, other: Self) -> list[str]:
        """Configurations that this run has and the other has not, those of a phase and scene in one line."""
        mine, theirs = (set(side.frames[KEY].itertuples(index=False, name=None)) for side in (self, other))
        sizes: dict[str, list[str]] = {}
        for scene, width, height, threads, spec in sorted(mine - theirs):
            said = show.size(width, height) + (f" on {threads} threads" if threads > 1 else "")
            sizes.setdefault(f"{spec} {scene}", []).append(said)
        return [f"{name} {', '.join(each)}".strip() for name, each in sizes.items()]


def read(letter: str, path: Path, leave_out: bool) -> Side:
    """StudyError for a folder that is no run, has no timed frame or a broken context."""
    run = Run.open(path)
    frames = run.frames()
    _ = run.context
    if frames.empty or frames.warmup.all():
        raise StudyError(f"{run}: no timed frame; measure with scripts/stepwise sweep --run {run} --resume")
    off = clocks.off(frames)
    return Side(letter, run, clocks.without(frames, off) if leave_out else frames, off)


def _of_scene(sides: Sequence[Side]) -> Iterator[tuple[str, list[pd.DataFrame]]]:
    frames = [dict(iter(side.frames.groupby("scene"))) for side in sides]
    for scene in sorted(frames[0].keys() & frames[1].keys()):
        yield str(scene), [each[scene] for each in frames]


def other_work(*sides: Side) -> dict[str, str]:
    """Scene → why its times cannot be compared: of another content, or by other limits."""
    found = {}
    for scene, both in _of_scene(sides):
        for column in LIMITS:
            first, second = (sorted(set(frames.get(column, ()))) for frames in both)
            if first != second:
                said = " and ".join(", ".join(map(str, each)) for each in (first, second))
                found.setdefault(scene, f"{scene}: {column} differs ({said}); only the same work compares")
    return found


def other_sizes(*sides: Side) -> dict[str, str]:
    """Scenes that no size of the picture has in common → what each run has."""
    found = {}
    for scene, both in _of_scene(sides):
        first, second = (set(zip(frames.width, frames.height, strict=True)) for frames in both)
        if not first & second:
            said = " and ".join(", ".join(f"{w}x{h}" for w, h in sorted(each)) for each in (first, second))
            found[scene] = f"{scene}: other sizes ({said})"
    return found


def other_machine(base: Side, other: Side) -> str | None:
    """Why two runs are of two machines: CPU, CPUs, TSC rate, kind of core. None: nothing says so."""
    kinds = [side.run.context.pinned.core_type for side in (base, other)]
    cpus = [side.run.context.cpu for side in (base, other)]
    rates = [float(clocks.clocked(side.frames).tsc_hz.median()) for side in (base, other)]
    counts = [cpu.logical_cpus for cpu in cpus]
    if not ceilings.other_cpu(*cpus, rates) and (None in counts or counts[0] == counts[1]):
        same = None in kinds or kinds[0] == kinds[1]
        return None if same else f"other core types: {' and '.join(kinds)}"
    said = [
        ceilings.describe(cpu, hz) + (f", {n} CPUs" if n else "")
        for cpu, hz, n in zip(cpus, rates, counts, strict=True)
    ]
    return "other machines: " + " and ".join(said)


def _values(frames: pd.DataFrame) -> dict[tuple, pd.DataFrame]:
    """Configuration → its launches: ns, core_cycles, core_hz (NaN where the run has none)."""
    return {key: cell.values for key, cell in analysis.by_key(analysis.cells_of(frames)).items()}


def ratio(base: pd.Series, other: pd.Series) -> Interval | None:
    """Base over other; None where one of them was not measured."""
    if not (base.notna().all() and other.notna().all()):
        return None
    return stats.ratio_interval(base.to_numpy(float), other.to_numpy(float), rounds=False)  # none in common


def over_baseline(key: tuple, base: dict, other: dict) -> Interval | None:
    """The phase's speed-up over baseline in `other` by that in `base`; None for baseline and without it.

    Both speed-ups are of one interleaved run each: what slows a whole run is in neither.
    """
    first = (*key[:-1], BASE)
    if key[-1] == BASE or first not in base or first not in other:
        return None
    pairs = [tuple(one[name].ns for name in (first, key)) for one in (base, other)]
    return stats.change_interval(*pairs)


def judge(found: Interval | None) -> str:
    if found is None:
        return f"{NONE} (not measured)"
    if not found.sufficient:
        return FEW
    return "faster" if found.low > 1 else SLOWER if found.high < 1 else SAME


def moved(cycles: Interval | None, clock: Interval | None) -> str:
    """Which of the two changed: its interval excludes 1, and by MOVED or more."""
    changed = [
        name
        for name, found in (("cycles", cycles), ("clock", clock))
        if found is not None and judge(found) in ("faster", SLOWER) and abs(found.value - 1) >= MOVED
    ]
    return " and ".join(changed)


@dataclass(frozen=True)
class Row:
    """A configuration of both runs: times, and the ratios of the base over the run; None: not measured."""

    scene: str
    width: int
    height: int
    threads: int
    spec: str
    size: str
    run: str
    base_ms: Interval
    ms: Interval
    time: Interval | None
    cycles: Interval | None
    clock: Interval | None
    baseline: Interval | None
    moved: str
    verdict: str


def rows(base: Side, other: Side, by: str = "time", machine_may_differ: bool = False) -> list[Row]:
    """`by`: the ratio that the verdict is of, time, cycles or baseline. Other work has no ratio."""
    ours, theirs = _values(base.frames), _values(other.frames)
    no_scene = other_work(base, other)
    another = not machine_may_differ and other_machine(base, other) is not None
    found = []
    for key in ours.keys() & theirs.keys():
        a, b = ours[key], theirs[key]
        same = key[0] not in no_scene
        ratios = {
            "time": ratio(a.ns, b.ns),
            "cycles": ratio(a.core_cycles, b.core_cycles),
            "clock": ratio(b.core_hz, a.core_hz),
            "baseline": over_baseline(key, ours, theirs),
        }
        if not same:
            ratios = dict.fromkeys(ratios)
        verdict = judge(ratios[by])
        if another or not same:
            verdict = f"{NONE} (other {'machine' if same else 'scene'})"
        times = [stats.median_interval(one.ns / 1e6) for one in (a, b)]
        about = (show.size(*key[1:3]), other.letter, *times)
        changed = moved(ratios["cycles"], ratios["clock"])
        found.append(Row(*key, *about, *ratios.values(), moved=changed, verdict=verdict))
    return found


def warnings(base: Side, other: Side, machine_may_differ: bool) -> list[Fault]:
    found = [Fault(SCENE, other.letter, text) for text in other_work(base, other).values()]
    found += [Fault(SIZE, other.letter, text) for text in other_sizes(base, other).values()]
    if (text := other_machine(base, other)) and not machine_may_differ:
        found.insert(0, Fault(MACHINE, other.letter, text))
    return found


def judged(run: Run) -> dict[tuple[str, str], bool]:
    """(phase, scene) → within its tolerance, of all sizes, against baseline and against ground truth."""
    verified = Verify.load_if_there(run.path / "verify.json")
    told = [
        (one.phase, one.scene, one.within_tolerance) for one in (verified.pairs if verified else None) or []
    ]
    told += [(r.phase, r.scene, not r.failed) for r in accuracy.rows(run.path) if r.gated]
    found: dict[tuple[str, str], bool] = {}
    for phase, scene, within in told:
        if isinstance(within, bool):
            found[phase, scene] = found.get((phase, scene), True) and within
    return found


def faults(base: Side, other: Side) -> list[Fault]:
    """What the base has and the run lacks: configurations, and phases that are (still) within tolerance."""
    sizes = other_sizes(base, other)  # those are said already
    known = base.frames[~base.frames.scene.isin(list(sizes))]
    absent = replace(base, frames=known).beyond(other)
    found = [Fault(VANISHED, other.letter, f"not in {other.letter}: {name}") for name in absent]
    before, now = judged(base.run), judged(other.run)
    timed = set(base.frames[["phase", "scene"]].itertuples(index=False, name=None))
    for phase, scene in sorted(timed):
        if now.get((phase, scene)) is False:
            found.append(
                Fault(BROKEN, other.letter, f"outside its tolerance in {other.letter}: {phase} {scene}")
            )
        elif before.get((phase, scene)) and (phase, scene) not in now:
            found.append(Fault(UNVERIFIED, other.letter, f"not verified in {other.letter}: {phase} {scene}"))
    return found


def facts(side: Side) -> dict[str, Any]:
    """What may explain a difference: from the context, and flags and compiler of each spec."""
    found = {name: attrgetter(name)(side.run.context) for name in CONTEXT}
    for (spec, flags, compiler, libc), _ in side.frames.groupby(["spec", "flags", "compiler", "libc"]):
        found[f"build of {spec}"] = f"{compiler}, glibc {libc}, {flags}"
    return found


def differences(sides: Sequence[Side]) -> dict[str, dict[str, Any]]:
    """Facts that are not the same in all runs that have them: name → letter → value."""
    told = {side.letter: facts(side) for side in sides}
    names = dict.fromkeys(name for each in told.values() for name in each)
    values = {name: {k: each[name] for k, each in told.items() if name in each} for name in names}
    return {name: each for name, each in values.items() if len({str(v) for v in each.values()}) > 1}


def options(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("runs", metavar="RUN", nargs="*", type=Path, help="folders of runs, the base first")
    add("--by", choices=("time", "cycles", "baseline"), default="time", help="of the verdict; default: time")
    about = "leave out launches whose TSC rate is 0.01 %% off the run's, or whose core clock 3 %% off its "
    add("--leave-out-off-clock", action="store_true", help=about + "configuration's")
    add("--fail-on-slower", action="store_true", help="a gate: status 1, see above")
    about = f"do not fail for it (machine: and give a verdict): {', '.join(KINDS)}; may be repeated"
    add("--allow", action="append", default=[], choices=KINDS, metavar="KIND", help=about)
    about = "instead: this phase in all runs below results/, by machine and date, with its steps"
    add("--history", metavar="PHASE", help=about)
    add("--scene", nargs="+", default=[], metavar="SCENE", help="of --history; default: all")
    about = "instead: the times of one RUN for other programs; with --by baseline over baseline's"
    add("--export", choices=EXPORTS, help=about)
    add("-o", "--out", type=Path, metavar="PATH", help="of --export; default: standard output")


def shown(sides: Sequence[Side], first: Sequence[Fault], found: Sequence[Row], by: str) -> list[str]:
    lines = [f"{side.letter}: {side.run}" for side in sides]
    lines += [*(f"{NONE} on {one.run}: {one.text}" for one in first), ""]
    if found:
        columns = [one for one in COLUMNS if by == "baseline" or one[0] != "baseline"]
        lines.append(summary.table(found, columns))
    return lines


def over_time(args: argparse.Namespace) -> Outcome:
    """A table a machine; `step` names how a point differs from the one above it."""
    points = history.points(history.runs(), args.history, args.scene)
    if not points:
        on = " on " + " ".join(args.scene) if args.scene else ""
        raise StudyError(f"no run has timed {args.history}{on}")
    lines = []
    for machine in dict.fromkeys(point.machine for point in points):
        rows = history.shown([point for point in points if point.machine == machine])
        lines += [machine, "", summary.table(rows, history.COLUMNS), ""]
    return Outcome({"points": points}, lines)


def benchmark(run: Run, by_baseline: bool) -> list[dict[str, Any]]:
    """As the tool `customSmallerIsBetter` of github-action-benchmark reads it (its README, "Custom").

    `by_baseline`: the unit is baseline's time in the same run, which other hours and runners change least.
    """
    cells, found = analysis.by_key(analysis.cells_of(run.frames())), []
    for (scene, width, height, threads, spec), cell in sorted(cells.items()):
        base, time = (
            cells.get((scene, width, height, threads, BASE)),
            stats.median_interval(cell.values.ns / 1e6),
        )
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


def run(args: argparse.Namespace) -> Outcome:
    if args.history or args.export:
        if len(args.runs) != (0 if args.history else 1) or (args.history and args.export):
            raise StudyError("--history takes no RUN, --export takes one RUN; not both")
        if args.history:
            return over_time(args)
        made = benchmark(Run.open(args.runs[0]), args.by == "baseline")
        if args.out:
            store.write_json(args.out, made)
        return Outcome(made, [] if args.out else [json.dumps(cli.plain(made), indent=1)])
    if not 2 <= len(args.runs) <= len(ascii_uppercase):
        raise StudyError(f"2 to {len(ascii_uppercase)} runs are compared, not {len(args.runs)}")
    sides = [
        read(letter, path, args.leave_out_off_clock)
        for letter, path in zip(ascii_uppercase, args.runs, strict=False)
    ]
    base, *others = sides
    lenient = MACHINE in args.allow
    found = [row for other in others for row in rows(base, other, args.by, lenient)]
    found.sort(key=lambda row: (row.scene, row.width, row.height, row.threads, row.spec, row.run))
    first = [fault for other in others for fault in warnings(base, other, lenient)]
    if not found and not first:
        raise StudyError(f"{', '.join(str(side.run) for side in sides)}: no phase, scene and size in common")
    missing = [fault for other in others for fault in faults(base, other)]
    new = [f"only in {other.letter}: {name}" for other in others for name in other.beyond(base)]
    differ = differences(sides)
    told = {"runs": {side.letter: str(side.run) for side in sides}, "rows": found}
    told |= {"no_verdict": first, "missing": missing, "new": new, "differences": differ}
    told |= {"off_clock": {side.letter: list(side.off) for side in sides}}
    left = "left out of" if args.leave_out_off_clock else "in"
    lines = shown(sides, first, found, args.by)
    lines += [f"{left} {side.letter}: {one.text()}" for side in sides for one in side.off]
    lines += [*(fault.text for fault in missing), *new]
    lines.append("\nwhat differs" if differ else "\nmachine, compiler and commit are the same")
    for name, values in differ.items():
        lines += [f"  {name}", *(f"    {letter}  {value}" for letter, value in values.items())]
    if not args.fail_on_slower:
        return Outcome(told, lines)
    slower = [
        Fault(SLOWER, row.run, f"{SLOWER} in {row.run}: {row.spec} {row.scene} {row.size}")
        for row in found
        if row.verdict == SLOWER
    ]
    stopping = [one for one in (*first, *missing, *slower) if one.kind not in args.allow]
    return Outcome(told, lines, failed=[one.text for one in stopping])
