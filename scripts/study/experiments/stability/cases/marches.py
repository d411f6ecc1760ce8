"""Hard cases of where a march ends: at grazing angles, past near misses, far away, at a cap or a bound."""

import math

import numpy as np

from study.experiments.stability.cases import Outcome, Phase, exact
from study.experiments.stability.cases.exact import share
from study.experiments.stability.cases.scenes import (
    AHEAD,
    ball,
    depths,
    evals,
    eye,
    floor,
    found,
    one_ray,
    rays,
    scene,
    section,
    shape,
    wall,
    worst,
)

# 1: a plane at a grazing angle
HIT_DISTANCE = 1e-6  # of a ray that starts at height 1


def grazing_answer(degrees: float) -> tuple[float, float]:
    """Exact t, and the number of evaluations of a march in exact arithmetic."""
    s = math.sin(math.radians(degrees))
    return 1 / s, math.ceil(math.log(HIT_DISTANCE) / math.log1p(-s)) + 1


def grazing(degrees: float) -> dict:
    """The camera looks at a point of the plane below its horizon: one ray, exactly through that point."""
    t, steps = grazing_answer(degrees)
    return scene(
        [floor()],
        camera=eye([0, 1, 0], [0, 0, 1 / math.tan(math.radians(degrees))]),
        march={"hit_distance": HIT_DISTANCE, "max_steps": int(2 * steps + 100), "bounds_radius": 4 * t},
    )


def c01_grazing_plane(phase: Phase, degrees: float) -> Outcome:
    met = one_ray(phase, grazing(degrees))
    t, steps = grazing_answer(degrees)
    took = f"{met.evals} evaluations, exact arithmetic takes {steps}"
    if met.shape < 0:
        return Outcome(math.inf, note=f"missed; {took}")
    return Outcome(abs(met.t - t) / (HIT_DISTANCE / math.sin(math.radians(degrees))), note=took)


# 3: a near miss before a far background
BACKGROUND, DISTANCES = 2048.0, (10.0, 1000.0)  # of the wall, of the sphere from the camera


def passing(clearance: float, distance: float) -> dict:
    """A ray along z that passes a sphere at `clearance`, then meets a wall square to it."""
    return scene(
        [ball(1.0, 1 + clearance, 0, distance), wall(BACKGROUND, material="other")],
        camera=AHEAD,
        march={"bounds_radius": 2 * BACKGROUND},
    )


def c03_halo(phase: Phase, clearance: float) -> Outcome:
    errors, taken = [], []
    for distance in DISTANCES:
        met = one_ray(phase, passing(clearance, distance))
        errors.append(abs(met.t - BACKGROUND))
        if met.shape != 1:
            taken.append(f"{'nothing' if met.shape else 'the sphere'} for the wall, sphere at {distance:g}")
    return Outcome(max(errors), note="; ".join(taken))


# 4: the step cap in a long thin gap
LENGTH, HEIGHTS = 10.0, (0.0, 0.25, -0.375)  # of the rays, as shares of the gap, from its middle


def gap(width: float, height: float) -> dict:
    """Two planes of that distance, a wall square to them, and a ray that runs along the gap."""
    y = height * width
    ceiling = shape("plane", normal=[0, -1, 0], offset=-width / 2)
    shapes = [floor(-width / 2), ceiling, wall(LENGTH, material="other")]
    return scene(shapes, camera=eye([0, y, 0], [0, y, 1]), march={"max_steps": 3000})


def steps_needed(width: float, height: float) -> float:
    """Evaluations of an exact march to the end: each step is the distance to the nearer plane."""
    return LENGTH / ((0.5 - abs(height)) * width) + 1


def c04_step_cap(phase: Phase, width: float) -> Outcome:
    met = [one_ray(phase, gap(width, height)) for height in HEIGHTS]
    missed = sum(not (one.shape == 2 and abs(one.t - LENGTH) <= 1e-4) for one in met)
    needed = max(steps_needed(width, height) for height in HEIGHTS)
    took = max(one.evals for one in met)
    return Outcome(missed, note=f"up to {took} evaluations; plain sphere tracing needs {needed:.0f}")


# 5: a hit distance below an ulp of t
FAR_SIZE = (16, 16)
LEANING = np.array([0.0, 0.6, -0.8])  # no ray is square to the wall, so no march gets there in one step


def far_wall(distance: float) -> dict:
    return scene(
        [shape("plane", normal=LEANING.tolist(), offset=LEANING[2] * distance)],
        camera=AHEAD,
        march={"bounds_radius": min(1e9, 4 * distance)},
    )


def to_far_wall(distance: float) -> np.ndarray:
    """t of each ray, (height, width)."""
    origin, directions = rays(far_wall(distance), FAR_SIZE)
    n = LEANING / np.linalg.norm(LEANING)
    return (n[2] * distance - n @ origin) / (directions @ n)


def c05_far_wall(phase: Phase, distance: float) -> Outcome:
    whole, t = far_wall(distance), to_far_wall(distance)
    picture = phase.render(whole, FAR_SIZE)
    hit = found(picture)
    stalled = int((~hit & (evals(picture) >= section(whole, "march").max_steps)).sum())
    off = np.abs(depths(picture)[hit] / t[hit] - 1)
    far = f", relative |Δt| up to {off.max():.1e}" if hit.any() else ""
    return Outcome(int((~hit).sum()), note=f"{stalled} of the misses used up all steps{far}")


# 23: the camera just above a surface, and on it
def over_floor(height: float) -> dict:
    return scene([floor()], camera=eye([0, height, 0], [0, height, 1], 90))


def c23_camera_near_surface(phase: Phase, strength: float) -> Outcome:
    whole = over_floor(strength)
    picture = phase.render(whole, (16, 16))
    hit = found(picture)
    rise = rays(whole, (16, 16))[1][..., 1]
    down = rise < 0
    known = np.where(down, strength / np.where(down, -rise, 1), np.inf)
    both = hit & down
    dt = worst(np.abs(depths(picture)[both] - known[both]))
    note = f"{int((hit & ~down).sum())} rising rays hit the floor, largest |Δt| {dt:.1e}"
    return Outcome(share(hit != down), note=note)


# 31: bounds that cut a shape
CUT_SIZE, CUT_AT = (32, 32), 5.0


def cut(k: float) -> dict:
    """A wall that bounds 2^−k of the distance beyond it cut to a disc, which fills the view."""
    bounds = CUT_AT * (1 + 2.0**-k)
    half = math.sqrt(bounds**2 - CUT_AT**2) / CUT_AT
    degrees = max(1.0, math.degrees(2 * math.atan(1.3 * half)))
    return scene([wall(CUT_AT)], camera=eye([0, 0, 0], [0, 0, 1], degrees), march={"bounds_radius": bounds})


def beyond_bounds(whole: dict) -> np.ndarray:
    """How far behind the bounds each ray of `cut` meets the wall."""
    t = exact.plane(*rays(whole, CUT_SIZE), [0, 0, 1], CUT_AT)
    return (t - section(whole, "march").bounds_radius).astype(float)


def c31_bounds_cut(phase: Phase, strength: float) -> Outcome:
    whole = cut(strength)
    return Outcome(share(found(phase.render(whole, CUT_SIZE)) != (beyond_bounds(whole) <= 0)))
