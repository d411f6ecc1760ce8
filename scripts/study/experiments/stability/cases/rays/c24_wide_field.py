"""A field of view of 170 degrees."""

from __future__ import annotations

import numpy as np

from study.experiments.stability.cases import Outcome, Phase, exact
from study.experiments.stability.cases.scenes import rays, scene, shape, worst

SIZE = (48, 27)


def wall(degrees: float) -> dict:
    """A wall before the camera, which looks at it square, along no axis."""
    camera = {"position": [0, 0, 0], "look_at": [0.36, 0.48, 0.8], "vertical_fov_degrees": degrees}
    return scene([shape("plane", normal=[-0.36, -0.48, -0.8], offset=-1)], camera=camera)


def run(phase: Phase, strength: float) -> Outcome:
    whole = wall(strength)
    picture = phase.render(whole, SIZE)
    known = exact.plane(*rays(whole, SIZE), [0.36, 0.48, 0.8], 1)
    missed = int((picture["id"] < 0).sum())
    return Outcome(
        worst(np.abs(picture["Z"] / known.astype(float) - 1)), note=f"{missed} misses" * bool(missed)
    )
