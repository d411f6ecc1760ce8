"""Speed against error: every phase over hit distance × step cap × approximation, held against truth.

A point is (scene, program, hit distance, step cap). Its time is the median over process launches in one
interleaved run; its errors are against truth (study.truth), the same for all points of a scene. Proved hits
know nothing of either parameter; the shadow estimator and the Mandelbulb, which truth marches, have the
scene's own. The parameters are changed for this study alone, and every point names its own.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from study import accuracy, cli, images, run, stats, store, truth
from study.cli import StudyError
from study.registry import Scene, Spec
from study.run import DriverError

FILE = "pareto.json"
HIT_DISTANCES = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)
STEPS = (64, 256, 3000)
# Precision is the phase's own; these ablations switch an approximation of the root.
SWITCHES = ("opt2+fast_root_1", "opt2+fast_root_2", "opt4+rsqrt", "opt4+rsqrt_newton")
TRUTHS = {"psnr_db": "the paper's estimator", "psnr_ideal_db": "the ideal shadow"}
LEVELS = (40, 50, 60, 80)  # dB
BASE = "baseline"
FACTOR = 4  # of the averaged pictures of fractals, each way
Row = dict[str, Any]


@dataclass(frozen=True)
class Point:
    """A program and the two march parameters it is given."""

    scene: str
    spec: Spec
    hit_distance: float
    max_steps: int

    @property
    def march(self) -> dict[str, Any]:
        return {"hit_distance": self.hit_distance, "max_steps": self.max_steps}


def own(scene: Scene) -> tuple[float, int]:
    """The scene's own hit distance and step cap."""
    march = scene.data["march"]
    return float(march["hit_distance"]), int(march["max_steps"])


def grid(
    scene: Scene, specs: Sequence[Spec], distances: Iterable[float], steps: Iterable[int]
) -> list[Point]:
    """All points of a scene, the scene's own parameters always among them; switches only with these."""
    mine = own(scene)
    pairs = {mine, *((d, s) for d in {mine[0], *distances} for s in {mine[1], *steps})}
    return [
        Point(scene.name, spec, *pair)
        for spec in specs
        for pair in sorted(pairs, reverse=True)
        if "+" not in spec.phase or pair == mine
    ]


def errors(point: Point, scene: Scene, height: int, exact: images.Picture, folder: Path) -> Row:
    """Errors of the point's picture against truth's, and the evaluations of its camera rays.

    Fractals: `exact` is converged only, so PSNR is that of 4 × 4 averaged pictures, and hits are not judged.
    """
    factor = FACTOR if scene.fractal else 1
    out = folder / f"{scene.name}-{point.spec}-{point.hit_distance:g}-{point.max_steps}.exr"
    width, _ = scene.size(height)
    run.render(point.spec, scene.path, height * factor, width * factor, aov=True, out=out, **point.march)
    made = images.read(out)
    out.unlink()
    found: Row = {
        "evals_per_ray": float(np.mean(made["evals"], dtype=np.float64)),
        "non_finite": images.non_finite(made),
    }
    metrics = accuracy.metrics(exact, made, fractal=scene.fractal)
    if scene.fractal:
        found |= {name: metrics["antialiased"][name] for name in TRUTHS}
        return found | {"depth_agree_fraction": metrics["depth_agree_fraction"]}
    names = ("false_hits_ppm", "false_misses_ppm", "wrong_shape_ppm", "dt_p99", "dt_max", *TRUTHS)
    return found | {name: metrics[name] for name in names}


def measure(
    points: Sequence[Point], scene: Scene, height: int, launches: int, seed: int, cpu: int
) -> dict[Point, list[float]]:
    """Nanoseconds of one frame per process launch, every point once a round in random order."""
    width, _ = scene.size(height)

    def once(point: Point, padding: int) -> float:
        made = run.frames(point.spec, scene.path, height, width, cpu=cpu, env_bytes=padding, **point.march)
        with contextlib.closing(made):
            (frame,) = made
        return float(frame["ns"])

    return run.interleaved(points, launches, seed, cpu, once, f"time {scene.name}")


def study_scene(
    scene: Scene, points: Sequence[Point], height: int, launches: int, seed: int, cpu: int, folder: Path
) -> tuple[list[Row], list[Row]]:
    """Rows of a scene, and what could not be had with its reason."""
    factor = FACTOR if scene.fractal else 1
    width, _ = scene.size(height)
    exact = truth.picture(scene, (width * factor, height * factor))
    found, skipped = {}, []
    for point in tqdm(points, f"errors {scene.name}", leave=False, disable=None):
        try:
            found[point] = errors(point, scene, height, exact, folder)
        except DriverError as error:
            skipped.append({"phase": str(point.spec), "scene": scene.name, "reason": error.message})
    times = measure(list(found), scene, height, launches, seed, cpu)
    base = times.get(Point(scene.name, Spec.parse(BASE), *own(scene)))
    pixels = width * height
    return [
        {
            **{"scene": scene.name, "phase": str(point.spec), "n": height, **point.march},
            "own_parameters": (point.hit_distance, point.max_steps) == own(scene),
            "converged_only": scene.fractal,
            "ns_per_pixel": (pace := stats.median_interval([ns / pixels for ns in times[point]])),
            "speedup": stats.ratio_interval(base, times[point]) if base else None,
            **metrics,
            "ns_per_eval": pace.value / metrics["evals_per_ray"],
        }
        for point, metrics in found.items()
    ], skipped


