"""Hard case 24."""

from __future__ import annotations

import numpy as np

from study.experiments.stability.cases import Case, Outcome, Phase, exact
from study.experiments.stability.cases.scenes import rays, scene, shape, worst

SIZE = (48, 27)


def wall(degrees: float) -> dict:
    """A wall before the camera, which looks at it square, along no axis."""
    camera = {"position": [0, 0, 0], "look_at": [0.36, 0.48, 0.8], "vertical_fov_degrees": degrees}
    return scene([shape("plane", normal=[-0.36, -0.48, -0.8], offset=-1)], camera=camera)


def run(phase: Phase, strength: float) -> Outcome:
    whole = wall(strength)
    picture = phase.render(whole, SIZE)
    known = exact.plane(*rays(whole, SIZE), [0.36, 0.48, 0.8], 1)
    missed = int((picture["id"] < 0).sum())
    return Outcome(
        worst(np.abs(picture["Z"] / known.astype(float) - 1)), note=f"{missed} misses" * bool(missed)
    )


CASE = Case(
    number=24,
    name="wide_field",
    title="A field of view of 170 degrees",
    what="A wall seen square on, along no axis of the world, by wider and wider lenses, to the widest that "
    "the format allows; at 16:9 the corners of the last look 87.5 degrees aside, and the wall is 23 times "
    "as far there as in the middle.",
    why="The direction of a pixel far aside is the sum of a short forward and a very long sideways vector: "
    "what is left of forward after rounding decides where the ray meets the wall.",
    source="Directions spoilt by rounding: three-gpu-pathtracer issue 178 and pull request 190 (2022); "
    "projections of very wide fields: wwt-windows-client issue 179 (2021).",
    known="Ray against plane.",
    strength="vertical field of view, degrees",
    strengths=(30, 60, 120, 150, 165, 170),
    metric="largest relative error of the distance along a ray (a miss: infinite)",
    unit="",
    fails_above=1e-4,
    limit="A ten-thousandth of the way: below a pixel of a picture 4000 pixels high.",
    run=run,
)
