"""When a kernel generated for a scene has paid for its compilation: frames against the parent's time.

Each scene has a new cache: its kernel is compiled once, set-up is what the driver says it took, and the timed
launches find it there. No timed frame has set-up in it. Scenes in order, while the seconds last.
"""

from __future__ import annotations

import contextlib
import math
import os
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from study.core import registry, run, temporary
from study.core.cli import StudyError
from study.core.registry import Scene, Spec
from study.experiments.breakeven.schema import Breakeven
from study.experiments.frames.measure import against
from study.numbers import stats
from study.numbers.analysis import GENERATED
from study.numbers.stats import Interval
from study.pictures import images

FILE = "breakeven.json"
PHASE, AGAINST = "opt10_scene", "opt9_convex"
# The two that constants are tuned on, the crowd, which has no kernel and so costs next to nothing, then those
# with repeated shapes, then all others. Not mandelbulb_closeup: mandelbulb's kernel, seen from nearer.
FIRST, SAME_KERNEL = ("scene0", "mandelbulb", "spheres40", "cubes", "lattice"), ("mandelbulb_closeup",)
WARMUP, MOST_FRAMES, LEAST_FRAMES, LAUNCH_SECONDS = 1, 10, 2, 0.5  # frames; s that a launch's may take
SMALL = 180  # height of the pictures that are compared
NO_TIME = "the seconds were over"
Row = dict[str, Any]


def scenes() -> list[str]:
    """Every shipped scene that has a kernel of its own, in the order of their worth."""
    return [name for name in dict.fromkeys([*FIRST, *registry.scenes()]) if name not in SAME_KERNEL]


@dataclass(frozen=True)
class Settings:
    height: int
    launches: int
    seconds: float
    seed: int


def break_even(setup_s: float, general_ms: float, generated_ms: float) -> float:
    """Frames after which set-up and generated frames take less than general ones; inf: never."""
    gain = (general_ms - generated_ms) / 1e3
    return math.ceil(setup_s / gain) if gain > 0 else math.inf


def break_even_interval(setup_s: float, general: Interval, generated: Interval) -> dict[str, float | None]:
    """The same of the medians, and of the ends of their intervals that are furthest apart and nearest; null:
    never, or no interval."""
    ends = {
        "value": (general.value, generated.value),
        "low": (general.high, generated.low),
        "high": (general.low, generated.high),
    }
    made = {name: break_even(setup_s, *pair) for name, pair in ends.items() if not math.isnan(sum(pair))}
    return {name: made[name] if math.isfinite(made.get(name, math.inf)) else None for name in ends}


@contextlib.contextmanager
def own_cache() -> Iterator[None]:
    """A new folder for kernels, for this process and those that it starts."""
    before = os.environ.get("STEPWISE_CACHE")
    with temporary.folder() as cache:
        os.environ["STEPWISE_CACHE"] = str(cache)
        try:
            yield
        finally:
            os.environ.pop("STEPWISE_CACHE")
            if before is not None:
                os.environ["STEPWISE_CACHE"] = before


def set_up(spec: Spec, scene: Scene) -> Row:
    """The driver's account of the kernel, made and found again. StudyError: the phase generates none."""
    made = run.render(spec, scene.path, 36, timed=False)
    if made["kernel"] is None:
        raise StudyError(f"{spec} generates no kernels; {PHASE} does")
    if made["kernel"] != GENERATED:
        return {"generated": False, "reason": made["kernel"].removeprefix("general: ")}
    found = run.render(spec, scene.path, 36, timed=False)
    if found["kernel"] != GENERATED or found["kernel_compile_ns"]:
        return {"generated": False, "reason": "the kernel was not found again where it had been put"}
    return {
        "generated": True,
        "compiler": made["kernel_compiler"],
        "hash": made["kernel_hash"],
        "compile_s": made["kernel_compile_ns"] / 1e9,
        "generate_ms": made["kernel_generate_ns"] / 1e6,
        "load_ms": found["kernel_load_ns"] / 1e6,
        "setup_s": made["prepare_ns"] / 1e9,
        "setup_found_ms": found["prepare_ns"] / 1e6,
    }


def apart(specs: tuple[Spec, Spec], scene: Scene) -> Row:
    """How far the kernel's picture is from the other's, in linear RGB."""
    with temporary.folder() as folder:
        made = []
        for i, spec in enumerate(specs):
            out = folder / f"{i}.exr"
            run.render(spec, scene.path, SMALL * (4 if scene.fractal else 1), aov=True, out=out, timed=False)
            made.append(images.read(out))
    return against(*made, scene.fractal)


def reps_of(seconds: float) -> int:
    """Timed frames of a launch, by how long one takes."""
    return int(min(MOST_FRAMES, max(LEAST_FRAMES, LAUNCH_SECONDS / seconds)))


def measure(specs: tuple[Spec, Spec], scene: Scene, settings: Settings) -> Row:
    """One scene: set-up, ms a frame with intervals, frames to break even, error. Times on one thread."""
    wide, high = scene.size(settings.height)
    found: Row = {"scene": scene.name, "n": high, "width": wide, **set_up(specs[1], scene)}
    if not found["generated"]:
        return found
    cpu = run.FASTEST
    reps = reps_of(run.render(specs[0], scene.path, high, wide, cpu=cpu)["frames"][0]["ns"] / 1e9)

    def once(spec: Spec, padding: int) -> float:
        how = {"cpu": cpu, "env_bytes": padding, "reps": reps, "warmup": WARMUP}
        lines = [*run.frames(spec, scene.path, high, wide, **how)]
        if spec == specs[1] and (lines[0]["kernel"] != GENERATED or lines[0]["kernel_compile_ns"]):
            raise StudyError(f"{spec} on {scene.name}: the kernel was not found again in its cache")
        return float(np.median([line["ns"] for line in lines if not line["warmup"]])) / 1e6

    times = run.interleaved(specs, settings.launches, settings.seed, cpu, once, scene.name)
    general, generated = (stats.median_interval(times[spec]) for spec in specs)
    return found | {
        "general_launches_ms": times[specs[0]],
        "generated_launches_ms": times[specs[1]],
        "general_ms": general,
        "generated_ms": generated,
        "gain": stats.ratio_interval(times[specs[0]], times[specs[1]]),
        "break_even_frames": break_even_interval(found["setup_s"], general, generated),
        "error": apart(specs, scene),
    }


def study(
    specs: tuple[Spec, Spec],
    scenes: Sequence[Scene],
    settings: Settings,
    clock: Callable[[], float] = time.monotonic,
) -> Row:
    """`rows` and `left_out`: a scene is begun only if the longest one so far fits the rest of the seconds."""
    begun, longest = clock(), 0.0
    rows, left_out = [], []
    for scene in scenes:
        start = clock()
        if rows and start - begun + longest > settings.seconds:
            left_out.append({"scene": scene.name, "reason": NO_TIME})
            continue
        with own_cache():
            rows.append(measure(specs, scene, settings))
        longest = max(longest, clock() - start)
    return {"phase": str(specs[1]), "against": str(specs[0]), "rows": rows, "left_out": left_out}


def read(path: Path) -> Row:
    """A run's breakeven.json; without that file no row. Raises StudyError for another thing's JSON."""
    if not path.exists():
        return {"rows": [], "left_out": []}
    return Breakeven.read(path)
