"""Hard case 13."""

from __future__ import annotations

import functools

import numpy as np

from study.experiments.stability.cases import Case, Outcome, Phase, exact
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


CASE = Case(
    number=13,
    name="no_lipschitz_bound",
    title="A field that grows faster than the distance",
    what="The phase's own distances to a sphere and a thin plate behind it are multiplied by a factor and "
    "sphere-traced, step by step, by the case itself; the phase supplies the distances in its own "
    "arithmetic.",
    why="A step is safe only while the field grows by no more than 1 per unit of length (Lipschitz "
    "constant 1). Multiplied by s it promises s times too much room, and a ray steps into or through a "
    "shape. Scaled, bent and blended fields all do this, and nothing in the march can notice it.",
    source="J. C. Hart, Sphere tracing, The Visual Computer 12 (1996): steps must be divided by the "
    "Lipschitz constant.",
    known="Ray against sphere and box, analytic.",
    strength="factor on the distance",
    strengths=(1, 1.05, 1.25, 1.5, 2, 3),
    metric="rays that end more than 1e-3 behind the surface, of those that hit",
    unit="%",
    fails_above=0.0,
    limit="A field that keeps its bound never lets a ray pass the surface. The failure is the method's: it "
    "is here to show its size, alike for every phase.",
    run=run,
)
