"""What cost is measured against in stepwise scaling: the series, their points, the paper's law for each.

A point is one program on one picture; its x is what the series varies. All else of a series is fixed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from study.core import generated_scenes as scaling_scenes
from study.core import registry, run
from study.core.cli import StudyError
from study.core.registry import Scene, Spec

HEIGHTS = (100, 140, 200, 280, 400, 560, 800, 1120, 1600, 2240, 3200, 4000)
SHAPES = (1, 4, 16, 64, 256, 1024, 4096)
STEPS = (4, 8, 16, 32, 64, 128, 256, 512, 1024, 2048)
BOUNCES = (0, 1, 2, 4, 8, 16)
STEP_SHAPES = 64  # of the corridors that the step cap is tried on
CROWD_HEIGHT, CROWD = 720, (16, 4096)  # of the goal: the pictures are 1280 × 720
EARLY = 3  # points that every program should have: fewer make no fit
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

    `first`: the x that every program should have before any other, three apart from one another or what a
    goal is judged on. `fast_only`: for the last programs of the ladder alone; `kept`: whether pictures are
    kept and judged. `scene(x)` and `picture(x)` make a generated scene's file when it is first asked for.
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
    first: tuple[int, ...] = ()
    fast_only: bool = False
    kept: bool = True
    # Where every launch has a scene of its own, that of a number; number 0 is `scene(x)`.
    drawn: Callable[[int, int], Scene] | None = None

    @property
    def order(self) -> list[int]:
        """All x by their worth: those of `first` (by itself the first three), then the others, upwards."""
        first = [x for x in self.first if x in self.xs] or list(self.xs[:EARLY])
        return first + [x for x in self.xs if x not in first]

    @property
    def generated(self) -> bool:
        """Whether each x has a scene of its own."""
        return not self.varies

    def picture(self, x: int, number: int = 0) -> Picture:
        """`number`: of the scene, where every launch has one of its own."""
        scene = self.drawn(x, number) if self.drawn else self.scene(x)
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


def guessed(trail: Sequence[tuple[float, float]], x: float, grows: float) -> float:
    """Seconds at x from all that is known of a program, in any order; 0 where nothing is.

    Beyond what is known as `foreseen` says, between two points on the line through them (in logarithms),
    below the least as long as that took.
    """
    known = sorted(trail)
    below, above = [one for one in known if one[0] < x], [one for one in known if one[0] > x]
    if not known:
        return 0.0
    if not above:
        return foreseen(below[-2] if len(below) > 1 else None, below[-1], x, grows)
    if not below:
        return above[0][1]
    (x0, s0), (x1, s1) = below[-1], above[0]
    return s0 * (s1 / s0) ** (math.log(x / x0) / math.log(x1 / x0))


def series(height: int, seed: int, folder: Path, heights: Sequence[int] = HEIGHTS) -> dict[str, Series]:
    """All series by name. `height`: of the pictures where it is not what varies; `folder`: for scenes."""

    def known(name: str) -> Callable[[int], Scene]:
        return lambda x: registry.find_scene(name)

    about = {"corridors": "corridors (worst case)"}

    def shapes(name: str) -> Callable[[int], Scene]:
        return lambda x: scaling_scenes.of_shapes(name, x, seed, folder)

    # What few shapes cost depends on where they are: between the extremes of eight scenes of 16 is a factor
    # of 3, of 4,096 of 1.1 (opt9_convex, Zen 3).
    def scattered(x: int, number: int) -> Scene:
        return scaling_scenes.of_shapes("scattered", x, seed + number, folder)

    def of_shapes(name: str, **more: Any) -> Series:
        title = f"number of shapes, {about.get(name, name)}"
        return Series(f"shapes-{name}", title, "shapes", SHAPES, 1.2, 1, height, shapes(name), **more)

    def of_heights(name: str, **more: Any) -> Series:
        title, xs = f"picture height, {name}", tuple(heights)
        return Series(f"n-{name}", title, "n, pixels", xs, 2, 2, height, known(name), "height", **more)

    def of_steps(name: str, title: str, scene: Callable[[int], Scene]) -> Series:
        some = {"first": (4, 32, 256)}
        return Series(f"steps-{name}", title, "step cap", STEPS, 1, 1, height, scene, "max_steps", **some)

    # By worth: what the goals are judged on, then the paper's law, then the rest.
    others = [name for name in scaling_scenes.ARRANGEMENTS if name != "scattered"]
    crowd = f"shapes, scattered, n = {CROWD_HEIGHT}, a scene for every launch"
    made = [
        Series(
            *("crowd", crowd, "shapes", CROWD, 0.3, 1, CROWD_HEIGHT, shapes("scattered")),
            **{"weight": 9, "fast_only": True, "kept": False, "drawn": scattered},
        ),
        Series(
            *("threads", "threads, scene0", "threads", thread_counts(len(run.USABLE)), 0, None, 2 * height),
            *(known("scene0"), "threads"),
            **{"threads_only": True, "first": (1, 2), "weight": 2},
        ),
        of_shapes("scattered", weight=2, first=(16, 4096, 256)),
        of_heights("scene0", weight=2, first=(100, 280, 800)),
        of_heights("mandelbulb", weight=2, first=(100, 200, 400)),
        *[of_shapes(name, first=(1, 16, 256)) for name in others],
        of_steps("scene0", "step cap, scene0", known("scene0")),
        of_steps(
            "corridors",
            f"step cap, corridors of {STEP_SHAPES} shapes",
            lambda x: shapes("corridors")(STEP_SHAPES),
        ),
        Series(
            *("bounces", "rays in a chain of mirrors (bounces + 1)", "rays", tuple(b + 1 for b in BOUNCES)),
            *(1, None, height, lambda x: scaling_scenes.of_mirrors(x - 1, folder)),
            first=(1, 5, 17),
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
