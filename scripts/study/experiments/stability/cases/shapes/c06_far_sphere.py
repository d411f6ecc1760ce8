"""Sphere at 1000 radii and further."""

from __future__ import annotations

import math

from study.experiments.stability.cases import Outcome, Phase
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
