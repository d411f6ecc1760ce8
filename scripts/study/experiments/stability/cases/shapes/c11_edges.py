"""Cone rim, box edge and corner, octahedron crease and vertex."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from study.experiments.stability.cases import Outcome, Phase
from study.experiments.stability.cases.scenes import angle_degrees, found, normals, scene, shape, worst

BOX, CONE, OCTAHEDRON = [1.0, 0.75, 0.5], (1.0, 0.5, 0.75), 1.0
NORMAL_STEP = 1e-4
AWAY = 4.0  # of the camera, along the face's normal


def spots(delta: float) -> Iterator[tuple[str, dict, np.ndarray, np.ndarray]]:
    """What it is, the shape, the point of the surface at `delta` from the edge, and the face's normal there.

    On both sides of each shape, since forward differences favour one.
    """
    box = shape("box", half_size=BOX)
    for sign in (1, -1):
        x, y, z = np.array(BOX) * [sign, sign, -1]
        yield "box edge", box, np.array([x - sign * delta, 0.1, z]), np.array([0, 0, -1.0])
        corner = np.array([x - sign * delta, y - sign * delta, z])
        yield "box corner", box, corner, np.array([0, 0, -1.0])
    bottom, top, half = CONE
    cone = shape("cone", bottom_radius=bottom, top_radius=top, half_height=half)
    for sign in (1, -1):
        across = np.array([0.8, 0, 0.6]) * sign
        yield "cone rim", cone, across * (top - delta) + [0, half, 0], np.array([0, 1.0, 0])
        slope = np.array([bottom - top, 2 * half]) / np.hypot(
            bottom - top, 2 * half
        )  # towards the top: (−x, y)
        down = across * (top + delta * slope[0]) + [0, half - delta * slope[1], 0]
        yield "cone rim", cone, down, across * slope[1] + [0, slope[0], 0]
    octahedron = shape("octahedron", radius=OCTAHEDRON)
    for sign in (1, -1):
        face = np.full(3, sign / np.sqrt(3))
        height = delta / np.sqrt(1.5)  # over the crease z = 0; the face leans away from it
        rest = (OCTAHEDRON - height) / 2
        yield "octahedron crease", octahedron, sign * np.array([rest, rest, height]), face
        low = delta / np.sqrt(2)
        yield "octahedron vertex", octahedron, sign * np.array([OCTAHEDRON - 2 * low, low, low]), face


def facing(one: dict, point: np.ndarray, normal: np.ndarray) -> dict:
    """One ray square to the face, to that point."""
    up = [0, 0, 1] if abs(normal[2]) < 0.9 else [0, 1, 0]
    camera = {"position": (point + AWAY * normal).tolist(), "look_at": point.tolist(), "up": up}
    return scene([one], camera=camera, march={"normal_step": NORMAL_STEP})


def run(phase: Phase, delta: float) -> Outcome:
    names, angles, off = [], [], []
    for name, one, point, normal in spots(delta):
        picture = phase.render(facing(one, point, normal), (1, 1))
        if not found(picture)[0, 0]:
            return Outcome(180.0, note=f"{name}: missed")
        names.append(name)
        off.append(abs(float(picture["Z"][0, 0]) - AWAY))
        angles.append(float(angle_degrees(normals(picture)[0, 0], normal)))
    note = f"worst at the {names[int(np.argmax(angles))]}; |Δt| up to {worst(off):.1e}"
    return Outcome(worst(angles), note=note if worst(angles) != 0 else "")
