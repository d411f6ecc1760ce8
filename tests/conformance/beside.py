"""A phase's picture beside the reference's: bounded loosely, to catch a feature that is wrong or left out."""

from __future__ import annotations

import functools
from dataclasses import dataclass, replace

import numpy as np

from conformance import harness
from conformance.feature_scenes import is_fractal
from conformance.harness import Run, check_picture, same_bits, within_reach
from study.core import registry
from study.core.registry import ROOT
from study.pictures import images


@dataclass(frozen=True)
class Bounds:
    """Shares of pixels, and medians, within which a phase must agree with the reference."""

    mask: float  # hit against miss, or another shape: rays that graze an edge
    depth: float  # median of |Δt|/t where both hit the same shape
    normal: float  # median of the normals' angle there, degrees
    colour: float  # median over pixels of the largest difference of a channel, clamped to [0, 1]
    mean: float  # difference of the mean colours
    off: float  # pixels off by more than 1/255


# A ray is decided otherwise only if it passes an edge by less than rounding: a ten-thousandth of a pixel in
# float. A hit lies within hit_distance/sin θ of the surface, and float32 keeps 1e-7 of it.
SMOOTH = {
    "double": Bounds(mask=0.002, depth=2e-7, normal=5e-4, colour=1e-5, mean=1e-4, off=0.002),
    "float": Bounds(mask=0.005, depth=2e-6, normal=0.02, colour=3e-4, mean=1e-3, off=0.02),
}
# A proved picture stands beside the reference's method, not only its arithmetic: hits within
# hit_distance/sin θ, normals turned by half of normal_step over the radius of curvature.
SMOOTH["exact"] = SMOOTH["float"]
# On a fractal neighbouring numbers may land on different leaves: most rays agree, the rest only on average.
FRACTAL = {
    "double": Bounds(mask=0.02, depth=1e-4, normal=0.05, colour=0.002, mean=0.005, off=0.1),
    "float": Bounds(mask=0.05, depth=1e-3, normal=0.5, colour=0.01, mean=0.01, off=0.3),
}
FRACTAL["exact"] = FRACTAL["float"]
# Where a proved picture is not the reference's, whatever its arithmetic: a shape that is not its mirror
# image has a distance that jumps at its cells' walls, and a march steps over what lies behind; no limit of a
# march ends a proof; and a march that starts inside of a shape ends there, a proof where the ray comes out.
UNLIKE = ["plane_repeated_x", "plane_repeated_y", "plane_repeated_z", "plane_repeated_all"]
UNLIKE += ["plane_turned_repeated"]
# Scenes of solids and planes whose picture is what a march has found when its step cap or hit distance ends
# it. A phase of exact hits (phase.json) draws these, and any under an override of either, as truth does.
ENDED = ["max_steps_1", "max_steps_2", "max_steps_20", "hit_distance", "two_spheres", "lattice"]
UNLIKE += ENDED
UNLIKE += ["camera_within_a_shape", "camera_under_the_floor", "camera_at_a_centre"]
UNLIKE += ["camera_under_the_floor_bulb", "light_under_the_floor_too"]
UNLIKE += ["camera_within_a_mandelbulb", "scene_within_a_sphere"]
UNLIKE += ["mandelbox_plane", "mandelbox_bulb", "mandelbox_hard", "mandelbox_ideal"]  # a floor, hit coarsely
UNLIKE += ["camera_within_one_of_a_crowd", "camera_within_a_sphere_of_a_crowd", "crowd_within_a_box"]

# Phases whose hits of a Mandelbulb are on its exact surface, 5e-6 behind the end of a march, and scenes in
# which the rule for normals (differences over normal_step) turns by degrees between the two: by 3.1 with 7
# iterations. The exact surface's own normal is 44 degrees from the march's there, and 33 from opt12's.
ON_THE_SURFACE, TURNED = {"opt12_fused"}, {"iterations_7": 4.0}


def precision(phase: str) -> str:
    """Which of the bounds hold for the phase."""
    found = registry.phases()[phase]
    return "exact" if found.family == registry.TRUTH else found.precision


def exact_hits(phase: str) -> bool:
    return registry.phases()[phase].exact_hits


