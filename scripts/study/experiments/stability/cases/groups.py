"""Hard cases of groups: operations that coincide, graze, nest, twist or repeat; answers in closed form.

A function without a number gives the scene, and each ray's t in a picture (height, width), +inf for a miss.
"""

import functools
import math
from typing import Any

import numpy as np

from study.experiments.stability.cases import Outcome, Phase, exact
from study.experiments.stability.cases.scenes import ball, depths, eye, rays, scene, shape

Known = tuple[dict, np.ndarray]
SIZE, DEEP = (9, 9), 1e-3  # a picture, and a depth that is off by far more than the hit distance
NARROW = eye([0, 0, -5], [0, 0, 0], 8)


def found(phase: Phase, known: Known) -> tuple[np.ndarray, np.ndarray]:
    """The phase's depths, and those known."""
    whole, t = known
    return depths(phase.render(whole, (t.shape[1], t.shape[0]))), t


def off_by(phase: Phase, known: Known) -> Outcome:
    """|Δt| of the picture's one ray, scene units."""
    t, right = found(phase, known)
    return Outcome(float(np.abs(t - right)[0, 0]))


def wrong(phase: Phase, known: Known) -> Outcome:
    """The share of rays whose t is off by more than DEEP, or that miss where they should not, %."""
    t, right = found(phase, known)
    same = ~np.isfinite(t) & ~np.isfinite(right)
    with np.errstate(invalid="ignore"):
        return Outcome(exact.share(~same & ~(np.abs(t - right) <= DEEP)))


def group(operation: str, *shapes: dict, **keys: Any) -> dict:
    return {"type": "group", "operation": operation, "shapes": list(shapes), **keys}


def slab(front: float, back: float, half: float) -> dict:
    """A box between two depths, `half` wide and high to either side."""
    return shape("box", half_size=[half, half, (back - front) / 2], position=[0, 0, (front + back) / 2])


def seen_flat(shapes: list[dict], z: float) -> Known:
    """Rays that all end on the plane of that z."""
    whole = scene(shapes, camera=NARROW)
    origin, directions = rays(whole, SIZE)
    return whole, (z - origin[2]) / directions[..., 2]


def ahead(whole: dict, t: float) -> Known:
    """The one ray along the view."""
    return whole, np.array([[t]])


def carved(gap: float) -> Known:
    """A block's hole, from `gap` before its face to its middle."""
    return seen_flat([group("difference", slab(-0.5, 0.5, 1), slab(-0.5 - gap, 0, 0.6))], 0)


def c35_coincident_faces(phase: Phase, strength: float) -> Outcome:
    return wrong(phase, carved(strength))


def sheet(thickness: float) -> Known:
    """What two cuts leave of a block, and a wall behind it."""
    left = group("difference", slab(-1, 1, 1), slab(-2, 0, 2), slab(thickness, 2, 2))
    return seen_flat([left, slab(3, 4, 3)], 0)


def c36_sheet_between_cuts(phase: Phase, strength: float) -> Outcome:
    return wrong(phase, sheet(strength))


def stacked(count: float) -> Known:
    """n equal spheres with blend k: one whose radius is larger by k/2·(1 − 1/n)."""
    blend, radius = 0.4, 0.5
    whole = scene([group("union", *[ball(radius)] * int(count), blend=blend)])
    return ahead(whole, 5 - radius - blend / 2 * (1 - 1 / count))


def c37_equal_spheres(phase: Phase, strength: float) -> Outcome:
    return off_by(phase, stacked(strength))


AMPLITUDE, FACE = 0.05, -1.0


@functools.cache
def displaced(product: float) -> Known:
    """A box's face where the two other sines are 1: FACE − z + a·sin(ω·z) with a·ω = `product`.

    Its first zero, by 10⁶ signs and then halving.
    """
    frequency = product / AMPLITUDE
    z = np.linspace(FACE - 1.01 * AMPLITUDE, FACE + 1.01 * AMPLITUDE, 1_000_000)
    first = int(np.argmax(FACE - z + AMPLITUDE * np.sin(frequency * z) <= 0))
    low, high = z[first - 1], z[first]
    for _ in range(60):
        middle = (low + high) / 2
        outside = FACE - middle + AMPLITUDE * math.sin(frequency * middle) > 0
        low, high = (middle, high) if outside else (low, middle)
    x = math.pi / 2 / frequency
    bumps = {"amplitude": AMPLITUDE, "frequency": [frequency] * 3}
    box = shape("box", half_size=[1 + x, 1 + x, 1], displace=bumps)
    return ahead(scene([box], camera=eye([x, x, -5], [x, x, 0])), 5 + float(high))


def c38_displaced(phase: Phase, strength: float) -> Outcome:
    return off_by(phase, displaced(strength))


def twisted(rate: float) -> Known:
    """A needle beside the axis of its twist. In a plane of one height it is a disc: turned, not deformed."""
    radius, away, height = 0.02, 0.5, 0.5
    needle = shape("capsule", radius=radius, half_height=1, position=[away, 0, 0])
    x, z = away * math.cos(rate * height), -away * math.sin(rate * height)
    whole = scene([group("union", needle, twist=rate)], camera=eye([x, height, -5], [x, height, 0]))
    return ahead(whole, 5 + z - radius)


def c39_twisted_needle(phase: Phase, strength: float) -> Outcome:
    return off_by(phase, twisted(strength))


def nested(depth: float) -> Known:
    """A ball in groups, each of which moves and turns it by a 32nd of a circle."""
    inner, centre, step = ball(0.3), np.zeros(3), [0.1, 0, 0.01]
    c, s = math.cos(math.pi / 16), math.sin(math.pi / 16)
    back = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])  # from a group's coordinates to its parent's
    for _ in range(int(depth)):
        inner = group("union", inner, position=step, rotation_degrees=[0, 0, 11.25])
        centre = back @ centre + step
    x, y, z = map(float, centre)
    return ahead(scene([inner], camera=eye([x, y, -5], [x, y, 0])), 5 + z - 0.3)


def c40_deep(phase: Phase, strength: float) -> Outcome:
    return off_by(phase, nested(strength))


def hollow(radius: float) -> Known:
    """A ray from within the hollow of a block, beside its middle."""
    around = group("difference", shape("box", half_size=[2 * radius] * 3), ball(radius))
    up, march = 0.3 * radius, {"bounds_radius": 10 * radius}
    whole = scene([around], camera=eye([0, up, 0], [0, up, 1]), march=march)
    return ahead(whole, math.sqrt(radius**2 - up**2))


def c41_inside_out(phase: Phase, strength: float) -> Outcome:
    return Outcome(off_by(phase, hollow(strength)).error / strength)


def walled(gap: float) -> Known:
    """Two equal spheres, blended, whose solid ends `gap` before the wall of their cell; repeated along x."""
    radius, blend = 0.4, 0.2
    grown = radius + blend / 4
    at = 1 - gap - grown
    pair = group("union", *[ball(radius, at, 0, 0)] * 2, blend=blend, repeat=[2, 0, 0])
    whole = scene([pair], camera=eye([5, 1, -4], [1.2, 0, 0], 20))
    origin, directions = rays(whole, SIZE)
    copies = [exact.sphere(origin, directions, [at + 2 * i, 0, 0], grown) for i in range(-60, 6)]
    return whole, np.min(copies, axis=0).astype(float)


def c42_blend_at_a_wall(phase: Phase, strength: float) -> Outcome:
    return wrong(phase, walled(strength))
