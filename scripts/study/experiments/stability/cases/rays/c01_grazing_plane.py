"""A plane at a grazing angle: see CASE. J. C. Hart, The Visual Computer 12 (1996), on linear convergence."""

from __future__ import annotations

import math

from study.experiments.stability.cases import Case, Outcome, Phase
from study.experiments.stability.cases.scenes import found, scene, shape

HEIGHT, HIT_DISTANCE = 1.0, 1e-6


def answer(degrees: float) -> tuple[float, float]:
    """Exact t, and the number of evaluations of a march in exact arithmetic."""
    s = math.sin(math.radians(degrees))
    return HEIGHT / s, math.ceil(math.log(HIT_DISTANCE / HEIGHT) / math.log1p(-s)) + 1


def grazing(degrees: float) -> dict:
    """The camera looks at a point of the plane below its horizon: one ray, exactly through that point."""
    t, steps = answer(degrees)
    return scene(
        [shape("plane", normal=[0, 1, 0], offset=0)],
        camera={"position": [0, HEIGHT, 0], "look_at": [0, 0, HEIGHT / math.tan(math.radians(degrees))]},
        march={"hit_distance": HIT_DISTANCE, "max_steps": int(2 * steps + 100), "bounds_radius": 4 * t},
    )


def run(phase: Phase, degrees: float) -> Outcome:
    picture = phase.render(grazing(degrees), (1, 1))
    t, steps = answer(degrees)
    took = f"{int(picture['evals'][0, 0])} evaluations, exact arithmetic takes {steps}"
    if not found(picture)[0, 0]:
        return Outcome(math.inf, note=f"missed; {took}")
    bias = HIT_DISTANCE / math.sin(math.radians(degrees))
    return Outcome(abs(float(picture["Z"][0, 0]) - t) / bias, note=took)


CASE = Case(
    number=1,
    name="grazing_plane",
    title="Plane at a grazing angle",
    what="One ray from height 1 above a plane, at an angle θ to it. The step cap is twice what the ray "
    "needs, so that only the arithmetic is judged (case 4 is about the cap).",
    why="Every step takes the ray the share sin θ of its height nearer to the plane, so the march "
    "converges linearly and ever more slowly: ln(ε/h)/ln(1 − sin θ) steps. An error of the height, be it "
    "ε itself or rounding, is stretched by 1/sin θ along the ray, and rounding adds up over the many "
    "steps.",
    source="J. C. Hart, *Sphere tracing: a geometric method for the antialiased ray tracing of implicit "
    "surfaces*, The Visual Computer 12 (1996), shows linear convergence. Keinert et al., *Enhanced "
    "sphere tracing*, STAG 2014, shorten such marches by over-relaxation.",
    known="The ray meets the plane at t = 1/sin θ; heights form the geometric series (1 − sin θ)ⁿ, which "
    "gives the number of evaluations.",
    strength="θ, degrees",
    strengths=(45.0, 20.0, 5.0, 1.0, 0.3, 0.1, 0.03, 0.01),
    metric="|Δt| as a multiple of ε/sin θ",
    unit="",
    fails_above=1.0,
    limit="A march that stops below ε is off by less than ε/sin θ; what exceeds that is the phase's "
    "arithmetic.",
    run=run,
)
