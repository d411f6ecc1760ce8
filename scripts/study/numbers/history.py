"""One phase over many runs: its times by machine and date, and where they step."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from study.core.json_files import stored
from study.core.registry import BASE
from study.core.store import RESULTS, Run
from study.numbers import clocks, stats
from study.numbers.stats import Interval

STEP = 0.05  # a smaller change is not told from another hour of the same machine
WHERE = ["scene", "width", "height", "threads"]
COLUMNS = [("made", "made (UTC)"), ("commit", "commit"), ("run", "run"), ("scene", "scene"), ("size", "size")]
COLUMNS += [
    ("threads", "threads"),
    ("lanes", "lanes"),
    ("ms", "ms [95 %]"),
    ("over_base", "× baseline [95 %]"),
    ("ghz", "GHz"),
]
COLUMNS += [("step", "step: before / after [95 %]")]


@dataclass(frozen=True)
class Point:
    """One configuration of one run.

    `made`: ISO 8601, UTC. `ms` of a frame; `over_base`: baseline's time over the phase's in the same run;
    `ghz`: the core's clock, NaN if it was not measured. `change`: the time of the point before over that of
    this one, on the same machine and of the same work; `step`: whether that is a step.
    """

    machine: str
    made: str
    commit: str
    run: str
    scene: str
    width: int
    height: int
    threads: int
    lanes: int | None
    ms: Interval
    over_base: Interval | None
    ghz: float
    change: Interval | None = None
    step: bool = False

    @property
    def size(self) -> str:
        return f"{self.width}x{self.height}"


def runs(results: Path = RESULTS) -> list[Run]:
    """All runs below `results`, the published ones too, from the oldest to the newest."""
    folders = [path.parent for path in results.glob("*/*/plan.json")]
    found = [Run(folder) for folder in folders]
    return sorted(
        (run for run in found if stored(run.frames_path).exists()),
        key=lambda run: str(run.context.time),
    )


def machine(run: Run) -> str:
    """What the times of two runs must have in common: kind of the CPU, and how many there are."""
    cpu = run.context.cpu
    names = [cpu.microarchitecture, cpu.model]
    return f"{', '.join(name for name in names if name)}; {cpu.logical_cpus or '?'} CPUs"


def points(found: Iterable[Run], spec: str, scenes: Sequence[str] = ()) -> list[Point]:
    """One a configuration and run that timed the phase, those of one machine and work together and by age."""
    made, last = [], {}
    for run in found:
        frames = clocks.clocked(run.frames())
        times = stats.launch_values(frames, "ns")
        hz = frames.groupby([*WHERE, "spec"])["core_hz"].median()
        groups = {key: group.set_index("round")["value"] for key, group in times.groupby([*WHERE, "spec"])}
        for (*where, name), ns in groups.items():
            if name != spec or (scenes and where[0] not in scenes):
                continue
            base = groups.get((*where, BASE)) if name != BASE else None
            content, limit, steps, lanes = _work(frames, where[0], name)
            work = (machine(run), *where, content, limit, steps, lanes)
            before = last.get(work)
            change = None if before is None else stats.ratio_interval(before, ns, rounds=False)
            last[work] = ns
            git = run.context.git
            made.append(
                Point(
                    machine(run),
                    str(run.context.time)[:16],
                    (git.commit or "unknown")[:9] + ("+" if git.dirty else ""),
                    "/".join(run.path.parts[-2:]),
                    *where,
                    int(lanes) if lanes and lanes == lanes else None,
                    stats.median_interval(ns / 1e6),
                    None if base is None else stats.ratio_interval(base, ns),
                    float(hz[(*where, name)]) / 1e9,
                    change,
                    change is not None and _steps(change),
                )
            )
    return sorted(
        made,
        key=lambda one: (
            one.machine,
            one.scene,
            one.height,
            one.width,
            one.threads,
            one.lanes or 0,
            one.made,
        ),
    )


def _work(frames: pd.DataFrame, scene: str, spec: str) -> tuple:
    """What times must have in common: the scene's content, the march's limits and the lanes."""
    first = frames[(frames["scene"] == scene) & (frames["spec"] == spec)].iloc[0]
    return first["scene_hash"], first["hit_distance"], first["max_steps"], first.get("lanes")


def _steps(change: Interval) -> bool:
    away = change.low > 1 or change.high < 1
    return change.sufficient and away and abs(change.value - 1) >= STEP


def shown(points: Sequence[Point]) -> list[dict[str, object]]:
    """A row a point, in text (COLUMNS); `step` names how a point differs from the one above it."""
    made = []
    for point in points:
        step = ""
        if point.step and point.change:
            step = f"{'faster' if point.change.value > 1 else 'slower'} {point.change.text()}"
        over = point.over_base.text(".4g") if point.over_base else ""
        made.append(
            vars(point)
            | {
                "size": point.size,
                "ms": point.ms.text(),
                "over_base": over,
                "lanes": point.lanes or "",
                "ghz": f"{point.ghz:.2f}",
                "step": step,
            }
        )
    return made
