"""What cost is measured against in stepwise scaling: the series, their points, the paper's law for each.

A point is one program on one picture; its x is what the series varies. All else of a series is fixed.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from study.core import generated_scenes, registry, run
from study.core.cli import StudyError
from study.core.registry import Scene, Spec

HEIGHTS = (100, 140, 200, 280, 400, 560, 800, 1120, 1600, 2240, 3200, 4000)
SHAPES = (1, 4, 16, 64, 256, 1024, 4096)
STEPS = (4, 8, 16, 32, 64, 128, 256, 512, 1024, 2048)
BOUNCES = (0, 1, 2, 4, 8, 16)
STEP_SHAPES = 64  # of the corridors that the step cap is tried on
CROWD_HEIGHT, CROWD = 720, (16, 4096)
EARLY = 3  # points that every program should have: fewer make no fit
STEEPEST = 1.0  # above what a series is foreseen to grow by: what one step may show
LAW = "O(K·T·N²)"  # of P1: N × N pixels, T shapes, K the largest number of steps


@dataclass(frozen=True)
class Picture:
    """What is rendered: a scene at a size, by a number of threads, under a step cap (None: the scene's)."""

    scene: Scene
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


@dataclass(frozen=True)
class Series:
    """`grows`: exponent that costs are foreseen by; `paper`: the one of its law, None where it has none.
    `scene(x, number)` makes a generated scene's file when it is first asked for; `number`: which of the
    scenes, where every launch has one of its own (`drawn`). `varies`: height, threads or max_steps; "": the
    scene itself. `first`: the x that every program should have before any other. `fast_only`: for the last
    programs of the ladder alone; `kept`: whether pictures are kept and judged; `weight`: of its share of the
    time."""

    name: str
    title: str
    axis: str
    xs: tuple[int, ...]
    grows: float
    paper: float | None
    height: int
    scene: Callable[[int, int], Scene]
    varies: str = ""
    first: tuple[int, ...] = ()
    weight: int = 1
    fast_only: bool = False
    kept: bool = True
    drawn: bool = False

    @property
    def early(self) -> list[int]:
        return [x for x in self.first if x in self.xs] or list(self.xs[:EARLY])

    def picture(self, x: int, number: int = 0) -> Picture:
        scene = self.scene(x, number)
        height = x if self.varies == "height" else self.height
        more = {self.varies: x} if self.varies in ("threads", "max_steps") else {}
        return Picture(scene, height, scene.size(height)[0], **more)


def thread_counts(cpus: int) -> tuple[int, ...]:
    """Powers of two up to the CPUs there are, and all of them."""
    powers = [1 << i for i in range(cpus.bit_length()) if 1 << i <= cpus]
    return tuple(sorted({*powers, cpus}))


def foreseen(known: Sequence[tuple[float, float]], x: float, grows: float) -> float:
    """Seconds of a frame at x from what is known, (x, s) in any order; 0 where nothing is. Beyond the last
    point at least as `grows` says; between two on the line through them (in logarithms); below the least as
    long as that took."""
    below = sorted(one for one in known if one[0] < x)
    above = sorted(one for one in known if one[0] > x)
    if not below:
        return above[0][1] if above else 0.0
    (x0, s0) = below[-1]
    slope = grows
    if above or len(below) > 1:
        (x1, s1), seen_from = (above[0], below[-1]) if above else (below[-1], below[-2])
        slope = math.log(s1 / seen_from[1]) / math.log(x1 / seen_from[0])
    if not above:
        slope = min(max(slope, grows), grows + STEEPEST)
    return s0 * (x / x0) ** slope


def series(height: int, seed: int, folder: Path) -> dict[str, Series]:
    """All series by name, by their worth. `height`: of the pictures where it is not what varies; `folder`:
    for scenes."""

    def known(name: str) -> Callable[[int, int], Scene]:
        return lambda x, number: registry.find_scene(name)

    # What few shapes cost depends on where they are: between the extremes of eight scenes of 16 is a factor
    # of 3, of 4,096 of 1.1 (opt9_convex, Zen 3).
    def shapes(name: str) -> Callable[[int, int], Scene]:
        return lambda x, number: generated_scenes.of_shapes(name, x, seed + number, folder)

    def of_mirrors(x: int, number: int) -> Scene:
        return generated_scenes.of_mirrors(x - 1, folder)

    def of_shapes(name: str, first: tuple[int, ...], weight: int = 1) -> Series:
        title = f"number of shapes, {name}{' (worst case)' * (name == 'corridors')}"
        made = Series(f"shapes-{name}", title, "shapes", SHAPES, 1.2, 1, height, shapes(name))
        return replace(made, first=first, weight=weight)

    def of_heights(name: str, first: tuple[int, ...]) -> Series:
        made = Series(f"n-{name}", f"picture height, {name}", "n, pixels", HEIGHTS, 2, 2, height, known(name))
        return replace(made, varies="height", first=first, weight=2)

    def of_steps(name: str, title: str, scene: Callable[[int, int], Scene]) -> Series:
        made = Series(f"steps-{name}", title, "step cap", STEPS, 1, 1, height, scene)
        return replace(made, varies="max_steps", first=(4, 32, 256))

    title = f"shapes, scattered, n = {CROWD_HEIGHT}, a scene for every launch"
    crowd = Series("crowd", title, "shapes", CROWD, 0.3, 1, CROWD_HEIGHT, shapes("scattered"))
    counts, rays = thread_counts(len(run.USABLE)), tuple(b + 1 for b in BOUNCES)
    threads = Series("threads", "threads, scene0", "threads", counts, 0, None, 2 * height, known("scene0"))
    title = "rays in a chain of mirrors (bounces + 1)"
    bounces = Series("bounces", title, "rays", rays, 1, None, height, of_mirrors, first=(1, 5, 17))
    corridors, rows = f"step cap, corridors of {STEP_SHAPES} shapes", shapes("corridors")
    made = [
        replace(crowd, weight=9, fast_only=True, kept=False, drawn=True),
        replace(threads, varies="threads", first=(1, 2), weight=2),
        of_shapes("scattered", (16, 4096, 256), 2),
        of_heights("scene0", (100, 280, 800)),
        of_heights("mandelbulb", (100, 200, 400)),
        *[of_shapes(name, (1, 16, 256)) for name in generated_scenes.ARRANGEMENTS if name != "scattered"],
        of_steps("scene0", "step cap, scene0", known("scene0")),
        of_steps("corridors", corridors, lambda x, number: rows(STEP_SHAPES, 0)),
        bounces,
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
