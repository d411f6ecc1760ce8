"""CPU-RTRM's scene (common/scenes/lattice.json) by every phase of the ladder.

The scene is made from a description of that program's: an infinite lattice of rounded cubes and spheres. What
it takes for a frame was measured elsewhere, by others.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import msgspec

from study.core import registry
from study.core.registry import Scene
from study.experiments.lattice.schema import Program, Row
from study.measuring.launches import Size, milliseconds
from study.measuring.schema import HitErrors
from study.numbers import stats
from study.numbers.schema import Interval

FILE, SCENE = "lattice.json", "lattice"
SIZES = ((1000, 562), (1280, 720))
PROGRAM = Program(size=[1280, 720], ms={"1": 57.7, "2": 33.1}, machine="a 2-core Zen 5 VM at 4.27 GHz")
PAPER = 14.0  # times as fast as CPU-RTRM with threads, as the paper has its own last step


@dataclass(frozen=True)
class Point:
    """A phase at a size on a number of threads."""

    phase: str
    size: Size
    threads: int


def points(names: Sequence[str], sizes: Sequence[Size], threads: Sequence[int]) -> list[Point]:
    """Every phase at every size, with more threads where it has them."""
    return [
        Point(name, size, count)
        for size in sizes
        for name in names
        for count in dict.fromkeys(threads)
        if count == 1 or registry.find_phase(name).threads
    ]


def once(point: Point, scene: Scene, padding: int, cpu: int) -> float:
    """Median ms of a launch's frames: one frame of the phases in doubles, which take seconds."""
    slow = registry.find_phase(point.phase).precision == "double"
    warmup, reps = (0, 1) if slow else (1, 5)
    return milliseconds(
        point.phase, scene, point.size, reps, padding, cpu=cpu, threads=point.threads, warmup=warmup
    )


def row(point: Point, times: Sequence[float], errors: Mapping[str, HitErrors]) -> Row:
    """Ms, and times as fast as CPU-RTRM's figure. `times`: in ms."""
    theirs = PROGRAM.ms.get(str(point.threads)) if [*point.size] == PROGRAM.size else None
    ms = Interval.of(stats.median_interval(times))
    over: dict[str, Any] = {
        name: theirs / end if theirs and end else None
        for name, end in (("program", ms.value), ("program_low", ms.high), ("program_high", ms.low))
    }
    return Row(
        phase=point.phase,
        width=point.size[0],
        n=point.size[1],
        threads=point.threads,
        ms=ms.value,
        ms_low=ms.low,
        ms_high=ms.high,
        ns=[one * 1e6 for one in times],
        program_ms=theirs,
        **over,
        **msgspec.structs.asdict(errors[point.phase]),
    )
