"""Fog over a great distance."""

from __future__ import annotations

import numpy as np

from study.experiments.stability.cases import Outcome, Phase, exact
from study.experiments.stability.cases.scenes import rays, scene, shape, worst
from study.pictures.images import rgb

SIZE, WANTED = (8, 8), 0.7  # fog·|p|³ in the middle


def foggy(exponent: float, fog: float) -> dict:
    """A wall 10^exponent away, lit from the camera."""
    far = 10.0**exponent
    return scene(
        [shape("plane", normal=[0, 0, -1], offset=-far)],
        camera={"position": [0, 0, 0], "look_at": [0, 0, 1]},
        light={"position": [0, 0, 0], "emission": [min(5 * far, 1e9)] * 3},
        march={"bounds_radius": 1e9},
        fog=fog,
    )


def run(phase: Phase, strength: float) -> Outcome:
    whole = foggy(strength, WANTED / 10.0 ** (3 * strength))
    origin, directions = rays(whole, SIZE)
    t = exact.plane(origin, directions, [0, 0, 1], 10.0**strength)
    points = t[..., None] * directions
    known = exact.light(points, np.array([0, 0, -1]), directions, whole, "plain")
    known = known * np.exp(-np.longdouble(whole["fog"]) * t**3)[..., None]
    off = np.abs(rgb(phase.render(whole, SIZE)).astype(float) / known.astype(float) - 1)
    thick = worst(rgb(phase.render(foggy(strength, 1e9), SIZE)).astype(float))
    return Outcome(max(worst(off), thick), note=f"in the thickest fog {thick:g}" if thick else "")
