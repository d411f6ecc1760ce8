"""Plane at a grazing angle."""

from __future__ import annotations

import math

from study.experiments.stability.cases import Outcome, Phase
from study.experiments.stability.cases.scenes import found, scene, shape

HEIGHT, HIT_DISTANCE = 1.0, 1e-6


def answer(degrees: float) -> tuple[float, float]:
    """Exact t, and the number of evaluations of a march in exact arithmetic."""
    s = math.sin(math.radians(degrees))
    return HEIGHT / s, math.ceil(math.log(HIT_DISTANCE / HEIGHT) / math.log1p(-s)) + 1


def grazing(degrees: float) -> dict:
    """The camera looks at a point of the plane below its horizon: one ray, exactly through that point."""
    t, steps = answer(degrees)
    return scene(
        [shape("plane", normal=[0, 1, 0], offset=0)],
        camera={"position": [0, HEIGHT, 0], "look_at": [0, 0, HEIGHT / math.tan(math.radians(degrees))]},
        march={"hit_distance": HIT_DISTANCE, "max_steps": int(2 * steps + 100), "bounds_radius": 4 * t},
    )


def run(phase: Phase, degrees: float) -> Outcome:
    picture = phase.render(grazing(degrees), (1, 1))
    t, steps = answer(degrees)
    took = f"{int(picture['evals'][0, 0])} evaluations, exact arithmetic takes {steps}"
    if not found(picture)[0, 0]:
        return Outcome(math.inf, note=f"missed; {took}")
    bias = HIT_DISTANCE / math.sin(math.radians(degrees))
    return Outcome(abs(float(picture["Z"][0, 0]) - t) / bias, note=took)
