"""A mirror seen at a grazing angle."""

from __future__ import annotations

import math

import numpy as np

from study.experiments.stability.cases import Outcome, Phase, exact
from study.experiments.stability.cases.scenes import rays, scene, shape, worst
from study.pictures.images import rgb

SIZE, REACH, SKY = (9, 1), 20.0, [0.5, 0.7, 0.9]
MATERIALS = {"mirror": {"color": [0.2, 0.2, 0.2], "reflectivity": 1, "shininess": 15}}


def skimming(degrees: float) -> dict:
    """A mirroring floor that the rays meet 20 units away, at this angle."""
    angle = math.radians(degrees)
    height = REACH * math.sin(angle)
    ahead = {"position": [0, height, 0], "look_at": [0, height - math.sin(angle), math.cos(angle)]}
    return scene(
        [shape("plane", normal=[0, 1, 0], offset=0, material="mirror")],
        camera=ahead | {"vertical_fov_degrees": 1},
        materials=MATERIALS,
        background=SKY,
        light={"position": [3, 40, 10], "emission": [5, 5, 5]},
        march={"max_steps": 1000000},
    )


def run(phase: Phase, strength: float) -> Outcome:
    whole = skimming(strength)
    origin, directions = rays(whole, SIZE)
    t = exact.plane(origin, directions, [0, 1, 0], 0)
    points = origin + t[..., None] * directions
    known = exact.light(points, np.array([0, 1, 0]), directions, whole, "mirror") + 0.1 * np.array(SKY)
    picture = phase.render(whole, SIZE)
    off = np.abs(rgb(picture).astype(float) / known.astype(float) - 1)
    missed = int((picture["id"] < 0).sum())
    return Outcome(worst(off), note=f"{missed} misses, largest |Δt| {worst(np.abs(picture['Z'] - t)):.1e}")
