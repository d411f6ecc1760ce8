"""Thousands of equal shapes in one place."""

from __future__ import annotations

import numpy as np

from study.experiments.stability.cases import Outcome, Phase, exact
from study.experiments.stability.cases.scenes import scene, shape

SIZE = (16, 9)
TORUS = {"major_radius": 1, "minor_radius": 0.4, "rotation_degrees": [50, 10, 30]}


def alike(count: float) -> dict:
    return scene(
        [shape("torus", **TORUS) for _ in range(int(count))],
        light={"shadows": "hard"},
        camera={"vertical_fov_degrees": 40},
    )


def run(phase: Phase, strength: float) -> Outcome:
    one, many = phase.render(alike(1), SIZE), phase.render(alike(strength), SIZE)
    differs = np.zeros(one["R"].shape, bool)
    for name in one:
        differs |= one[name].view(np.uint32) != many[name].view(np.uint32)
    return Outcome(exact.share(differs))
