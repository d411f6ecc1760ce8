"""A highlight of enormous shininess."""

from __future__ import annotations

import numpy as np

from study.experiments.stability.cases import Outcome, Phase, exact
from study.experiments.stability.cases.scenes import rays, scene, shape, worst
from study.pictures.images import rgb

SIZE = (17, 17)


def glossy(shininess: float) -> dict:
    """A tilted wall square to camera and light, which coincide: the highlight is in the middle."""
    return scene(
        [shape("plane", normal=[0.36, 0.48, -0.8], offset=-4, material="gloss")],
        camera={"position": [0, 0, 0], "look_at": [-0.36, -0.48, 0.8], "vertical_fov_degrees": 1},
        light={"position": [0, 0, 0], "emission": [5, 5, 5]},
        materials={"gloss": {"color": [0.1, 0.1, 0.1], "reflectivity": 0, "shininess": shininess}},
    )


def run(phase: Phase, strength: float) -> Outcome:
    whole = glossy(strength)
    origin, directions = rays(whole, SIZE)
    n = np.array([0.36, 0.48, -0.8])
    points = origin + exact.plane(origin, directions, n, -4)[..., None] * directions
    known = exact.light(points, n, directions, whole, "gloss").astype(float)
    off = np.abs(rgb(phase.render(whole, SIZE)).astype(float) - known)
    middle = off[SIZE[1] // 2, SIZE[0] // 2].max()
    peak = 0.2 * 5 / 4
    return Outcome(worst(off) / peak, note=f"in the middle {middle / peak:.1e}")
