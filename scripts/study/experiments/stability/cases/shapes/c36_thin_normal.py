"""The normal of a thin plate: see CASE. The plate is that of case 10."""

from __future__ import annotations

import math

import numpy as np

from study.experiments.stability.cases import Case, Outcome, Phase
from study.experiments.stability.cases.scenes import angle_degrees, found, normals
from study.experiments.stability.cases.shapes.c10_thin_plate import FACE, SIZE, plate


def exact(thickness: float) -> np.ndarray:
    """Normal of the face that the camera sees, (3,)."""
    return FACE * np.sign(FACE @ np.array(plate(thickness)["camera"]["position"], float))


def run(phase: Phase, thickness: float) -> Outcome:
    whole = plate(thickness)
    picture = phase.render(whole, SIZE)
    hit = found(picture)
    if not hit.all():
        return Outcome(math.inf, note=f"{int((~hit).sum())} of 64 rays miss the plate")
    angle = angle_degrees(normals(picture), exact(thickness))
    over = thickness / whole["march"]["normal_step"]
    return Outcome(float(angle.max()), note=f"the plate is {over:.2g} normal steps thick")


CASE = Case(
    number=36,
    name="thin_normal",
    title="Normal of a thin plate",
    what="The plate of case 10, seen at an angle: 64 rays, all of which should see its one flat face.",
    why="The plate is met where it should be, so case 10 passes. But a forward difference over "
    "normal_step (1e-4) starts on one face and, if the plate is thinner, ends behind the other: what it "
    "takes for the slope is the difference of two faces' distances. The whole plate is lit from a wrong "
    "side.",
    source="Found here, by the note of case 10. On the choice of the step of a numerical normal: I. "
    "Quilez, *normals for an SDF* (2015, iquilezles.org/articles/normalsSDF).",
    known="By construction: the face's normal, (cos 30°, −sin 30°, 0), towards the camera.",
    strength="thickness, scene units",
    strengths=(0.25, 1e-2, 1e-3, 5e-4, 2e-4, 1e-4, 5e-5, 1e-5, 1e-6, 1e-7),
    metric="largest angle to the face's normal",
    unit="degrees",
    fails_above=1.0,
    limit="As in case 11: one degree turns a mirrored ray by two, 48 lines of scene0's picture.",
    run=run,
)
