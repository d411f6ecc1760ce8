"""Hard case 35."""

from __future__ import annotations

import math

import numpy as np

from study.experiments.stability.cases import Case, Outcome, Phase, exact
from study.experiments.stability.cases.scenes import found, scene, shape

SIZE, FAR = (24, 16), 50.0


def low_sun(degrees: float, shadows: str) -> dict:
    """A bare floor under a light this high over the horizon, seen from above."""
    angle = math.radians(degrees)
    return scene(
        [shape("plane", normal=[0, 1, 0], offset=0)],
        light={
            "position": [FAR * math.cos(angle), FAR * math.sin(angle), 0],
            "emission": [500, 500, 500],
            "shadows": shadows,
        },
        camera={"position": [0, 3, -3], "vertical_fov_degrees": 20},
        march={"max_steps": 1000000},
    )


def run(phase: Phase, strength: float) -> Outcome:
    bare, full = (phase.render(low_sun(strength, how), SIZE) for how in ("none", "hard"))
    dark = found(bare) & ~(np.abs(full["R"] / bare["R"] - 1) <= 1e-3)
    return Outcome(exact.share(dark[found(bare)]))


CASE = Case(
    number=35,
    name="low_sun",
    title="A bare floor under a low sun",
    what="A floor with nothing on it, under hard shadows, its light sinking to the horizon. The step cap "
    "is a million.",
    why="The shadow ray starts surface_offset towards the light, so only offset·sine above the floor: at a "
    "twentieth of a degree that is the hit distance, and the floor shadows itself. Before that, the hit's "
    "own error adds to it.",
    source="Shadow acne at sunrise and sunset: Cesium pull request 3683 (2016), OpenSpace issue 3596 "
    "(2025, the rings of Saturn); an offset along the normal in place of the ray: "
    "computergraphics.stackexchange.com 4986 (2017).",
    known="A floor alone lies in no shadow: the picture is the one without shadows.",
    strength="height of the light, degrees",
    strengths=(30, 10, 3, 1, 0.3, 0.1, 0.05, 0.02),
    metric="floor pixels that are dark",
    unit="%",
    fails_above=0.5,
    limit="Single dark pixels of a lit floor are seen; half a percent is two of them here.",
    run=run,
)
