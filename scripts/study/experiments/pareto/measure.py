"""The points of speed against error: their grid, their pictures' errors, and which are timed how often.

A point is (scene, program, hit distance, step cap). Pictures do not hang on the clock, so they are rendered
and judged on every core. Then every point is launched once, and what that shows to be far from every front
(`beaten`) is left at this one launch; the others are timed anew, `launches` times, interleaved.
"""

import math
import os
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from study.core import progress, registry, run
from study.core.registry import BASE, Scene, Spec
from study.core.run import DriverError
from study.experiments.pareto.fronts import MEASURES, WITHIN
from study.experiments.pareto.schema import TRUTHS, Row
from study.measuring.launches import milliseconds
from study.numbers import stats
from study.numbers.schema import Interval, Skipped
from study.pictures import images
from study.truth import judging, truth
from study.truth.judging import FACTOR

T = TypeVar("T")
LONG = 0.25  # s; a frame longer than that warms itself up (scripts/stepwise sweep --long)

HIT_DISTANCES = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)
STEPS = (64, 256, 3000)
# Precision is the phase's own; these ablations switch an approximation of the root.
SWITCHES = (*(f"opt2+fast_root_{steps}" for steps in (1, 2, 3)), "opt4+rsqrt", "opt4+rsqrt_newton")


@dataclass(frozen=True)
class Point:
    scene: str
    spec: Spec
    hit_distance: float
    max_steps: int

    @property
    def march(self) -> dict[str, Any]:
        return {"hit_distance": self.hit_distance, "max_steps": self.max_steps}

    def __str__(self) -> str:
        return f"{self.spec} at {self.hit_distance:g}, {self.max_steps} steps"


def own(scene: Scene) -> tuple[float, int]:
    march = scene.content.march
    return march.hit_distance, march.max_steps


def grid(
    scene: Scene, specs: Sequence[Spec], distances: Iterable[float], steps: Iterable[int]
) -> list[Point]:
    """All points of a scene, switches like phases; the scene's own parameters are always among them."""
    mine = own(scene)
    pairs = {(d, s) for d in {mine[0], *distances} for s in {mine[1], *steps}}
    return [Point(scene.name, spec, *pair) for spec in specs for pair in sorted(pairs, reverse=True)]


def errors(point: Point, scene: Scene, height: int, exact: images.Picture, folder: Path) -> Row:
    """The point's row without its time: errors to truth's picture, and the evaluations of its camera rays.
    Fractals: `exact` is marched, so PSNR is that of 4 × 4 averaged pictures of `height`, and hits are
    not judged. Raises DriverError."""
    factor = FACTOR if scene.fractal else 1
    out = folder / f"{scene.name}-{point.spec}-{point.hit_distance:g}-{point.max_steps}.exr"
    width, _ = scene.size(height)
    said = run.render(
        point.spec, scene.path, height * factor, width * factor, aov=True, out=out, **point.march
    )
    made = images.read(out)
    out.unlink()
    found = judging.metrics(exact, made, fractal=scene.fractal)
    if scene.fractal:
        averaged = found | found["antialiased"]
        about = {name: averaged[name] for name in (*TRUTHS, "depth_agree_fraction")}
        if surface := found["surface"]:
            ideal = registry.find_phase(point.spec.phase).draws_ideal
            about |= {"surface_db": surface["antialiased"]["psnr_ideal_db" if ideal else "psnr_db"]}
    else:
        names = ("false_hits_ppm", "false_misses_ppm", "wrong_shape_ppm", "dt_p99", "dt_max", *TRUTHS)
        about = {name: found[name] for name in names}
        about |= {"false_ppm": sum(about[name] for name in names[:2])}
    return Row(
        scene=scene.name,
        phase=str(point.spec),
        **point.march,
        own_parameters=(point.hit_distance, point.max_steps) == own(scene),
        converged_only=scene.fractal,
        ns_per_pixel=Interval.of(stats.median_interval([])),
        threads=said["threads"],
        evals_per_ray=float(np.mean(made["evals"], dtype=np.float64)),
        non_finite=images.non_finite(made),
        **about,
    )


def evaluations(point: Point, scene: Scene, height: int) -> float | None:
    """Evaluations per pixel by the counting build, lanes at work, all rays and normals; None: no count."""
    size = height, scene.size(height)[0]
    try:
        said = run.render(point.spec, scene.path, *size, target="render-count", timed=False, **point.march)
    except DriverError:
        return None
    counted = said["by_function"].get("sdf")
    return counted["lanes"] / (size[0] * size[1]) if counted else None


