"""Thin plate and wire of thickness 2⁻ᵏ."""

from __future__ import annotations

import numpy as np

from study.experiments.stability.cases import Outcome, Phase
from study.experiments.stability.cases.scenes import angle_degrees, found, normals, rays, scene, shape

SIZE = (8, 8)
DEGREES = [0, 0, 30]  # the plate is turned, so that its faces are along no axis
FACE = np.array([np.cos(np.radians(30)), -np.sin(np.radians(30)), 0])  # normal of the plate's face


def plate(thickness: float) -> dict:
    """A leaning plate that fills the picture, seen at an angle; ε is an eighth of its thickness."""
    return scene(
        [shape("box", half_size=[thickness / 2, 8, 8], rotation_degrees=DEGREES)],
        camera={"position": [-4, 3, -1.5], "look_at": [0, 0, 0], "vertical_fov_degrees": 20},
        march=_march(thickness),
    )


def wire(thickness: float) -> dict:
    """A ring of wire, met square in the middle of the wire by one ray."""
    return scene(
        [shape("torus", major_radius=1, minor_radius=thickness / 2)],
        camera={"position": [1, 5, 0], "look_at": [1, 0, 0], "up": [0, 0, 1]},
        march=_march(thickness),
    )


def _march(thickness: float) -> dict:
    return {"hit_distance": min(1e-6, max(1e-9, thickness / 8))}


def exact(thickness: float) -> np.ndarray:
    """t of the plate's entry for each ray, (height, width)."""
    origin, directions = rays(plate(thickness), SIZE)
    side = np.sign(FACE @ origin)
    return (side * thickness / 2 - FACE @ origin) / (directions @ FACE)


def run(phase: Phase, thickness: float) -> Outcome:
    picture, t = phase.render(plate(thickness), SIZE), exact(thickness)
    hit = found(picture)
    wrong = ~hit | ~(np.abs(np.where(hit, picture["Z"], np.inf) - t) <= 1e-5)
    origin, _ = rays(plate(thickness), SIZE)
    angle = angle_degrees(normals(picture)[hit], np.sign(FACE @ origin) * FACE)
    ring = phase.render(wire(thickness), (1, 1))
    wrong_wire = not abs(float(ring["Z"][0, 0]) - (5 - thickness / 2)) <= 1e-5
    note = f"{int((~hit).sum())} of 64 rays miss the plate, {int(wrong.sum())} are wrong"
    note += f"; normals up to {angle.max(initial=0):.1f}° off; the wire is {'lost' if wrong_wire else 'met'}"
    return Outcome(int(wrong.sum()) + wrong_wire, note=note)
