"""The crease between two equal spheres."""

from __future__ import annotations

import math

import numpy as np

from study.experiments.stability.cases import Outcome, Phase
from study.experiments.stability.cases.scenes import angle_degrees, normals, scene, shape, worst

SIZE, DEGREES = 16, 5.0


def overlapping(pitch: float) -> dict:
    """Two spheres that overlap, seen so closely that pixels are `pitch` apart on their crease."""
    away = pitch * SIZE / (2 * math.tan(math.radians(DEGREES / 2)))
    spheres = [shape("sphere", radius=1, position=[x, 0, 0]) for x in (-0.6, 0.6)]
    camera = {"position": [0, 0, -0.8 - away], "look_at": [0, 0, 0], "vertical_fov_degrees": DEGREES}
    return scene(spheres, camera=camera, march={"bounds_radius": 1000})


def run(phase: Phase, strength: float) -> Outcome:
    picture = phase.render(overlapping(strength), (SIZE, SIZE))
    n, mirror = normals(picture), normals(picture)[:, ::-1] * [-1, 1, 1]
    expected = np.where(np.arange(SIZE) < SIZE // 2, 0, 1)[None, :]
    strays = int((picture["id"] != expected).sum())
    angle = np.where(picture["id"] == expected, angle_degrees(n, mirror), 180.0)
    with np.errstate(invalid="ignore"):  # ∞ − ∞ where the picture misses
        uneven = worst(np.abs(picture["Z"] - picture["Z"][:, ::-1]))
    return Outcome(
        worst(angle), note=f"{strays} pixels on the wrong sphere, depth uneven by {uneven:.1e}" * bool(strays)
    )
