"""The answers of hard cases: first hits and light in 80-bit floats, from geometry and the scene format.

Nothing here marches. Origins are (3,), directions (..., 3) of unit length, results t (...), +inf for a miss.
"""

from types import SimpleNamespace
from typing import Any

import numpy as np

from study.experiments.stability.cases.scenes import section

Array = np.ndarray
L = np.longdouble


def _wide(*vectors: object) -> list[Array]:
    return [np.asarray(v, L) for v in vectors]


def plane(origin: Array, direction: Array, normal: object, offset: float) -> Array:
    """First t > 0 at which n·p = offset, n of any length."""
    o, d, n = _wide(origin, direction, normal)
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (L(offset) - o @ n) / (d @ n)
    return np.where(np.isfinite(t) & (t > 0), t, np.inf)


def sphere(origin: Array, direction: Array, centre: object, radius: float) -> Array:
    """First t > 0 from outside. The discriminant is r² − (distance of the line)², which does not cancel."""
    o, d, c = _wide(origin, direction, centre)
    away = o - c
    along = -(d @ away)
    across = away + along[..., None] * d
    inside = L(radius) ** 2 - (across**2).sum(-1)
    length = np.sqrt((away**2).sum())
    product = (length - L(radius)) * (length + L(radius))  # of both roots
    with np.errstate(invalid="ignore", divide="ignore"):
        t = product / (along + np.sqrt(inside))
    return np.where((inside >= 0) & (along > 0) & (t > 0), t, np.inf)


def box(origin: Array, direction: Array, centre: object, half: object) -> Array:
    """First t > 0 from outside, by slabs."""
    o, d, c, h = _wide(origin, direction, centre, half)
    with np.errstate(divide="ignore"):
        near, far = (-(o - c) - np.sign(d) * h) / d, (-(o - c) + np.sign(d) * h) / d
    first, last = np.max(near, -1), np.min(far, -1)
    return np.where((first <= last) & (first > 0), first, np.inf)


def cone(origin: Array, direction: Array, centre: Any, bottom: float, top: float, half: float) -> Array:
    """First t > 0 from outside a capped cone about y: its two discs and its side, whichever comes first."""
    o, d = _wide(np.subtract(origin, centre), direction)
    best = np.full(d.shape[:-1], np.inf, L)
    with np.errstate(divide="ignore", invalid="ignore"):
        for y, radius in ((-half, bottom), (half, top)):
            t = (L(y) - o[1]) / d[..., 1]
            x, z = o[0] + t * d[..., 0], o[2] + t * d[..., 2]
            good = np.isfinite(t) & (t > 0) & (x * x + z * z <= L(radius) ** 2)
            best = np.where(good, np.minimum(best, t), best)
        slope = (L(top) - L(bottom)) / (2 * L(half))
        middle = (L(top) + L(bottom)) / 2 + slope * o[1]  # radius of the side at the origin's height
        a = d[..., 0] ** 2 + d[..., 2] ** 2 - (slope * d[..., 1]) ** 2
        b = o[0] * d[..., 0] + o[2] * d[..., 2] - middle * slope * d[..., 1]
        c = o[0] ** 2 + o[2] ** 2 - middle**2
        for sign in (-1, 1):
            t = (-b + sign * np.sqrt(b * b - a * c)) / a
            y = o[1] + t * d[..., 1]
            good = np.isfinite(t) & (t > 0) & (np.abs(y) <= half) & (middle + slope * t * d[..., 1] >= 0)
            best = np.where(good, np.minimum(best, t), best)
    return best


def nearest(*hits: Array) -> tuple[Array, Array]:
    """t of the first of several shapes, and its index, −1 where none is hit."""
    stacked = np.stack(hits)
    first = stacked.min(0)
    return first, np.where(np.isfinite(first), stacked.argmin(0), -1)


def balls(whole: dict, origin: Array, direction: Array) -> tuple[Array, Array]:
    """`nearest` of a scene of spheres."""
    return nearest(*(sphere(origin, direction, s["position"], s["radius"]) for s in whole["shapes"]))


def light(points: Array, normals: Array, directions: Array, whole: dict, material: str) -> Array:
    """Linear colour (..., 3) of lit points: ambient 1 %, diffuse and 20 % specular, falling with 1/distance.

    As common/scenes/README.md has it with Phong's model (1975); no shadow, no mirror, no fog.
    """
    lamp, own = section(whole, "light"), SimpleNamespace(**whole["materials"][material])
    p, n, d, at = _wide(points, normals, directions, lamp.position)
    color, emission = _wide(own.color, lamp.emission)
    to_light = at - p
    distance = np.sqrt((to_light**2).sum(-1, keepdims=True))
    to_light = to_light / distance
    facing = (n * to_light).sum(-1, keepdims=True)
    mirrored = 2 * facing * n - to_light
    shine = np.maximum(-(mirrored * d).sum(-1, keepdims=True), 0)
    lit = emission * color * np.maximum(facing, 0) / distance
    gloss = np.where(facing > 0, 0.2 * emission * shine ** L(own.shininess) / distance, 0)
    return 0.01 * color + lit + gloss


def share(wrong: Array) -> float:
    """Percent of True."""
    return 100.0 * float(np.mean(wrong))
