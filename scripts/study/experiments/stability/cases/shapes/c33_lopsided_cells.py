"""Repetition of a shape that is not its own mirror image."""

from __future__ import annotations

import numpy as np

from study.experiments.stability.cases import Outcome, Phase, exact
from study.experiments.stability.cases.scenes import rays, scene, shape

SIZE, CELL, BOTTOM, HALF = (48, 48), 1.4, 0.9, 0.5
COPIES = range(-8, 9)


def stack(ratio: float) -> dict:
    """A column of cones, each wide below and narrow above, seen slantwise from below."""
    cone = shape(
        "cone", bottom_radius=BOTTOM, top_radius=BOTTOM / ratio, half_height=HALF, repeat=[0, CELL, 0]
    )
    camera = {"position": [0, -3.3, -3], "look_at": [0, 0, 0], "vertical_fov_degrees": 40}
    return scene([cone], camera=camera)


def run(phase: Phase, strength: float) -> Outcome:
    whole = stack(strength)
    origin, directions = rays(whole, SIZE)
    top = BOTTOM / strength
    t, _ = exact.nearest(
        *(exact.cone(origin, directions, [0, CELL * i, 0], BOTTOM, top, HALF) for i in COPIES)
    )
    seen = np.isfinite(t) & (t < 12)  # what lies further is smaller than a pixel's care
    picture = phase.render(whole, SIZE)
    missed = seen & (picture["id"] < 0)
    wrong = seen & ~(np.abs(picture["Z"] - np.where(seen, t, 0).astype(float)) <= 1e-2)
    return Outcome(
        exact.share(wrong[seen]), note=f"{int(missed.sum())} pixels see through a cone" * bool(missed.any())
    )
