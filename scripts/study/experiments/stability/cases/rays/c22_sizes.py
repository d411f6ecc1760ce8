"""A grain before a planet."""

from __future__ import annotations

import functools

import numpy as np

from study.experiments.stability.cases import Outcome, Phase, exact
from study.experiments.stability.cases.scenes import rays, scene, shape, worst

SIZE = (32, 32)


def side_by_side(k: float) -> dict:
    """A grain of radius 10^−k before a ball of radius 10^k, all at the grain's scale."""
    grain, ball = 10.0**-k, 10.0**k
    shapes = [
        shape("sphere", radius=grain, position=[0.4 * grain, -0.3 * grain, 20 * grain]),
        shape("sphere", radius=ball, position=[0, 0, 40 * grain + ball], material="other"),
    ]
    march = {"hit_distance": max(1e-4 * grain, 1e-9), "normal_step": max(1e-3 * grain, 1e-9)}
    camera = {"position": [0, 0, 0], "look_at": [0, 0, 1], "vertical_fov_degrees": 10}
    return scene(shapes, camera=camera, march=march)


@functools.cache
def truth(k: float) -> tuple[np.ndarray, np.ndarray]:
    whole = side_by_side(k)
    origin, directions = rays(whole, SIZE)
    balls = [exact.sphere(origin, directions, s["position"], s["radius"]) for s in whole["shapes"]]
    return exact.nearest(*balls)


def run(phase: Phase, strength: float) -> Outcome:
    picture = phase.render(side_by_side(strength), SIZE)
    t, shapes = truth(strength)
    wrong = picture["id"] != shapes
    missed = int(((picture["id"] < 0) & (shapes >= 0)).sum())
    right = ~wrong & (shapes >= 0)
    dt = worst(np.abs(picture["Z"][right] - t[right]) * 10.0**strength)
    return Outcome(
        exact.share(wrong),
        note=f"{missed} false misses, largest |Δt| of the others {dt:.1e} radii of the grain",
    )
