"""The camera just above a surface, and on it."""

from __future__ import annotations

import numpy as np

from study.experiments.stability.cases import Outcome, Phase, exact
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
