"""Silhouette of a sphere."""

from __future__ import annotations

from fractions import Fraction

from study.experiments.stability.cases import Outcome, Phase
from study.experiments.stability.cases.scenes import found, scene, shape

RADIUS = 1.0
# Where the rays start, as multiples of the impact parameter: 3-4-5 and 5-12-13, as near as doubles come.
SIDES = ((1.0, 0.0), (0.0, -1.0), (0.6, 0.8), (-5 / 13, 12 / 13))


def starts(delta: float) -> list[tuple[float, float, bool]]:
    """x and y of each ray, which goes along z, and whether it meets the sphere: by the exact discriminant."""
    placed = []
    for x, y in SIDES:
        for b in (RADIUS * (1 - delta), RADIUS * (1 + delta)):
            px, py = x * b, y * b
            discriminant = Fraction(RADIUS) ** 2 - Fraction(px) ** 2 - Fraction(py) ** 2
            placed.append((px, py, discriminant > 0))
    return placed


def beside(x: float, y: float) -> dict:
    camera = {"position": [x, y, -5], "look_at": [x, y, 0]}
    return scene([shape("sphere", radius=RADIUS)], camera=camera)


def run(phase: Phase, delta: float) -> Outcome:
    false_hits = false_misses = 0
    for x, y, meets in starts(delta):
        hit = bool(found(phase.render(beside(x, y), (1, 1)))[0, 0])
        false_hits += hit and not meets
        false_misses += meets and not hit
    return Outcome(false_hits + false_misses, note=f"{false_hits} false hits, {false_misses} false misses")