def on_every_core(what: Callable[[Point], T], points: Sequence[Point], about: str) -> dict[Point, T]:
    with ThreadPoolExecutor(len(os.sched_getaffinity(0))) as pool:
        made = progress.each(pool.map(what, points), about, len(points))
        return dict(zip(points, made, strict=True))


def judge(
    points: Sequence[Point], scene: Scene, height: int, folder: Path
) -> tuple[dict[Point, Row], list[Skipped]]:
    factor = FACTOR if scene.fractal else 1
    width, _ = scene.size(height)
    exact = truth.picture(scene, (width * factor, height * factor))

    def one(point: Point) -> Row | Skipped:
        try:
            return errors(point, scene, height, exact, folder)
        except DriverError as error:
            return Skipped(phase=str(point.spec), scene=scene.name, reason=error.message)

    made = on_every_core(one, points, f"errors {scene.name}")
    rows = {point: row for point, row in made.items() if isinstance(row, Row)}
    return rows, [one for one in made.values() if isinstance(one, Skipped)]


def measure(
    points: Sequence[Point],
    scene: Scene,
    height: int,
    launches: int,
    seed: int,
    cpu: int,
    warm: Collection[Point] = (),
) -> dict[Point, list[float]]:
    """Milliseconds of one frame per launch, interleaved, one thread. Points of `warm` draw a frame before."""

    def once(point: Point, padding: int) -> float:
        how = {"cpu": cpu, "warmup": int(point in warm), **point.march}
        return milliseconds(point.spec, scene, scene.size(height), 1, padding, **how)

    return run.interleaved(points, launches, seed, cpu, once, f"time {scene.name}")


def beaten(found: Mapping[Point, Row], once: Mapping[Point, float]) -> dict[Point, dict[str, Point]]:
    """Points that can be on no front, each with who beats it by measure. Beaten by a measure is what another
    point, of at most its error, undercuts WITHIN times in one launch. It must be so by every measure that has
    a figure; a picture that is not finite, or without any figure, is on no front and needs nobody."""
    bad = {m: {p: row.badness(m) for p, row in found.items()} for m in MEASURES}
    out = {}
    for point in found:
        by: dict[str, Point] = {}
        for measure, values in bad.items():
            if math.isnan(values[point]):
                continue
            faster = (p for p in found if values[p] <= values[point] and WITHIN * once[p] < once[point])
            if (rival := min(faster, key=once.__getitem__, default=None)) is None:
                break
            by[measure] = rival
        else:
            out[point] = by
    return out


def study_scene(
    scene: Scene,
    points: Sequence[Point],
    heights: tuple[int, int],
    launches: int,
    seed: int,
    cpu: int,
    folder: Path,
) -> tuple[list[Row], list[Skipped]]:
    """Rows of a scene, and what could not be had with its reason. `heights`: timed; of averaged fractals."""
    height = heights[0]
    found, skipped = judge(points, scene, heights[1] if scene.fractal else height, folder)
    once = measure(list(found), scene, height, 1, seed, cpu)
    out = beaten(found, {point: times[0] for point, times in once.items()})
    # The scene's own parameters are what every phase is compared at: always timed in full.
    chosen = [p for p in found if p not in out or (p.hit_distance, p.max_steps) == own(scene)]
    # A first frame is up to 1.6 times a steady one, where that is short.
    warm = {point for point in chosen if once[point][0] < LONG * 1e3}
    times = once | measure(chosen, scene, height, launches, seed + 1, cpu, warm)
    counted = on_every_core(lambda p: evaluations(p, scene, height), chosen, f"count {scene.name}")
    base = times.get(Point(scene.name, Spec.parse(BASE), *own(scene)))
    pixels = scene.size(height)[0] * height
    for point, row in found.items():
        pace = stats.median_interval([1e6 * ms / pixels for ms in times[point]])
        evals = counted.get(point)
        row.n, row.ns_per_pixel = height, Interval.of(pace)
        row.speedup = Interval.of(stats.ratio_interval(base, times[point])) if base else None
        row.beaten_by = None if point in chosen else {m: str(by) for m, by in out[point].items()}
        row.evals_per_pixel = math.nan if evals is None else evals
        row.ns_per_eval = pace.value / evals if evals else math.nan
    return list(found.values()), skipped
