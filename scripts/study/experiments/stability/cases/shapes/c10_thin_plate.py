"""A thin plate and a thin wire, of a thickness of 2⁻ᵏ: see CASE."""

from __future__ import annotations

import numpy as np

from study.experiments.stability.cases import Case, Outcome, Phase
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


CASE = Case(
    number=10,
    name="thin_plate",
    title="Thin plate and wire of thickness 2⁻ᵏ",
    what="64 rays to a leaning plate of thickness 2⁻ᵏ that fills the picture, and one to the middle of a "
    "wire (a thin torus). ε is an eighth of the thickness, at most 1e-6, at least 1e-9, the least the "
    "format has.",
    why="A method that samples along the ray steps over what is thinner than its step; sphere tracing "
    "does not, as long as no step is longer than the distance. Rounding of t makes some longer: once the "
    "plate is thinner than an ulp of t, the ray may be behind it before it has seen it. A normal by "
    "differences over 1e-4 reaches through a thin plate, as the note says.",
    source="D. Kalra and A. H. Barr, *Guaranteed ray intersections with implicit surfaces*, SIGGRAPH "
    "1989, for features that sampling misses; J. C. Hart, The Visual Computer 12 (1996), for the march "
    "that cannot.",
    known="The entry point: a ray and a plane in double, at half the thickness before the plate's middle; "
    "for the wire 5 − 2⁻ᵏ/2.",
    strength="thickness, scene units",
    strengths=tuple(2.0**-k for k in (2, 6, 10, 14, 18, 20, 22, 24, 26, 28)),
    metric="rays that miss or enter elsewhere, of 65",
    unit="rays",
    fails_above=0.0,
    limit="The plate fills the picture. A hit further than 1e-5 (10 ε) from the entry is as wrong as a miss.",
    run=run,
)
