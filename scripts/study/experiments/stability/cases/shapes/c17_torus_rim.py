"""Rays that graze the rim of a torus's hole."""

from __future__ import annotations

import functools

import mpmath
import numpy as np

from study.experiments.stability.cases import Outcome, Phase
from study.experiments.stability.cases.scenes import found, rays, scene, shape, worst
from study.experiments.stability.cases.shapes import c14_mandelbulb_poles

SIZE, MAJOR, MINOR = (1, 9), 1.0, 0.4
DIGITS, REAL = 60, mpmath.mpf("1e-20")


def above(x: float) -> dict:
    """Looking straight down at the rim of the hole, x from the axis."""
    camera = {"position": [x, 3, 0], "look_at": [x, 0, 0], "up": [0, 0, 1], "vertical_fov_degrees": 1}
    return scene([shape("torus", major_radius=MAJOR, minor_radius=MINOR)], camera=camera)


def first_root(origin: np.ndarray, direction: np.ndarray) -> float:
    """The smallest t > 0 on the torus, +inf if there is none: the roots of its quartic in 60 digits."""
    with mpmath.workdps(DIGITS):
        o, d = ([mpmath.mpf(float(x)) for x in v] for v in (origin, direction))
        big, small = mpmath.mpf(MAJOR), mpmath.mpf(MINOR)
        dd, od, oo = (
            mpmath.fsum(a * b for a, b in zip(u, v, strict=True)) for u, v in ((d, d), (o, d), (o, o))
        )
        k = oo + big**2 - small**2
        flat = [d[0] ** 2 + d[2] ** 2, o[0] * d[0] + o[2] * d[2], o[0] ** 2 + o[2] ** 2]
        quartic = [
            dd**2,
            4 * dd * od,
            4 * od**2 + 2 * dd * k - 4 * big**2 * flat[0],
            4 * od * k - 8 * big**2 * flat[1],
            k**2 - 4 * big**2 * flat[2],
        ]
        roots = mpmath.polyroots(quartic[::-1], maxsteps=400, extraprec=400, asc=True)
        real = [mpmath.re(r) for r in roots if abs(mpmath.im(r)) < REAL and mpmath.re(r) > 0]
        return float(min(real)) if real else np.inf


@functools.cache
def _truth(x: float) -> np.ndarray:
    origin, directions = rays(above(x), SIZE)
    return np.array([[first_root(origin, d) for d in row] for row in directions])


def truth(x: float) -> np.ndarray:
    with c14_mandelbulb_poles.ALONE:
        return _truth(x)


def run(phase: Phase, strength: float) -> Outcome:
    wrong, dt = 0, [0.0]
    for side in (-1, 1):
        x = MAJOR - MINOR + side * 2.0**-strength
        picture, known = phase.render(above(x), SIZE), truth(x)
        hit = found(picture)
        wrong += int((hit != np.isfinite(known)).sum())
        both = hit & np.isfinite(known)
        dt.append(worst(np.abs(picture["Z"][both] - known[both])))
    return Outcome(
        100 * wrong / (2 * SIZE[0] * SIZE[1]),
        note=f"largest |Δt| of the right hits {worst(np.array(dt)):.1e}",
    )
