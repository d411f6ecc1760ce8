"""One phase over many runs: its times by machine and date, and where they step."""

import functools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from study.core import show
from study.core.json_files import stored
from study.core.registry import BASE
from study.core.store import Run
from study.numbers import analysis, programs, stats, summary
from study.numbers.analysis import Cell
from study.numbers.stats import Interval

STEP = 0.05  # a smaller change is not told from another hour of the same machine
COLUMNS = [("made", "made (UTC)"), ("commit", "commit"), ("run", "run"), ("scene", "scene"), ("size", "size")]
COLUMNS += [("threads", "threads"), ("lanes", "lanes"), ("ms", "ms [95 %]")]
COLUMNS += [("over_base", "× baseline [95 %]"), ("ghz", "GHz"), ("step", "step: before / after [95 %]")]


@dataclass(frozen=True)
class Point:
    """One configuration of one run. `made`: ISO 8601, UTC. `over_base`: baseline's time over the phase's in
    the same run; `ghz`: the core's clock, NaN if it was not measured. `change`: the time of the point before
    over this one's, on the same machine and of the same work; `step`: whether that is a step."""

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
        return show.size(self.width, self.height)


def runs(*places: Path) -> list[Run]:
    """All runs at and below `places`, from the oldest to the newest."""
    found = [Run(folder) for folder in {path.parent for place in places for path in place.rglob("plan.json")}]
    return sorted(
        (run for run in found if stored(run.frames_path).exists()),
        key=lambda run: str(run.context.time),
    )


def machine(run: Run) -> str:
    """What the times of two runs must have in common: kind of the CPU, and how many there are."""
    cpu = run.context.cpu
    names = [cpu.microarchitecture, cpu.model]
    return f"{', '.join(name for name in names if name)}; {cpu.logical_cpus or '?'} CPUs"


@functools.lru_cache(maxsize=64)
def _timed(run: Run) -> list[Cell]:
    return analysis.cells_of(run.frames())


def points(found: Iterable[Run], spec: str, scenes: Sequence[str] = ()) -> list[Point]:
    """One a configuration and run that timed the phase, those of one machine and work together and by age."""
    made: list[Point] = []
    last: dict = {}
    for run in found:
        cells = analysis.by_key(_timed(run))
        context = run.context
        commit = (context.git.commit or "unknown")[:9] + ("+" if context.git.dirty else "")
        about = (machine(run), str(context.time)[:16], commit, "/".join(run.path.parts[-2:]))
        for key, cell in sorted(cells.items()):
            if cell.spec != spec or (scenes and cell.scene not in scenes):
                continue
            base = cells.get((*key[:-1], BASE)) if spec != BASE else None
            facts, ns = cell.facts, programs.calm(cell.values).ns
            lanes = int(facts.lanes) if facts.lanes and facts.lanes == facts.lanes else None
            work = (about[0], *key, cell.scene_hash, facts.hit_distance, facts.max_steps, lanes)
            change = stats.ratio_interval(last[work], ns, rounds=False) if work in last else None
            last[work] = ns
            step = change is not None and change.excludes_one and abs(change.value - 1) >= STEP
            over = cell.over(base) if base else None
            ms, ghz = stats.median_interval(ns / 1e6), cell.median("core_hz").value / 1e9
            made.append(Point(*about, *key[:-1], lanes, ms, over, ghz, change, step))

    def order(one: Point) -> tuple:
        return one.machine, one.scene, one.height, one.width, one.threads, one.lanes or 0, one.made

    return sorted(made, key=order)


def shown(points: Sequence[Point]) -> list[dict[str, object]]:
    """A row a point, in text (COLUMNS); `step` names how a point differs from the one above it."""
    made = []
    for point in points:
        step = ""
        if point.step and point.change:
            step = f"{'faster' if point.change.value > 1 else 'slower'} {point.change.text()}"
        told = {"size": point.size, "ms": summary.cell(point.ms), "lanes": point.lanes or "", "step": step}
        told["over_base"] = summary.cell(point.over_base)
        made.append(vars(point) | told | {"ghz": "" if math.isnan(point.ghz) else f"{point.ghz:.2f}"})
    return made
