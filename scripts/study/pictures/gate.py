"""The equivalence gate: which tolerance holds for a phase on a scene, and which metrics break it.

Tolerances stand in phases/NAME/phase.json, per scene class or scene. Metrics: study/numbers/schema.py.
"""

import math
from collections.abc import Mapping

from study.core.cli import StudyError
from study.core.registry import SYSTEMS, Phase, Scene, scenes
from study.pictures import images

# In the order in which they are judged: what explains the rest comes first.
METRICS = (
    *("non_finite", "identical", "mask_mismatch_ppm", "id_mismatch_ppm", "dt_p99", "dt_max"),
    *("normal_p99_degrees", "depth_agree_fraction", "psnr_db", "rmse", "fraction_over_1_255", "max_abs"),
    *("psnr_display_db", "fraction_over_1_255_display", "flip_mean", "flip_max", "antialiased.non_finite"),
    *("antialiased.psnr_db", "antialiased.rmse", "antialiased.fraction_over_1_255"),
)
AT_LEAST = {"psnr_db", "psnr_display_db", "antialiased.psnr_db", "depth_agree_fraction"}
ALWAYS = {"non_finite": 0, "antialiased.non_finite": 0}  # no phase may allow any

# Against truth (scripts/stepwise accuracy) a phase may be no worse than baseline is, on any of these.
_COLOURS = tuple(f"psnr{which}{space}_db" for which in ("_none", "", "_ideal") for space in ("", "_display"))
_ESTIMATED = ("psnr_db", "psnr_display_db")  # colours in the estimator's shadow
HITS = ("false_hits_ppm", "false_misses_ppm", "wrong_shape_ppm", "dt_p99")
TRUTH_METRICS = (*HITS, *_COLOURS)
CONVERGED_METRICS = (*HITS, "depth_agree_fraction", *(f"antialiased.{name}" for name in _COLOURS))
TRUTH = "truth"  # key of a phase's tolerance: by how much it may be worse than baseline
# Key of a phase that draws the ideal shadow itself: how near to the ideal picture it must be, at least. Its
# distance to the estimator's picture is shown and not judged.
IDEAL = "ideal"
IDEAL_METRICS = ("psnr_ideal_db", "psnr_ideal_display_db", "antialiased.psnr_ideal_db")
LAST_AGAINST_BASELINE = 4  # place in the ladder up to which baseline is the reference (stepwise verify)
# dB: what is nearer counts as this near, an identical picture too. A float near 1 holds no more; a phase may
# declare less with its margins, as ENOUGH, where it is beyond what anybody can see.
NEAREST = 150.0
ENOUGH = "enough_db"
# Pixels: hits in front of truth's, of a shape that truth sees so near by, are granted to a phase that says
# how far its rays' footprint goes (accuracy.beyond_outlines), whatever their share: that falls with its size.
OUTLINE = "outline_pixels"
# What three digits can show: less is not called worse where no gate is.
SHOWN_DB, SHOWN_SHARE = 0.05, 0.005


def flatten(nested: Mapping, prefix: str = "") -> dict:
    """{"antialiased": {"psnr_db": 30}} as {"antialiased.psnr_db": 30}."""
    flat: dict = {}
    for key, value in nested.items():
        flat |= flatten(value, f"{prefix}{key}.") if isinstance(value, Mapping) else {prefix + key: value}
    return flat


def check(phase: Phase) -> None:
    """Raises StudyError for a tolerance that is of no scene or class, bounds no metric, or has no reason."""
    kinds: dict[str, tuple[str, ...]] = dict.fromkeys(("smooth", "fractal", *scenes()), METRICS)
    kinds |= {TRUTH: (*TRUTH_METRICS, *CONVERGED_METRICS, ENOUGH, OUTLINE), IDEAL: IDEAL_METRICS}
    for name, declared in phase.tolerance.items():
        where = f"{phase.name}: phase.json: tolerance.{name}"
        if name not in kinds:
            raise StudyError(f"{where}: no such scene or class; there are {', '.join(kinds)}")
        bounds = flatten(declared)
        if not str(bounds.pop("reason", "")).strip() or not bounds:
            raise StudyError(f"{where}: lacks its reason, or bounds no metric")
        for key, bound in bounds.items():
            if key not in kinds[name]:
                raise StudyError(f"{where}.{key}: no such metric; there are {', '.join(kinds[name])}")
            number = type(bound) in (int, float) and math.isfinite(bound)
            right = bound is True if key == "identical" else number and (name != TRUTH or bound >= 0)
            if not right or (key == OUTLINE and bound not in range(1, 9)):
                raise StudyError(
                    f"{where}.{key}: {bound!r} should be a finite number, of {TRUTH} 0 or more, of {OUTLINE} "
                    "1 to 8; of identical: true"
                )


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
        if name.startswith("flip") and not images.HAS_FLIP:
            continue  # images.FLIP_TOOL says so in the file
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


