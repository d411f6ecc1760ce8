"""The Mandelbulb on its axis, at its origin and close up."""

from __future__ import annotations

import functools
import threading

import mpmath
import numpy as np

from study.experiments.stability.cases import Outcome, Phase
from study.experiments.stability.cases.scenes import scene, shape

BULB = {"power": 8, "iterations": 4, "bailout": 256}
FLOOR = 1e-9  # the smallest hit distance that a scene may ask for
DIGITS = 60
ALONE = threading.Lock()  # cases run in threads, and mpmath's digits are the process's
HEIGHTS = (-1.3, -1.05, -0.6, 0.25, 0.8, 1.2)
TOWARDS = ((1.0, 0.3, -0.4), (-0.2, 0.9, 0.6), (0.5, -0.7, 0.5))


def estimate(point: tuple[float, float, float]) -> tuple[mpmath.mpf, mpmath.mpf]:
    """The distance estimate and ln |w|² of the last iterate, by angles, in 60 digits.

    White and Nylander's map: lengths to the eighth power, both angles times eight; the running derivative is
    8·|w|⁷·dz + 1 from 1.5, and the estimate ¼·ln|w|²·|w|/dz.
    """
    with mpmath.workdps(DIGITS):
        c = [mpmath.mpf(x) for x in point]
        w, dz = c, mpmath.mpf(1.5)
        m = mpmath.fsum(x * x for x in w)
        for _ in range(BULB["iterations"]):
            r, ring = mpmath.sqrt(m), mpmath.hypot(w[0], w[2])
            polar = 8 * mpmath.atan2(ring, w[1])
            around = 8 * mpmath.atan2(w[0], w[2]) if ring else mpmath.mpf(0)
            dz = 8 * r**7 * dz + 1
            s = mpmath.sin(polar) if ring else mpmath.mpf(0)
            turned = (s * mpmath.sin(around), mpmath.cos(polar), s * mpmath.cos(around))
            w = [c[i] + r**8 * turned[i] for i in range(3)]
            m = mpmath.fsum(x * x for x in w)
            if m > BULB["bailout"]:
                break
        if not m:
            return mpmath.mpf(0), -mpmath.inf
        return mpmath.log(m) * mpmath.sqrt(m) / dz / 4, mpmath.log(m)


@functools.cache
def on_surface(towards: tuple[float, float, float]) -> tuple[mpmath.mpf, ...]:
    """Where the ray from outside along −towards first has |w| = 1 (bisection, 40 digits)."""
    with mpmath.workdps(DIGITS):
        u = [mpmath.mpf(x) for x in towards]
        unit = [x / mpmath.sqrt(mpmath.fsum(y * y for y in u)) for x in u]
        out = mpmath.mpf(1.5)
        while estimate(tuple(out * x for x in unit))[1] > 0:
            out -= mpmath.mpf(1) / 64
        inner, outer = out, out + mpmath.mpf(1) / 64
        for _ in range(130):
            middle = (inner + outer) / 2
            if estimate(tuple(middle * x for x in unit))[1] > 0:
                outer = middle
            else:
                inner = middle
        return tuple(outer * x for x in unit)


@functools.cache
def _truth(k: float) -> tuple[np.ndarray, np.ndarray]:
    """Points beside the axis, about the origin, and over the surface, each 2^−k off; and their estimates."""
    off = 2.0**-k
    points = [(off, y, 0.7 * off) for y in HEIGHTS]
    points += [(0.3 * off, 0.5 * off, -0.4 * off), (off, 0.0, 0.0), (0.0, -off, 0.0), (off, off, off)]
    with mpmath.workdps(DIGITS):
        for towards in TOWARDS:
            surface = on_surface(towards)
            length = mpmath.sqrt(mpmath.fsum(x * x for x in surface))
            points.append(tuple(float(x * (1 + mpmath.mpf(off) / length)) for x in surface))
    return np.array(points), np.array([float(estimate(p)[0]) for p in points])


def truth(k: float) -> tuple[np.ndarray, np.ndarray]:
    with ALONE:
        return _truth(k)


def run(phase: Phase, strength: float) -> Outcome:
    points, known = truth(strength)
    got = phase.distances(scene([shape("mandelbulb", **BULB)]), points)
    off = np.abs(got - known) / np.maximum(np.abs(known), FLOOR)
    off[~np.isfinite(got)] = np.nan
    groups = {"axis": off[:6], "origin": off[6:10], "surface": off[10:]}
    return Outcome(
        float(np.max(off)), note=", ".join(f"{k} {np.max(v):.1e}" for k, v in groups.items()) + " relative"
    )
