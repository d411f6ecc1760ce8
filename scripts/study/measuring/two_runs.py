"""Runs beside one base: what they have in common, what differs, and what of the base a run lacks."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from operator import attrgetter
from pathlib import Path
from typing import Any, Self

import pandas as pd

from study.bounds import ceilings
from study.core import show
from study.core.cli import StudyError
from study.core.store import Run
from study.numbers import accuracy, clocks
from study.numbers.schema import Verify

KEY = ["scene", "width", "height", "threads", "spec"]
LIMITS = ["hit_distance", "max_steps", "scene_hash"]
CONTEXT = (
    *("compiler", "libc", "kernel", "system", "hypervisor", "governor"),
    *("no_turbo", "boost", "huge_pages", "memory_kib"),
    *(f"cpu.{name}" for name in ("model", "microarchitecture", "stepping", "microcode", "logical_cpus")),
    *("pinned.core_type", "git.commit", "git.dirty", "git.diff_sha256"),
)
KINDS = ("vanished", "failed", "unverified", "machine", "scene", "size", "uncounted", "few")
VANISHED, BROKEN, UNVERIFIED, MACHINE, SCENE, SIZE, UNCOUNTED, FEW = KINDS


@dataclass(frozen=True)
class Fault:
    """What stands in the way of a gate: its kind (KINDS, or slower), the run's letter, and a line."""

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
    found: dict[str, str] = {}
    for scene, both in _of_scene(sides):
        of = f"{scene}: " if scene else ""  # a program without a case
        for column in LIMITS:
            first, second = (sorted(set(frames.get(column, ()))) for frames in both)
            if first != second:
                said = " and ".join(", ".join(map(str, each)) for each in (first, second))
                found.setdefault(scene, f"{of}{column} differs ({said}); only the same work compares")
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
    """Why two runs are of two machines: CPU, CPUs, timer's rate, kind of core. None: nothing says so."""
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
    if side.run.plan.read_from:  # another tool's file knows little
        return {name: value for name, value in found.items() if value is not None}
    for (spec, flags, compiler, libc), _ in side.frames.groupby(["spec", "flags", "compiler", "libc"]):
        found[f"build of {spec}"] = f"{compiler}, glibc {libc}, {flags}"
    return found


def differences(sides: Sequence[Side]) -> dict[str, dict[str, Any]]:
    """Facts that are not the same in all runs that have them: name → letter → value."""
    told = {side.letter: facts(side) for side in sides}
    names = dict.fromkeys(name for each in told.values() for name in each)
    values = {name: {k: each[name] for k, each in told.items() if name in each} for name in names}
    return {name: each for name, each in values.items() if len({str(v) for v in each.values()}) > 1}
