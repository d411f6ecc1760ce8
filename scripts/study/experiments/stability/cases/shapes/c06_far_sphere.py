"""A sphere at a thousand radii and further: see CASE."""

from __future__ import annotations

import math

from study.experiments.stability.cases import Case, Outcome, Phase
from study.experiments.stability.cases.scenes import found, scene, shape

RADIUS = 1.0
OFFSETS = (0.0, 0.3, -0.6, 0.9, 1.1, -1.5)  # of the rays from the axis; the last two pass the sphere


def far(distance: float, offset: float) -> dict:
    """A ray along z, `offset` beside the centre of a unit sphere."""
    return scene(
        [shape("sphere", radius=RADIUS, position=[0, 0, distance])],
        camera={"position": [offset, 0, 0], "look_at": [offset, 0, 1]},
        march={"bounds_radius": 2 * distance},
    )


def exact(distance: float, offset: float) -> float:
    """t of the ray; infinite if it passes the sphere."""
    inside = RADIUS**2 - offset**2
    return distance - math.sqrt(inside) if inside > 0 else math.inf


def run(phase: Phase, distance: float) -> Outcome:
    worst, wrong, units = 0.0, 0, 0.0
    for offset in OFFSETS:
        picture, t = phase.render(far(distance, offset), (1, 1)), exact(distance, offset)
        if bool(found(picture)[0, 0]) != math.isfinite(t):
            wrong, worst = wrong + 1, max(worst, 1.0)
        elif math.isfinite(t):
            off = abs(float(picture["Z"][0, 0]) - t)
            worst, units = max(worst, off / t), max(units, off)
    return Outcome(worst, note=f"{wrong} false hits or misses, |Δt| up to {units:.1e} R")


CASE = Case(
    number=6,
    name="far_sphere",
    title="Sphere at 1000 radii and further",
    what="Six parallel rays to a sphere of radius 1, at a distance of 100 to 10⁸: four meet it, up to 0.9 "
    "from its axis, two pass it at 1.1 and 1.5.",
    why="What is asked for is one part in 10⁸ of the numbers that it is worked out from. The distance |p "
    "− c| − R cancels nearly all digits, and so does any formula that squares the distance. Float has "
    "7.2 digits.",
    source="E. Haines, J. Günther and T. Akenine-Möller, *Precision improvements for ray/sphere "
    "intersection*, Ray Tracing Gems (2019), chapter 7, for the quadratic formula.",
    known="t = D − √(R² − b²) in double, good to 2e-16·D.",
    strength="distance, radii",
    strengths=(100.0, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8),
    metric="relative |Δt|",
    unit="",
    fails_above=2.0**-22,
    limit="The picture's own float keeps t to 2⁻²⁴; 2⁻²² leaves room for three more roundings. A false "
    "hit or miss counts as 1.",
    run=run,
)
