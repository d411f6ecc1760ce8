"""When a kernel generated for a scene has paid for its compilation: frames against the parent's time.

Each scene has a new cache: its kernel is compiled once, set-up is what the driver says it took, and the timed
launches find it there. No timed frame has set-up in it. Scenes in order, while the seconds last.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec

from study.core import registry, run, temporary
from study.core.cli import StudyError
from study.core.registry import Scene, Spec
from study.experiments.breakeven.schema import Row
from study.measuring import hits, launches
from study.numbers import stats
from study.numbers.analysis import GENERATED
from study.numbers.schema import Interval, PictureErrors, Range, Skipped
from study.pictures import images

PHASE, AGAINST = "opt10_scene", "opt9_convex"
# The two that constants are tuned on, the crowd, which has no kernel and so costs next to nothing, then those
# with repeated shapes, then all others. Not mandelbulb_closeup: mandelbulb's kernel, seen from nearer.
FIRST, SAME_KERNEL = ("scene0", "mandelbulb", "spheres40", "cubes", "lattice"), ("mandelbulb_closeup",)
WARMUP, MOST_FRAMES, LEAST_FRAMES, LAUNCH_SECONDS = 1, 10, 2, 0.5  # frames; s that a launch's may take
SMALL = 180  # height of the pictures that are compared


def scenes() -> list[str]:
    """Every shipped scene that has a kernel of its own, in the order of their worth."""
    return [name for name in dict.fromkeys([*FIRST, *registry.scenes()]) if name not in SAME_KERNEL]


@dataclass(frozen=True)
class Settings:
    height: int
    launches: int
    seconds: float
    seed: int


def break_even(setup_s: float, general_ms: float, generated_ms: float) -> int | None:
    """Frames after which set-up and generated frames take less than general ones; None: never."""
    gain = (general_ms - generated_ms) / 1e3
    return math.ceil(setup_s / gain) if gain > 0 else None  # NaN is no gain


def break_even_range(setup_s: float, general: stats.Interval, generated: stats.Interval) -> Range:
    """The same of the medians, and of the ends of their intervals that are furthest apart and nearest."""
    return Range(
        value=break_even(setup_s, general.value, generated.value),
        low=break_even(setup_s, general.high, generated.low),
        high=break_even(setup_s, general.low, generated.high),
    )


def set_up(spec: Spec, scene: Scene, cache: Mapping[str, str]) -> dict[str, Any]:
    """The driver's account of the kernel, made and found again. StudyError: the phase generates none."""
    made, found = (launches.render(spec, scene.path, 36, told=cache) for _ in range(2))
    if made.kernel is None:
        raise StudyError(f"{spec} generates no kernels; {PHASE} does")
    if made.kernel != GENERATED:
        return {"generated": False, "reason": made.kernel.removeprefix("general: ")}
    if found.kernel != GENERATED or found.kernel_compile_ns:
        return {"generated": False, "reason": "the kernel was not found again where it had been put"}
    return {
        "generated": True,
        "compiler": made.kernel_compiler,
        "compile_s": (made.kernel_compile_ns or 0) / 1e9,
        "setup_s": made.prepare_ns / 1e9,
        "setup_found_ms": found.prepare_ns / 1e6,
    }


def apart(specs: tuple[Spec, Spec], scene: Scene, cache: Mapping[str, str]) -> PictureErrors:
    """How far the kernel's picture is from the other's, in linear RGB."""
    height = SMALL * (hits.FACTOR if scene.fractal else 1)
    with temporary.folder() as folder:
        paths = [folder / f"{spec}.exr" for spec in specs]
        for spec, out in zip(specs, paths, strict=True):
            run.render(spec, scene.path, height, aov=True, out=out, timed=False, told=cache)
        general, generated = map(images.read, paths)
    return msgspec.convert(hits.to_picture(general, generated, scene.fractal), PictureErrors)


def reps_of(seconds: float) -> int:
    """Timed frames of a launch, by how long one takes."""
    return int(min(MOST_FRAMES, max(LEAST_FRAMES, LAUNCH_SECONDS / seconds)))


def measure(specs: tuple[Spec, Spec], scene: Scene, settings: Settings, folder: Path) -> Row:
    """One scene: set-up, ms a frame with intervals, frames to break even, error. Times on one thread.
    `folder`: of the kernels."""
    wide, high = scene.size(settings.height)
    cache, cpu = {"STEPWISE_CACHE": str(folder)}, run.FASTEST
    row = Row(scene=scene.name, n=high, width=wide, **set_up(specs[1], scene, cache))
    if not row.generated:
        return row
    reps = reps_of(launches.render(specs[0], scene.path, high, wide, timed=True, cpu=cpu).first_s)

    def once(spec: Spec, padding: int) -> float:
        how: dict[str, Any] = {"cpu": cpu, "env_bytes": padding, "reps": reps, "warmup": WARMUP}
        made = launches.render(spec, scene.path, high, wide, timed=True, told=cache, **how)
        if spec == specs[1] and (made.kernel != GENERATED or made.kernel_compile_ns):
            raise StudyError(f"{spec} on {scene.name}: the kernel was not found again in its cache")
        return made.ms

    times = run.interleaved(specs, settings.launches, settings.seed, cpu, once, scene.name)
    general, generated = (stats.median_interval(times[spec]) for spec in specs)
    row.general_launches_ms, row.generated_launches_ms = (times[spec] for spec in specs)
    row.general_ms, row.generated_ms = Interval.of(general), Interval.of(generated)
    row.gain = Interval.of(stats.ratio_interval(times[specs[0]], times[specs[1]]))
    row.break_even_frames = break_even_range(row.setup_s or 0, general, generated)
    row.error = apart(specs, scene, cache)
    return row


def study(
    specs: tuple[Spec, Spec], scenes: Sequence[Scene], settings: Settings
) -> tuple[list[Row], list[Skipped]]:
    """A scene is begun only if the longest one so far fits the rest of the seconds; the others are left."""
    begun, longest = time.monotonic(), 0.0
    rows: list[Row] = []
    left_out = []
    for scene in scenes:
        start = time.monotonic()
        if rows and start - begun + longest > settings.seconds:
            left_out.append(Skipped(scene=scene.name, reason="the seconds were over"))
            continue
        with temporary.folder() as folder:
            rows.append(measure(specs, scene, settings, folder))
        longest = max(longest, time.monotonic() - start)
    return rows, left_out
