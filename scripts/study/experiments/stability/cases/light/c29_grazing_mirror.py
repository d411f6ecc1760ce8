"""Hard case 29."""

from __future__ import annotations

import math

import numpy as np

from study.experiments.stability.cases import Case, Outcome, Phase, exact
from study.experiments.stability.cases.scenes import rays, scene, shape, worst
from study.pictures.images import rgb

SIZE, REACH, SKY = (9, 1), 20.0, [0.5, 0.7, 0.9]
MATERIALS = {"mirror": {"color": [0.2, 0.2, 0.2], "reflectivity": 1, "shininess": 15}}


def skimming(degrees: float) -> dict:
    """A mirroring floor that the rays meet 20 units away, at this angle."""
    angle = math.radians(degrees)
    height = REACH * math.sin(angle)
    ahead = {"position": [0, height, 0], "look_at": [0, height - math.sin(angle), math.cos(angle)]}
    return scene(
        [shape("plane", normal=[0, 1, 0], offset=0, material="mirror")],
        camera=ahead | {"vertical_fov_degrees": 1},
        materials=MATERIALS,
        background=SKY,
        light={"position": [3, 40, 10], "emission": [5, 5, 5]},
        march={"max_steps": 1000000},
    )


def run(phase: Phase, strength: float) -> Outcome:
    whole = skimming(strength)
    origin, directions = rays(whole, SIZE)
    t = exact.plane(origin, directions, [0, 1, 0], 0)
    points = origin + t[..., None] * directions
    known = exact.light(points, np.array([0, 1, 0]), directions, whole, "mirror") + 0.1 * np.array(SKY)
    picture = phase.render(whole, SIZE)
    off = np.abs(rgb(picture).astype(float) / known.astype(float) - 1)
    missed = int((picture["id"] < 0).sum())
    return Outcome(worst(off), note=f"{missed} misses, largest |Δt| {worst(np.abs(picture['Z'] - t)):.1e}")


CASE = Case(
    number=29,
    name="grazing_mirror",
    title="A mirror seen at a grazing angle",
    what="Nine rays meet a mirroring floor twenty units away, at a smaller and smaller angle; the "
    "reflected rays see the sky. The step cap is a million, so that steps do not run out.",
    why="The reflected ray leaves almost along the mirror: it starts surface_offset above it and rises by "
    "a ten-thousandth of its way, so an error of its start or direction takes it back to the mirror, which "
    "then shows itself. Each step it takes is as short as the floor is near.",
    source="T. Whitted, CACM 23 (1980), for the reflected ray; self-hits of grazing rays: Wächter and "
    "Binder, Ray Tracing Gems (2019), chapter 6; Art of Illusion issue 193 (2020: a hang that hangs on "
    "distance and viewing angle).",
    known="Phong's terms at the exact hit, plus a tenth of the sky.",
    strength="angle to the mirror, degrees",
    strengths=(30, 10, 3, 1, 0.3, 0.1, 0.03, 0.01),
    metric="largest relative error of a colour",
    unit="",
    fails_above=0.01,
    limit="A hundredth is below what the eye tells apart; a mirror that sees itself errs by a third.",
    run=run,
)
