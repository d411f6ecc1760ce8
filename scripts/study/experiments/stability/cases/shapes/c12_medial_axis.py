"""Hard case 12."""

from __future__ import annotations

import math

import numpy as np

from study.experiments.stability.cases import Case, Outcome, Phase
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


CASE = Case(
    number=12,
    name="medial_axis",
    title="The crease between two equal spheres",
    what="Two unit spheres overlap; the camera looks straight at the crease where they meet, in the plane "
    "of symmetry, and moves closer. No pixel lies on the crease: the nearest are half a pixel beside it.",
    why="Points at equal distance from both spheres form the medial axis, where the distance has no "
    "gradient. A forward difference that starts beside it and ends behind it mixes the two sides, and does "
    "so on one side only, since it steps towards +x.",
    source="H. Blum, A transformation for extracting new descriptors of shape (1967) for the medial axis; "
    "I. Quilez, numerical normals for SDFs (iquilezles.org/articles/normalsSDF), on forward differences "
    "favouring one side.",
    known="Symmetry: the picture, mirrored left to right with the first component of the normals negated, "
    "is itself, and its left half shows the left sphere.",
    strength="distance of neighbouring pixels on the surface, scene units (normal_step is 1e-4)",
    strengths=(1e-1, 1e-2, 1e-3, 1e-4, 3e-5, 1e-5),
    metric="largest angle between a normal and the mirrored one of its mirror pixel",
    unit="degrees",
    fails_above=1.0,
    limit="Forward differences over 1e-4 on a unit sphere err by 0.003 degrees; a degree is far outside "
    "that and moves a highlight visibly.",
    run=run,
)
