"""The halo that ε gives a shape: see CASE."""

from __future__ import annotations

from study.experiments.stability.cases import Case, Outcome, Phase
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


CASE = Case(
    number=3,
    name="halo",
    title="ε-halo: near miss before a far background",
    what="A ray passes a unit sphere at a clearance δ and then meets a wall at 2048. Once the sphere is "
    "10 away, once 1000.",
    why="A march that comes within ε of the sphere stops there, so that every shape has a halo as wide as "
    "ε, which shows as a wrong outline against a far background. A hit test that grows with t, as float "
    "needs, makes the halo of far shapes wider still. At a clearance of ε itself nothing at all is "
    "found: every step past the sphere is ε, and the steps run out.",
    source="The halo follows from ending the march at a distance: J. C. Hart, D. J. Sandin and L. H. "
    "Kauffman, SIGGRAPH 1989. Keinert et al., *Enhanced sphere tracing*, STAG 2014, choose the candidate "
    "with the least error on the screen instead.",
    known="By construction: the nearest the ray comes to the sphere is δ, so it meets the wall, at t = "
    "2048 exactly.",
    strength="clearance δ, scene units",
    strengths=(1e-1, 1e-2, 1e-3, 1e-4, 5e-5, 1e-5, 3e-6, 1e-6, 3e-7, 1e-7),
    metric="max |Δt|",
    unit="scene units",
    fails_above=1e-3,
    limit="2048 has a neighbour at 2.4e-4 in float; a wrong shape is off by 1000 and more.",
    run=run,
)