def angles(p: dict[str, np.ndarray], q: dict[str, np.ndarray]) -> np.ndarray:
    """Angle between the normals of two pictures, degrees, small ones."""
    difference = [p[axis].astype(float) - q[axis] for axis in ("N.x", "N.y", "N.z")]
    return np.degrees(np.linalg.norm(difference, axis=0))


def in_ideal_shadow(expected: dict[str, np.ndarray], truth: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """What a phase that draws the ideal shadow should: truth's colours with it, where truth has the hit."""
    same = truth["id"] == expected["id"]
    return expected | {name: np.where(same, truth[f"ideal.{name}"], expected[name]) for name in "RGB"}


def compare(run: Run, expected: dict[str, np.ndarray], bounds: Bounds) -> None:
    """The run's picture against another one of the same scene."""
    p, q = run.picture, expected
    pixels = p["id"].size
    either = 1 + bounds.mask * pixels  # one pixel even of the smallest picture
    both = (p["id"] >= 0) & (p["id"] == q["id"])
    found = {"mask": int((p["id"] != q["id"]).sum())}
    assert found["mask"] <= either, f"{run}: {found['mask']} of {pixels} pixels hit another shape or none"
    if both.any():
        scale = np.maximum(np.abs(q["Z"][both]), 1)
        depth = np.median(np.abs(p["Z"][both] - q["Z"][both]) / scale)
        assert depth <= bounds.depth, f"{run}: median |Δt|/t is {depth:.2e}"
        angle = np.median(angles(p, q)[both])
        assert angle <= bounds.normal, f"{run}: median angle between normals is {angle:.2e} degrees"
    a, b = (np.clip(images.rgb(x), 0, 1).astype(float) for x in (p, q))
    difference = np.abs(a - b).max(axis=-1)
    assert np.median(difference) <= bounds.colour, f"{run}: colours differ by {np.median(difference):.2e}"
    mean = np.abs(a.mean(axis=(0, 1)) - b.mean(axis=(0, 1))).max()
    assert mean <= bounds.mean + either / pixels, f"{run}: mean colours differ by {mean:.2e}"
    off = (difference > 1 / 255).sum()
    assert off <= 1 + bounds.off * pixels, f"{run}: {off} of {pixels} pixels off by more than 1/255"


def check(run: Run, *options: str | int) -> None:
    """The picture in itself, and beside the reference's."""
    check_picture(run)
    proves = precision(run.record["phase"]) == "exact"
    if proves and (options or run.record["scene"] in UNLIKE):
        return
    height, width = run.picture["R"].shape
    by_truth = exact_hits(run.record["phase"]) and (options or run.record["scene"] in ENDED)
    beside = harness.TRUTH if by_truth else harness.REFERENCE
    drawn = functools.partial(harness.reference, ROOT / run.command[1], width, height, *options)
    reference = drawn(phase=beside)
    fractal = is_fractal(run.scene)
    bounds = (FRACTAL if fractal else SMOOTH)[precision(run.record["phase"])]
    if "start" in run.picture:  # from elsewhere a march ends elsewhere within the hit distance
        bounds = replace(bounds, depth=bounds.depth + run.record["hit_distance"])
    if run.record["phase"] in ON_THE_SURFACE and run.record["scene"] in TURNED:
        bounds = replace(bounds, normal=TURNED[run.record["scene"]])
    expected = within_reach(reference.picture, run, lambda: drawn(phase=harness.TRUTH).picture)
    soft = run.scene["light"]["shadows"] == "soft"
    if soft and registry.phases()[run.record["phase"]].draws_ideal:
        expected = in_ideal_shadow(expected, drawn(phase=harness.TRUTH).picture)
    compare(run, expected, bounds)
    phase, original = (registry.phases()[name] for name in (run.record["phase"], harness.REFERENCE))
    if phase.tolerance.get("fractal" if fractal else "smooth", {}).get("identical"):
        same_bits(run, reference)
    if phase.algorithm == original.algorithm:  # a packet's other rays are not this ray's evaluations
        mean, most = run.picture["evals"].mean(), 1.05 * reference.picture["evals"].mean() + 1
        assert mean <= most, f"{run}: {mean:.1f} evaluations a pixel, the reference needs {most:.1f}"
