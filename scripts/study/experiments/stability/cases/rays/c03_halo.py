"""ε-halo: near miss before a far background."""

from __future__ import annotations

from study.experiments.stability.cases import Outcome, Phase
from study.experiments.stability.cases.scenes import scene, shape

RADIUS, BACKGROUND = 1.0, 2048.0
DISTANCES = (10.0, 1000.0)  # of the shape from the camera


def passing(clearance: float, distance: float) -> dict:
    """A ray along z that passes a sphere at `clearance`, then meets a wall square to it."""
    return scene(
        [
            shape("sphere", radius=RADIUS, position=[RADIUS + clearance, 0, distance]),
            shape("plane", normal=[0, 0, -1], offset=-BACKGROUND, material="other"),
        ],
        camera={"position": [0, 0, 0], "look_at": [0, 0, 1]},
        march={"bounds_radius": 2 * BACKGROUND},
    )


def run(phase: Phase, clearance: float) -> Outcome:
    errors, taken = [], []
    for distance in DISTANCES:
        picture = phase.render(passing(clearance, distance), (1, 1))
        shape_id, z = int(picture["id"][0, 0]), float(picture["Z"][0, 0])
        errors.append(abs(z - BACKGROUND))
        if shape_id != 1:
            taken.append(
                f"{'the sphere' if shape_id == 0 else 'nothing'} for the wall, sphere at {distance:g}"
            )
    return Outcome(max(errors), note="; ".join(taken))
