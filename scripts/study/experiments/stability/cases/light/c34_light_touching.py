"""A light that touches a wall."""

from __future__ import annotations

import numpy as np

from study.experiments.stability.cases import Outcome, Phase, exact
from study.experiments.stability.cases.scenes import rays, scene, shape, worst
from study.pictures.images import rgb

SIZE, WALL = (9, 9), 1.7


def touching(height: float) -> dict:
    """A wall, and a light this high over the point in the middle of the picture."""
    return scene(
        [shape("plane", normal=[0, 0, -1], offset=-WALL)],
        camera={"position": [0.3, 0.2, -3], "look_at": [0.3, 0.2, 0], "vertical_fov_degrees": 1},
        light={"position": [0.3, 0.2, WALL - height], "emission": [0.1, 0.1, 0.1], "shadows": "hard"},
    )


def run(phase: Phase, strength: float) -> Outcome:
    whole = touching(strength)
    origin, directions = rays(whole, SIZE)
    n = np.array([0, 0, -1])
    points = origin + exact.plane(origin, directions, -n, WALL)[..., None] * directions
    known = exact.light(points, n, directions, whole, "plain").astype(float)
    off = np.abs(rgb(phase.render(whole, SIZE)).astype(float) / known - 1)
    return Outcome(worst(off), note=f"in the middle {off[SIZE[1] // 2, SIZE[0] // 2].max():.1e}")
