"""A field that grows faster than the distance."""

from __future__ import annotations

import functools

import numpy as np

from study.experiments.stability.cases import Outcome, Phase, exact
from study.experiments.stability.cases.scenes import rays, scene, shape

SIZE, MOST_STEPS, HIT, DEEP = (12, 12), 120, 1e-6, 1e-3
PLATE = {"half_size": [1.5, 1.5, 0.01], "position": [0, 0, 2]}


@functools.cache
def truth() -> tuple[dict, np.ndarray, np.ndarray, np.ndarray]:
    """Scene, origin, directions (rays, 3) and first hits (rays)."""
    whole = scene([shape("sphere", radius=1), shape("box", **PLATE)], camera={"vertical_fov_degrees": 20})
    origin, directions = rays(whole, SIZE)
    directions = directions.reshape(-1, 3)
    ball = exact.sphere(origin, directions, [0, 0, 0], 1)
    plate = exact.box(origin, directions, PLATE["position"], PLATE["half_size"])
    return whole, origin, directions, exact.nearest(ball, plate)[0].astype(float)


def march(phase: Phase, scale: float) -> np.ndarray:
    """t at which sphere tracing of scale·f ends, +inf for a miss: what a renderer would do with it."""
    whole, origin, directions, _ = truth()
    t, end = np.zeros(len(directions)), np.full(len(directions), np.inf)
    active = np.arange(len(directions))
    for _ in range(MOST_STEPS):
        step = scale * phase.distances(whole, origin + t[active, None] * directions[active])
        t[active] += step
        there = step < HIT
        end[active[there]] = t[active[there]]
        active = active[~there & (t[active] < 20)]
        if not len(active):
            break
    return end


def run(phase: Phase, strength: float) -> Outcome:
    known, end = truth()[3], march(phase, strength)
    through = int((np.isfinite(known) & ~np.isfinite(end)).sum())
    hits = np.isfinite(known)
    late = ~(end[hits] - known[hits] <= DEEP)
    return Outcome(exact.share(late), note=f"{through} rays pass through a shape" * bool(through))
