"""Scenes of soft shadows at edges, and the bound on a soft shadow's terms."""

from __future__ import annotations

import math

import numpy as np

from conformance.feature_scenes import scene, shape
from study.pictures import images

STRENGTH = 3.0


def bound(q: float) -> float:
    """No term of a march with h ≥ q·t is less than strength times this (PROOFS.md, 1)."""
    r = (1 + q) / 2
    return min(q, q * math.sqrt(1 - r * r) / (1 - q * r))


def lit(kind: str, position: list[float]) -> dict:
    return {"position": position, "shadows": kind, "emission": [9, 9, 9]}


def decibels(mine: np.ndarray, wanted: np.ndarray, where: np.ndarray) -> float:
    """PSNR of linear colours, clamped, in the pixels `where`."""
    error = (np.clip(mine, 0, 1) - np.clip(wanted, 0, 1))[where].astype(float)
    return float(-10 * np.log10(max(float((error**2).mean()), 1e-15)))


def clamped(made: dict[str, np.ndarray]) -> np.ndarray:
    return np.clip(images.rgb(made), 0, 1).astype(float)


# Shadows of what is not flat for the first steps of a march. The shape taken for flat is off by 2.9e-3 and
# 4.1e-3, float by 8e-6.
SOFT = lit("soft", [3, 2, -1])
SHARP = {
    "edges": scene(
        [
            shape("box", rotation_degrees=[20, 30, 10], position=[-2, 0, 0]),
            shape("cone", position=[1.8, 0, 0], top_radius=0.002),
            shape("octahedron", position=[0, 0.3, 2]),
        ],
        light=SOFT,
        march={"surface_offset": 0.05},
    ),
    "shapes of ten offsets": scene(
        [
            shape("sphere", radius=0.01, position=[0.41, 1.09, -4.9]),
            shape("torus", major_radius=0.02, minor_radius=0.005, position=[0.43, 1.09, -4.9]),
            shape(
                "cone", bottom_radius=0.01, top_radius=0.004, half_height=0.01, position=[0.385, 1.09, -4.9]
            ),
        ],
        light=SOFT,
    ),
}
