"""ε below an ulp of t: a far wall."""

from __future__ import annotations

import numpy as np

from study.experiments.stability.cases import Outcome, Phase
from study.experiments.stability.cases.scenes import found, rays, scene, shape

SIZE = (16, 16)
NORMAL = (0.0, 0.6, -0.8)  # the wall leans: no ray is square to it, so no march gets there in one step


def wall(distance: float) -> dict:
    return scene(
        [shape("plane", normal=list(NORMAL), offset=NORMAL[2] * distance)],
        camera={"position": [0, 0, 0], "look_at": [0, 0, 1]},
        march={"bounds_radius": min(1e9, 4 * distance)},
    )


def exact(distance: float) -> np.ndarray:
    """t of each ray, (height, width)."""
    origin, directions = rays(wall(distance), SIZE)
    n = np.array(NORMAL) / np.linalg.norm(NORMAL)
    return (n[2] * distance - n @ origin) / (directions @ n)


def run(phase: Phase, distance: float) -> Outcome:
    whole, t = wall(distance), exact(distance)
    picture = phase.render(whole, SIZE)
    hit = found(picture)
    stalled = int((~hit & (picture["evals"] >= whole["march"]["max_steps"])).sum())
    off = np.abs(picture["Z"][hit].astype(float) / t[hit] - 1)
    far = f", relative |Δt| up to {off.max():.1e}" if hit.any() else ""
    return Outcome(int((~hit).sum()), note=f"{stalled} of the misses used up all steps{far}")
