"""1/√0, and reciprocal roots that differ by CPU."""

from __future__ import annotations

import math

import numpy as np

from study.experiments.stability.cases import Outcome, Phase
from study.experiments.stability.cases.scenes import scene, shape

SHAPES = {
    "sphere": {"radius": 1},
    "torus": {"major_radius": 1, "minor_radius": 0.4},
    "cone": {"bottom_radius": 1, "top_radius": 0.5, "half_height": 1},
    "mandelbulb": {"power": 8, "iterations": 1, "bailout": 4},
}


def at_centre(kind: str, off: float) -> tuple[np.ndarray, np.ndarray]:
    """Points off the centre by `off` along each axis and in all, and their distances, in double."""
    p = np.array([(off, 0, 0), (0, off, 0), (0, 0, off), (-off, off, 0.5 * off), (-0.0, -off, -0.0)])
    ring, length = np.hypot(p[:, 0], p[:, 2]), np.hypot(np.hypot(p[:, 0], p[:, 1]), p[:, 2])
    if kind == "sphere":
        return p, length - 1
    if kind == "torus":
        return p, np.hypot(ring - 1, p[:, 1]) - 0.4
    if kind == "cone":  # to the side, along its normal, or to a cap
        side = (0.75 - 0.25 * p[:, 1] - ring) / math.hypot(0.25, 1)
        return p, -np.minimum(side, 1 - np.abs(p[:, 1]))
    # 1 iteration from so near: |w| is |p|, and the derivative 1
    return p, np.where(length > 0, 0.5 * np.log(np.where(length > 0, length, 1)) * length, 0)


def run(phase: Phase, strength: float) -> Outcome:
    error, worst_of = 0.0, ""
    for kind, sizes in SHAPES.items():
        if kind == "mandelbulb" and strength < 20:
            continue  # the closed form is for points so near that their eighth power vanishes
        points, known = at_centre(kind, 2.0**-strength)
        got = phase.distances(scene([shape(kind, **sizes)]), points)
        off = np.abs(got - known)
        this = float(np.max(np.where(np.isfinite(got), off, np.inf)))
        if this > error:
            error, worst_of = this, kind
    return Outcome(error, note=worst_of)
