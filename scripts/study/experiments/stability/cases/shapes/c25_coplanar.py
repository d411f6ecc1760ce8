"""One surface a hair before another (z-fighting)."""

from __future__ import annotations

import numpy as np

from study.experiments.stability.cases import Outcome, Phase, exact
from study.experiments.stability.cases.scenes import scene, shape

SIZE = (32, 18)
FAR, NEAR = 0, 1  # the farther is the first, so that it wins a tie


def layers(gap: float) -> dict:
    """A tilted wall, and a box turned so that its face lies `gap` before it."""
    wall = shape("plane", normal=[0, -0.6, -0.8], offset=-4, material="other")
    # A face square to (0, −0.6, −0.8), half a thickness of 1 behind its surface.
    centre = [0.0, 0.6 * (5 - gap), 0.8 * (5 - gap)]
    box = shape("box", half_size=[6, 6, 1], position=centre, rotation_degrees=[turn(), 0, 0])
    camera = {"position": [0, 0, 0], "look_at": [0.1, 0.6, 0.8], "vertical_fov_degrees": 50}
    return scene([wall, box], camera=camera)


def turn() -> float:
    """About x, (y, z) → (c·y − s·z, s·y + c·z): takes (0, 0.6, 0.8) to (0, 0, 1)."""
    return float(np.degrees(np.arctan2(0.6, 0.8)))


def run(phase: Phase, strength: float) -> Outcome:
    picture = phase.render(layers(strength), SIZE)
    return Outcome(exact.share(picture["id"] != NEAR))
