"""Bounds that cut a shape."""

from __future__ import annotations

import math

from study.experiments.stability.cases import Outcome, Phase, exact
from study.experiments.stability.cases.scenes import found, rays, scene, shape

SIZE, FAR = (32, 32), 5.0


def cut(k: float) -> dict:
    """A wall that bounds 2^−k of the distance beyond it cut to a disc, which fills the view."""
    bounds = FAR * (1 + 2.0**-k)
    half = math.sqrt(bounds**2 - FAR**2) / FAR
    degrees = max(1.0, math.degrees(2 * math.atan(1.3 * half)))
    camera = {"position": [0, 0, 0], "look_at": [0, 0, 1], "vertical_fov_degrees": degrees}
    return scene(
        [shape("plane", normal=[0, 0, -1], offset=-FAR)], camera=camera, march={"bounds_radius": bounds}
    )


def run(phase: Phase, strength: float) -> Outcome:
    whole = cut(strength)
    t = exact.plane(*rays(whole, SIZE), [0, 0, 1], FAR)
    inside = t <= whole["march"]["bounds_radius"]
    return Outcome(exact.share(found(phase.render(whole, SIZE)) != inside))
