"""A light inside a shape."""

from __future__ import annotations

import numpy as np

from study.experiments.stability.cases import Outcome, Phase, exact
from study.experiments.stability.cases.scenes import scene, shape

SIZE, AMBIENT = (32, 18), 0.01 * 0.6


def lamp(depth: float) -> dict:
    """A ball over a floor, the light inside it, `depth` above its lowest point."""
    return scene(
        [shape("plane", normal=[0, 1, 0], offset=0), shape("sphere", radius=1, position=[0, 2, 0])],
        light={"position": [0, 1 + depth, 0], "emission": [5, 5, 5], "shadows": "hard"},
        camera={"position": [0, 0.7, -5], "look_at": [0, 0.2, 0], "vertical_fov_degrees": 40},
    )


def run(phase: Phase, strength: float) -> Outcome:
    picture = phase.render(lamp(strength), SIZE)
    floor = picture["id"] == 0
    lit = ~(np.abs(picture["R"].astype(float) / AMBIENT - 1) <= 1e-3)
    return Outcome(exact.share(lit[floor]))
