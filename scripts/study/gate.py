"""The equivalence gate: which tolerance holds for a phase on a scene, and which metrics break it.

Tolerances stand in phases/NAME/phase.json, per scene class or scene. results/README.md has the metrics.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from study.cli import StudyError
from study.registry import Phase, Scene, scenes

# In the order in which they are judged: what explains the rest comes first.
METRICS = (
    "non_finite",
    "identical",
    "mask_mismatch_ppm",
    "id_mismatch_ppm",
    "dt_p99",
    "dt_max",
    "normal_p99_degrees",
    "depth_agree_fraction",
    "psnr_db",
    "rmse",
    "fraction_over_1_255",
    "max_abs",
    "psnr_display_db",
    "fraction_over_1_255_display",
    "flip_mean",
    "flip_max",
    "antialiased.non_finite",
    "antialiased.psnr_db",
    "antialiased.rmse",
    "antialiased.fraction_over_1_255",
)
AT_LEAST = {"psnr_db", "psnr_display_db", "antialiased.psnr_db", "depth_agree_fraction"}
ALWAYS = {"non_finite": 0, "antialiased.non_finite": 0}  # no phase may allow any


def flatten(nested: Mapping, prefix: str = "") -> dict:
    """{"antialiased": {"psnr_db": 30}} as {"antialiased.psnr_db": 30}."""
    flat = {}
    for key, value in nested.items():
        flat |= flatten(value, f"{prefix}{key}.") if isinstance(value, Mapping) else {prefix + key: value}
    return flat


def check(phase: Phase) -> None:
    """Raises StudyError for a tolerance that is of no scene or class, bounds no metric, or has no reason."""
    for name, declared in phase.tolerance.items():
        where = f"{phase.name}: phase.json: tolerance.{name}"
        if name not in ("smooth", "fractal", *scenes()):
            raise StudyError(
                f"{where}: no such scene or class; there are smooth, fractal, {', '.join(scenes())}"
            )
        if not isinstance(declared, Mapping):
            raise StudyError(f"{where}: should be an object of metric: bound")
        if not isinstance(declared.get("reason"), str) or not declared["reason"].strip():
            raise StudyError(f"{where}: lacks its reason")
        bounds = {key: bound for key, bound in flatten(declared).items() if key != "reason"}
        if not bounds:
            raise StudyError(f"{where}: bounds no metric")
        for key, bound in bounds.items():
            if key not in METRICS:
                raise StudyError(f"{where}.{key}: no such metric; there are {', '.join(METRICS)}")
            number = isinstance(bound, int | float) and not isinstance(bound, bool) and math.isfinite(bound)
            if not (bound is True if key == "identical" else number):
                wanted = "true" if key == "identical" else "a finite number"
                raise StudyError(f"{where}.{key}: {bound!r} should be {wanted}")


def tolerance(phase: Phase, scene: Scene) -> dict | None:
    """What the phase declares for the scene: by its name, else by its class. None: nothing."""
    return phase.tolerance.get(scene.name) or phase.tolerance.get("fractal" if scene.fractal else "smooth")


def failures(metrics: Mapping, declared: Mapping | None) -> dict[str, str]:
    """Metric outside its bound → why, in the order of the gate. No value, or NaN, is outside any bound."""
    if declared is None:
        return {"tolerance": "the phase declares none for this scene or its class"}
    values, bounds = flatten(metrics), ALWAYS | flatten(declared)
    found = {}
    for name in METRICS:
        if name not in bounds or (name == "antialiased.non_finite" and name not in values):
            continue
        value, bound = values.get(name, math.nan), bounds[name]
        if name == "identical":
            if value is not True:
                found[name] = "not equal bit for bit, should be"
        elif name in AT_LEAST:
            if not (value >= bound):
                found[name] = f"{value:.6g}, should be at least {bound:g}"
        elif not (value <= bound):
            found[name] = f"{value:.6g}, should be at most {bound:g}"
    return found