def by_truth(phase: Phase) -> bool:
    """Whether the phase is held against truth: systems, and phases behind opt4, which are nearer to it."""
    return phase.family == SYSTEMS or (phase.family == "ladder" and phase.order > LAST_AGAINST_BASELINE)


def left_to_truth(phase: Phase) -> bool:
    """Whether a phase behind opt4 declares what truth grants and nothing else: no tolerance to baseline."""
    return by_truth(phase) and set(phase.tolerance) - {IDEAL} == {TRUTH}


def margins(phase: Phase, key: str = TRUTH) -> dict[str, float]:
    """Metric → by how much the phase may be worse than baseline; what is not named here, by nothing. ENOUGH →
    the PSNR in dB from which on a picture is near enough. OUTLINE → pixels. With the key IDEAL: metric → the
    least PSNR to the ideal picture in dB."""
    declared = flatten(phase.tolerance.get(key) or {})
    return {name: bound for name, bound in declared.items() if name != "reason"}


def visible(baseline: Mapping) -> dict[str, float]:
    """Margins for phases that are shown and not gated: differences that a table of three digits has."""
    values = flatten(baseline)
    names = [name for name in dict.fromkeys((*TRUTH_METRICS, *CONVERGED_METRICS)) if name in values]
    return {name: SHOWN_DB if name.endswith("_db") else SHOWN_SHARE * abs(values[name]) for name in names}


def inferior(
    metrics: Mapping,
    references: Mapping[str, Mapping],
    allowed: Mapping[str, float],
    ideal: Mapping[str, float] | None = None,
) -> dict[str, str]:
    """Metric on which the picture is further from truth than every reference, by more than is allowed → why.
    `references`: name → metrics, baseline's first; per metric the worst of them is the bound, so that a phase
    need not repeat baseline's luck in rounding. A reference that lacks a metric does not judge it, nor does
    one that has no right hit judge |Δt|: what it misses is in another metric. A scene whose truth is
    marched has the hits of its proved pixels, if there are any. `ideal`: of a phase that draws the
    ideal shadow, the least PSNR to that picture; then the estimator's shadow is in no metric that is judged.
    """
    mine, others = flatten(metrics), {who: flatten(values) for who, values in references.items()}
    found, enough = {}, allowed.get(ENOUGH, NEAREST)
    if not (mine["non_finite"] <= 0):
        found["non_finite"] = f"{mine['non_finite']} samples, should be none"
    for name in CONVERGED_METRICS if mine["converged_only"] else TRUTH_METRICS:
        if mine["converged_only"] and name in HITS and mine["proved_fraction"] == 0:
            continue
        if ideal and name.removeprefix("antialiased.") in _ESTIMATED:
            continue
        db = name.endswith("_db")
        at_least = db or name in AT_LEAST
        value, *bounds = (
            enough if db and x >= enough else x
            for x in (mine.get(name, math.nan), *(other.get(name, math.nan) for other in others.values()))
        )
        margin = allowed.get(name, 0)
        judges = [(x, who) for x, who in zip(bounds, others, strict=True) if name != "dt_p99" or x == x]
        if not judges:
            continue
        bound, who = judges[0]
        for other, whose in judges:
            if other < bound if at_least else other > bound:
                bound, who = other, whose
        grant = f" and {margin:g} are granted" if margin else ""
        if at_least:
            if not (value >= bound - margin):
                found[name] = f"{value:.6g}, {who} has {bound:.6g}{grant}: should be at least that"
        elif not (value <= bound + margin):
            found[name] = f"{value:.6g}, {who} has {bound:.6g}{grant}: should be at most that"
    for name, bound in (ideal or {}).items():
        if name in (CONVERGED_METRICS if mine["converged_only"] else TRUTH_METRICS):
            value = mine.get(name, math.nan)
            if not (value >= bound):
                found[name] = f"{value:.6g}, should be at least {bound:g}, as the phase declares"
    return found
