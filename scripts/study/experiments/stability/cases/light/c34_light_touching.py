"""Hard case 34."""

from __future__ import annotations

import numpy as np

from study.experiments.stability.cases import Case, Outcome, Phase, exact
from study.experiments.stability.cases.scenes import rays, scene, shape, worst
from study.pictures.images import rgb

SIZE, WALL = (9, 9), 1.7


def touching(height: float) -> dict:
    """A wall, and a light this high over the point in the middle of the picture."""
    return scene(
        [shape("plane", normal=[0, 0, -1], offset=-WALL)],
        camera={"position": [0.3, 0.2, -3], "look_at": [0.3, 0.2, 0], "vertical_fov_degrees": 1},
        light={"position": [0.3, 0.2, WALL - height], "emission": [0.1, 0.1, 0.1], "shadows": "hard"},
    )


def run(phase: Phase, strength: float) -> Outcome:
    whole = touching(strength)
    origin, directions = rays(whole, SIZE)
    n = np.array([0, 0, -1])
    points = origin + exact.plane(origin, directions, -n, WALL)[..., None] * directions
    known = exact.light(points, n, directions, whole, "plain").astype(float)
    off = np.abs(rgb(phase.render(whole, SIZE)).astype(float) / known - 1)
    return Outcome(worst(off), note=f"in the middle {off[SIZE[1] // 2, SIZE[0] // 2].max():.1e}")


CASE = Case(
    number=34,
    name="light_touching",
    title="A light that touches a wall",
    what="A point light above the middle of a wall, nearer and nearer to it; nine by nine rays in a field "
    "of one degree.",
    why="Light falls with the distance to the lamp, which is a difference of nearly equal places: the "
    "hit's own error (up to the hit distance) and the rounding of place and lamp decide how bright the "
    "middle is, and whether the lamp is before or behind the wall.",
    source="The singularity of point lights: NVISII issue 109 (2021), which clamps the distance to 1, and "
    "C. Yuksel, Point light attenuation without singularity (SIGGRAPH 2020 Talks); shadow rays that meet "
    "the wall they leave: SORT issue 117 (2020).",
    known="Phong's terms at the exact hit.",
    strength="height of the light over the wall, scene units (the hit distance is 1e-6)",
    strengths=(1, 1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-9),
    metric="largest relative error of a colour",
    unit="",
    fails_above=0.05,
    limit="A twentieth is seen as a spot.",
    run=run,
)
