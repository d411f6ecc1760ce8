"""Hard case 22."""

from __future__ import annotations

import functools

import numpy as np

from study.experiments.stability.cases import Case, Outcome, Phase, exact
from study.experiments.stability.cases.scenes import rays, scene, shape, worst

SIZE = (32, 32)


def side_by_side(k: float) -> dict:
    """A grain of radius 10^−k before a ball of radius 10^k, all at the grain's scale."""
    grain, ball = 10.0**-k, 10.0**k
    shapes = [
        shape("sphere", radius=grain, position=[0.4 * grain, -0.3 * grain, 20 * grain]),
        shape("sphere", radius=ball, position=[0, 0, 40 * grain + ball], material="other"),
    ]
    march = {"hit_distance": max(1e-4 * grain, 1e-9), "normal_step": max(1e-3 * grain, 1e-9)}
    camera = {"position": [0, 0, 0], "look_at": [0, 0, 1], "vertical_fov_degrees": 10}
    return scene(shapes, camera=camera, march=march)


@functools.cache
def truth(k: float) -> tuple[np.ndarray, np.ndarray]:
    whole = side_by_side(k)
    origin, directions = rays(whole, SIZE)
    balls = [exact.sphere(origin, directions, s["position"], s["radius"]) for s in whole["shapes"]]
    return exact.nearest(*balls)


def run(phase: Phase, strength: float) -> Outcome:
    picture = phase.render(side_by_side(strength), SIZE)
    t, shapes = truth(strength)
    wrong = picture["id"] != shapes
    missed = int(((picture["id"] < 0) & (shapes >= 0)).sum())
    right = ~wrong & (shapes >= 0)
    dt = worst(np.abs(picture["Z"][right] - t[right]) * 10.0**strength)
    return Outcome(
        exact.share(wrong),
        note=f"{missed} false misses, largest |Δt| of the others {dt:.1e} radii of the grain",
    )


CASE = Case(
    number=22,
    name="sizes",
    title="A grain before a planet",
    what="A sphere of radius 10^−k stands twenty radii before the camera, and one of radius 10^k forty "
    "grain radii before it fills the background. The hit distance is a ten-thousandth of the grain's "
    "radius, as far as the format lets it (1e-9).",
    why="The planet's distance is the difference of two numbers of its own size: at 10^6 a float tells "
    "0.06 from its neighbour, so it cannot tell whether the grain or the planet is nearer, and the march "
    "takes either for the other.",
    source="Reported wherever planets are drawn (gamedev.net, Imprecision problem on planet renderer, "
    "2012; Khronos forum, Big objects behaviour); D. Goldberg, What every computer scientist should know "
    "about floating-point arithmetic (1991), on cancellation.",
    known="Ray against sphere, with a discriminant that does not cancel, in 80-bit floats.",
    strength="k: radii 10^−k and 10^k",
    strengths=(0, 1, 2, 3, 4, 5, 6),
    metric="false hits, false misses and wrong shapes",
    unit="%",
    fails_above=1.0,
    limit="The grain's outline is 3 % of the picture's pixels; a third of those wrong is an outline that "
    "is seen to be ragged.",
    run=run,
)
