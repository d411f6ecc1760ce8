"""What cost is measured against in scripts/scaling.py: the series, their points, the paper's law for each.

A point is one program on one picture; its x is what the series varies. All else of a series is fixed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from study import registry, run, scaling_scenes
from study.cli import StudyError
from study.registry import Scene, Spec

HEIGHTS = (100, 140, 200, 280, 400, 560, 800, 1120, 1600, 2240, 3200, 4000)
SHAPES = (1, 4, 16, 64, 256, 1024, 4096)
STEPS = (4, 8, 16, 32, 64, 128, 256, 512, 1024, 2048)
BOUNCES = (0, 1, 2, 4, 8, 16)
STEP_SHAPES = 64  # of the corridors that the step cap is tried on
STEEPEST = 1.0  # above what a series is foreseen to grow by: what one step may show
Row = dict[str, Any]
LAW = "O(K·T·N²)"  # of P1: N × N pixels, T shapes, K the largest number of steps


@dataclass(frozen=True)
class Picture:
    """What is rendered: a scene at a size, by a number of threads, under a step cap (None: the scene's)."""

    scene: str
    path: Path
    height: int
    width: int
    threads: int = 1
    max_steps: int | None = None

    @property
    def options(self) -> dict[str, Any]:
        return {"threads": self.threads, "max_steps": self.max_steps}


@dataclass(frozen=True)
class Point:
    """`spec` on the picture that `x` stands for."""

    series: str
    x: int
    spec: Spec

    def __str__(self) -> str:
        return f"{self.series} {self.x} {self.spec}"


@dataclass(frozen=True)
class Series:
    """`grows`: exponent that costs are foreseen by; `paper`: the one of its law, None where it has none.

    `scene(x)` and `picture(x)` make a generated scene's file when it is first asked for.
    """

    name: str
    title: str
    axis: str
    xs: tuple[int, ...]
    grows: float
    paper: float | None
    height: int
    scene: Callable[[int], Scene]
    varies: str = ""  # height, threads or max_steps; "": the scene itself
    threads_only: bool = False
    weight: int = 1  # of its share of the time

    @property
    def generated(self) -> bool:
        """Whether each x has a scene of its own."""
        return not self.varies

    def picture(self, x: int) -> Picture:
        scene = self.scene(x)
        height = x if self.varies == "height" else self.height
        more = {self.varies: x} if self.varies in ("threads", "max_steps") else {}
        return Picture(scene.name, scene.path, height, scene.size(height)[0], **more)


def thread_counts(cpus: int) -> tuple[int, ...]:
    """Powers of two up to the CPUs there are, and all of them."""
    powers = [1 << i for i in range(cpus.bit_length()) if 1 << i <= cpus]
    return tuple(sorted({*powers, cpus}))


def foreseen(before: tuple[float, float] | None, last: tuple[float, float], x: float, grows: float) -> float:
    """Seconds of a frame at x, from the last point (x, s) and the one before: at least as `grows` says."""
    slope = grows
    if before is not None and before[0] != last[0]:
        seen = math.log(last[1] / before[1]) / math.log(last[0] / before[0])
        slope = min(max(seen, grows), grows + STEEPEST)
    return last[1] * (x / last[0]) ** slope


def series(height: int, seed: int, folder: Path, heights: Sequence[int] = HEIGHTS) -> dict[str, Series]:
    """All series by name. `height`: of the pictures where it is not what varies; `folder`: for scenes."""

    def known(name: str) -> Callable[[int], Scene]:
        return lambda x: registry.find_scene(name)

    made = [
        Series(
            f"n-{name}",
            f"picture height, {name}",
            "n, pixels",
            tuple(heights),
            *(2, 2, height),
            known(name),
            "height",
            weight=weight,
        )
        for name, weight in (("scene0", 2), ("mandelbulb", 1))
    ]
    about = {"corridors": "corridors (worst case)"}
    made += [
        Series(
            f"shapes-{name}",
            f"number of shapes, {about.get(name, name)}",
            "shapes",
            SHAPES,
            *(1.2, 1, height),
            lambda x, name=name: scaling_scenes.of_shapes(name, x, seed, folder),
            weight=2 if name == "scattered" else 1,
        )
        for name in scaling_scenes.ARRANGEMENTS
    ]
    made += [
        Series(
            "steps-scene0", "step cap, scene0", "step cap", STEPS, 1, 1, height, known("scene0"), "max_steps"
        ),
        Series(
            "steps-corridors",
            f"step cap, corridors of {STEP_SHAPES} shapes",
            "step cap",
            STEPS,
            *(1, 1, height),
            lambda x: scaling_scenes.of_shapes("corridors", STEP_SHAPES, seed, folder),
            "max_steps",
        ),
        Series(
            "bounces",
            "rays in a chain of mirrors (bounces + 1)",
            "rays",
            tuple(b + 1 for b in BOUNCES),
            *(1, None, height),
            lambda x: scaling_scenes.of_mirrors(x - 1, folder),
        ),
        Series(
            "threads",
            "threads, scene0",
            "threads",
            thread_counts(len(run.USABLE)),
            *(0, None, 2 * height),
            known("scene0"),
            "threads",
            threads_only=True,
        ),
    ]
    return {one.name: one for one in made}


def chosen(known: dict[str, Series], names: Sequence[str]) -> list[Series]:
    """Those asked for: by name, or all that begin so (n, shapes, steps). Raises StudyError."""
    found: dict[str, Series] = {}
    for name in names:
        some = {k: v for k, v in known.items() if k == name or k.startswith(f"{name}-")}
        if not some:
            raise StudyError(f"no series '{name}'; there are {', '.join(known)}")
        found |= some
    return [known[name] for name in known if name in found]
