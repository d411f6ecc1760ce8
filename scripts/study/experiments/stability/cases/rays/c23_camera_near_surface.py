"""Hard case 23."""

from __future__ import annotations

import numpy as np

from study.experiments.stability.cases import Case, Outcome, Phase, exact
from study.experiments.stability.cases.scenes import found, rays, scene, shape, worst

SIZE = (16, 16)


def over_floor(height: float) -> dict:
    camera = {"position": [0, height, 0], "look_at": [0, height, 1], "vertical_fov_degrees": 90}
    return scene([shape("plane", normal=[0, 1, 0], offset=0)], camera=camera)


def run(phase: Phase, strength: float) -> Outcome:
    whole = over_floor(strength)
    picture = phase.render(whole, SIZE)
    directions = rays(whole, SIZE)[1]
    down = directions[..., 1] < 0
    known = np.where(down, strength / np.where(down, -directions[..., 1], 1), np.inf)
    hit = found(picture)
    both = hit & down
    dt = worst(np.abs(picture["Z"][both] - known[both]))
    rising = int((hit & ~down).sum())
    return Outcome(
        exact.share(hit != down), note=f"{rising} rising rays hit the floor, largest |Δt| {dt:.1e}"
    )


CASE = Case(
    number=23,
    name="camera_near_surface",
    title="The camera just above a surface, and on it",
    what="A floor seen from a height that shrinks to zero, the view level: half of the rays fall on the "
    "floor, half rise from it.",
    why="A march asks only how near a surface is, not which way the ray goes: within the hit distance "
    "every ray has hit before it has started, also those that leave.",
    source="The same happens to every secondary ray, which is why they start at an offset (Wächter and "
    "Binder, Ray Tracing Gems, 2019, chapter 6); seen by users when the camera touches a shape: "
    "three-raymarch issue 1 (2023).",
    known="Falling rays hit at height/sine, rising rays never.",
    strength="height of the camera, scene units (the hit distance is 1e-6)",
    strengths=(1, 1e-2, 1e-4, 1e-5, 2e-6, 1e-6, 1e-7, 0),
    metric="false hits and false misses",
    unit="%",
    fails_above=0.0,
    limit="There is a right answer for every ray.",
    run=run,
)
