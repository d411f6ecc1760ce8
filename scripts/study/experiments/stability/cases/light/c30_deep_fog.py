"""Hard case 30."""

from __future__ import annotations

import numpy as np

from study.experiments.stability.cases import Case, Outcome, Phase, exact
from study.experiments.stability.cases.scenes import rays, scene, shape, worst
from study.pictures.images import rgb

SIZE, WANTED = (8, 8), 0.7  # fog·|p|³ in the middle


def foggy(exponent: float, fog: float) -> dict:
    """A wall 10^exponent away, lit from the camera."""
    far = 10.0**exponent
    return scene(
        [shape("plane", normal=[0, 0, -1], offset=-far)],
        camera={"position": [0, 0, 0], "look_at": [0, 0, 1]},
        light={"position": [0, 0, 0], "emission": [min(5 * far, 1e9)] * 3},
        march={"bounds_radius": 1e9},
        fog=fog,
    )


def run(phase: Phase, strength: float) -> Outcome:
    whole = foggy(strength, WANTED / 10.0 ** (3 * strength))
    origin, directions = rays(whole, SIZE)
    t = exact.plane(origin, directions, [0, 0, 1], 10.0**strength)
    points = t[..., None] * directions
    known = exact.light(points, np.array([0, 0, -1]), directions, whole, "plain")
    known = known * np.exp(-np.longdouble(whole["fog"]) * t**3)[..., None]
    off = np.abs(rgb(phase.render(whole, SIZE)).astype(float) / known.astype(float) - 1)
    thick = worst(rgb(phase.render(foggy(strength, 1e9), SIZE)).astype(float))
    return Outcome(max(worst(off), thick), note=f"in the thickest fog {thick:g}" if thick else "")


CASE = Case(
    number=30,
    name="deep_fog",
    title="Fog over a great distance",
    what="A wall 10^e away behind fog that leaves half of its light, and behind the thickest fog that the "
    "format allows, which leaves nothing.",
    why="exp(−k·|p|³) cubes a distance: at 5·10^8 that is 10^26, and k 10^−26; their order of "
    "multiplication decides whether a float overflows or vanishes. The exponential of −10^35 must be 0, "
    "not what its bits make of it.",
    source="Black pixels in fog beyond some distance: Unity VolumetricLighting issue 18 (2017); infinities "
    "and NaN as fog parameters: ppsspp pull request 11380 (2018), xemu pull request 2298 (2025).",
    known="Phong's terms times the exponential, in 80-bit floats; zero in the thick fog.",
    strength="e: the wall is 10^e away",
    strengths=(1, 2, 4, 6, 8, 8.7),
    metric="largest relative error of a colour; in the thick fog the largest colour",
    unit="",
    fails_above=1 / 255,
    limit="One step of an 8-bit display.",
    run=run,
)