def pace_of(row: Row) -> float:
    pace = row["ns_per_pixel"]
    return pace["value"] if isinstance(pace, dict) else pace.value


def level_of(row: Row, metric: str) -> float:
    """PSNR as a number: JSON's null is infinite; NaN, which reaches no level, where there is none.

    A picture that is not finite has none: its null was NaN.
    """
    value = row.get(metric, math.nan)
    if value is not None:
        return value
    return math.nan if row["non_finite"] else math.inf


def front(rows: Sequence[Row], metric: str) -> list[Row]:
    """Rows that no other is both faster and nearer than, from fast to near; none without a number."""
    best, made = -math.inf, []
    able = [row for row in rows if not row["non_finite"]]
    for row in sorted(able, key=lambda row: (pace_of(row), -level_of(row, metric))):
        if level_of(row, metric) > best:
            best = level_of(row, metric)
            made.append(row)
    return made


def reaching(rows: Sequence[Row], metric: str, level: float) -> list[Row]:
    """The finite rows of at least `level` dB."""
    return [row for row in rows if not row["non_finite"] and level_of(row, metric) >= level]


def fastest(rows: Sequence[Row], metric: str, level: float) -> Row | None:
    """The fastest row of at least `level` dB."""
    return min(reaching(rows, metric, level), key=pace_of, default=None)


def ends_of(row: Row) -> tuple[float, float] | None:
    """95 % interval of the pace, ns/pixel; None of too few launches."""
    pace = row["ns_per_pixel"]
    low, high = (pace[end] if isinstance(pace, dict) else getattr(pace, end) for end in ("low", "high"))
    known = low is not None and high is not None and math.isfinite(low) and math.isfinite(high)
    return (low, high) if known else None


def rivals(rows: Sequence[Row], metric: str, level: float) -> list[str]:
    """Who else reaches the level in an interval that overlaps the fastest's, or without one; once each.

    None where the fastest itself has no interval: then nothing is told apart.
    """
    best = fastest(rows, metric, level)
    if best is None or (mine := ends_of(best)) is None:
        return []
    near = [
        row
        for row in reaching(rows, metric, level)
        if row is not best and ((other := ends_of(row)) is None or other[0] <= mine[1])
    ]
    itself = f"{best['phase']} by other parameters"
    return list(dict.fromkeys(itself if row["phase"] == best["phase"] else row["phase"] for row in near))


def winners(rows: Sequence[Row]) -> list[Row]:
    """The fastest program per scene, truth and level; None where nothing reaches it."""
    made = []
    for scene in dict.fromkeys(row["scene"] for row in rows):
        mine = [row for row in rows if row["scene"] == scene]
        for metric, about in TRUTHS.items():
            if not any(metric in row for row in mine):
                continue
            for level in LEVELS:
                best = fastest(mine, metric, level)
                about_it = {"scene": scene, "truth": about, "metric": metric, "level_db": level, "best": best}
                made.append(about_it | {"not_told_apart_from": rivals(mine, metric, level)})
    return made


def sentence(winner: Row) -> str:
    """What a winner says: at 60 dB, opt4 is the fastest …"""
    best, where = winner["best"], f"{winner['scene']}, {winner['level_db']} dB to {winner['truth']}"
    if best is None:
        return f"{where}: no program reaches it"
    found = ends_of(best)
    ends = f" [{found[0]:.3g}, {found[1]:.3g}]" if found else ""
    doubt = "" if found else "; insufficient launches to tell it from others"
    if near := winner.get("not_told_apart_from"):
        doubt += f"; not told apart from {', '.join(near)}"
    how = (
        "the scene's own parameters"
        if best["own_parameters"]
        else (f"hit distance {best['hit_distance']:g}, {best['max_steps']} steps")
    )
    return (
        f"{where}: {best['phase']} is the fastest, {pace_of(best):.3g}{ends} ns/pixel ({how}; "
        f"{level_of(best, winner['metric']):.1f} dB){doubt}"
    )


def read(path: Path) -> dict[str, Any]:
    """A run's pareto.json; without that file no row. Raises StudyError for another thing's JSON."""
    if not path.exists():
        return {"rows": [], "skipped": []}
    result = store.read_json(path)
    rows = result.get("rows") if isinstance(result, dict) else None
    sound = isinstance(rows, list) and all(isinstance(r, dict) and "ns_per_pixel" in r for r in rows)
    if not sound or (not rows and result.get("winners")):
        raise StudyError(f"{path}: not what scripts/pareto.py writes; make it again with scripts/pareto.py")
    return result


def shown(rows: Sequence[Row]) -> list[Row]:
    """Winners as people read them."""
    return [
        {**row, "program": row["best"]["phase"] if row["best"] else "none", "sentence": sentence(row)}
        for row in rows
    ]


def say_missing(skipped: Iterable[Row]) -> None:
    for item in {(s["phase"], s["scene"], s["reason"]): s for s in skipped}.values():
        cli.say(f"skipped {item['phase']} on {item['scene']}: {item['reason']}")
