"""Hard case 28."""

from __future__ import annotations

import numpy as np

from study.experiments.stability.cases import Case, Outcome, Phase, exact
from study.experiments.stability.cases.scenes import camera_frame, scene, shape

SIZE = (32, 18)
BASE = {"position": [3, 2, -3], "look_at": [0, 0, 0], "up": [0, 1, 0], "vertical_fov_degrees": 35}


def leaning(angle: float | None) -> dict:
    """The same view; `up` at this angle (radians) from the direction of view in place of square to it."""
    boxes = [
        shape("box", half_size=[0.4, 0.3, 0.5], position=[x, 0, z]) for x in (-0.7, 0.7) for z in (-0.8, 0.8)
    ]
    whole = scene(boxes, camera=BASE)
    if angle is not None:
        _, _, up, forward = camera_frame(whole)
        whole["camera"] = BASE | {"up": [float(x) for x in np.cos(angle) * forward + np.sin(angle) * up]}
    return whole


def run(phase: Phase, strength: float) -> Outcome:
    known, picture = phase.render(leaning(None), SIZE), phase.render(leaning(strength), SIZE)
    same = known["id"] == picture["id"]
    both = same & (known["id"] >= 0)
    off = ~same
    off[both] = ~(np.abs(known["Z"][both] - picture["Z"][both]) <= 1e-4)
    return Outcome(exact.share(off))


CASE = Case(
    number=28,
    name="up_along_view",
    title="An up vector that leans into the direction of view",
    what="One view of four boxes, its up vector given square to the direction of view, and then closer and "
    "closer to it; the loader refuses it from a sine of 1e-6 on.",
    why="The camera's right is a cross product that vanishes as the two become parallel: its direction is "
    "then what rounding left of it, and the picture rolls.",
    source="A lasting question (computergraphics.stackexchange.com 5491, How to get camera right vector "
    "when front and up are collinear, 2017; gamedev.net, Camera lookat jumps around, 2008).",
    known="Every up vector in the same half plane through the direction of view gives the same frame, "
    "hence the same picture.",
    strength="angle between up and the direction of view, radians",
    strengths=(1.5, 1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1.1e-6),
    metric="pixels of another shape, or of another depth by more than 1e-4",
    unit="%",
    fails_above=0.2,
    limit="One pixel of the 576 may lie on an edge.",
    run=run,
)
