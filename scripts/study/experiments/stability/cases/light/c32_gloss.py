"""Hard case 32."""

from __future__ import annotations

import numpy as np

from study.experiments.stability.cases import Case, Outcome, Phase, exact
from study.experiments.stability.cases.scenes import rays, scene, shape, worst
from study.pictures.images import rgb

SIZE = (17, 17)


def glossy(shininess: float) -> dict:
    """A tilted wall square to camera and light, which coincide: the highlight is in the middle."""
    return scene(
        [shape("plane", normal=[0.36, 0.48, -0.8], offset=-4, material="gloss")],
        camera={"position": [0, 0, 0], "look_at": [-0.36, -0.48, 0.8], "vertical_fov_degrees": 1},
        light={"position": [0, 0, 0], "emission": [5, 5, 5]},
        materials={"gloss": {"color": [0.1, 0.1, 0.1], "reflectivity": 0, "shininess": shininess}},
    )


def run(phase: Phase, strength: float) -> Outcome:
    whole = glossy(strength)
    origin, directions = rays(whole, SIZE)
    n = np.array([0.36, 0.48, -0.8])
    points = origin + exact.plane(origin, directions, n, -4)[..., None] * directions
    known = exact.light(points, n, directions, whole, "gloss").astype(float)
    off = np.abs(rgb(phase.render(whole, SIZE)).astype(float) - known)
    middle = off[SIZE[1] // 2, SIZE[0] // 2].max()
    peak = 0.2 * 5 / 4
    return Outcome(worst(off) / peak, note=f"in the middle {middle / peak:.1e}")


CASE = Case(
    number=32,
    name="gloss",
    title="A highlight of enormous shininess",
    what="A wall square to the view with the light at the camera, so that the middle of the highlight is "
    "in the middle of the picture; the shininess grows to the format's limit.",
    why="cos^n multiplies an error of the cosine by n: at 10^9 a cosine of 1 + 10^−7, which float gives, "
    "becomes e^100, and one of 1 − 10^−7 nothing. A cosine above 1, or below 0, takes the logarithm inside "
    "a power out of its range.",
    source="B. T. Phong, CACM 18 (1975), for the exponent; powers of cosines an ulp outside [0, 1] are "
    "behind many black or burning pixels: LearnOpenGL issue 217 (2020), Cesium pull request 4423 (2016), "
    "three.js issue 5222 (2014).",
    known="Phong's terms in 80-bit floats; the middle is the highlight's peak whatever the exponent.",
    strength="shininess",
    strengths=(15, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9),
    metric="largest error of a colour, of the highlight's peak",
    unit="",
    fails_above=0.05,
    limit="A twentieth of the peak is seen as a flicker of the highlight.",
    run=run,
)
