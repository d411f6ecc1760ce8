"""Hard cases of fields: one that is no distance, and the Mandelbulb's estimate where its angles are lost."""

import functools
import threading

import mpmath
import numpy as np

from study.experiments.stability.cases import Outcome, Phase, exact
from study.experiments.stability.cases.scenes import ball, eye, rays, scene, shape

DIGITS = 60
ALONE = threading.Lock()  # cases run in threads, and mpmath's digits are the process's

# 13: a field that grows faster than the distance
LIPSCHITZ_SIZE, MOST_STEPS, HIT, DEEP = (12, 12), 120, 1e-6, 1e-3
HALF, PLACE = [1.5, 1.5, 0.01], [0, 0, 2]  # of a plate behind a ball


@functools.cache
def first_hits() -> tuple[dict, np.ndarray, np.ndarray, np.ndarray]:
    """Scene, origin, directions (rays, 3) and first hits (rays)."""
    plate = shape("box", half_size=HALF, position=PLACE)
    whole = scene([ball(1), plate], camera=eye([0, 0, -5], [0, 0, 0], 20))
    origin, directions = rays(whole, LIPSCHITZ_SIZE)
    directions = directions.reshape(-1, 3)
    hits = exact.sphere(origin, directions, [0, 0, 0], 1), exact.box(origin, directions, PLACE, HALF)
    return whole, origin, directions, exact.nearest(*hits)[0].astype(float)


def march(phase: Phase, scale: float) -> np.ndarray:
    """t at which sphere tracing of scale·f ends, +inf for a miss: what a renderer would do with it."""
    whole, origin, directions, _ = first_hits()
    t, end = np.zeros(len(directions)), np.full(len(directions), np.inf)
    active = np.arange(len(directions))
    for _ in range(MOST_STEPS):
        step = scale * phase.distances(whole, origin + t[active, None] * directions[active])
        t[active] += step
        there = step < HIT
        end[active[there]] = t[active[there]]
        active = active[~there & (t[active] < 20)]
        if not len(active):
            break
    return end


def c13_no_lipschitz_bound(phase: Phase, strength: float) -> Outcome:
    known, end = first_hits()[3], march(phase, strength)
    hits = np.isfinite(known)
    through = int((hits & ~np.isfinite(end)).sum())
    late = ~(end[hits] - known[hits] <= DEEP)
    return Outcome(exact.share(late), note=f"{through} rays pass through a shape" * bool(through))


# 14: the Mandelbulb on its axis, at its origin and close up
ITERATIONS, BAILOUT = 4, 256
BULB = shape("mandelbulb", power=8, iterations=ITERATIONS, bailout=BAILOUT)
FLOOR = 1e-9  # the smallest hit distance that a scene may ask for
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
        for _ in range(ITERATIONS):
            r, ring = mpmath.sqrt(m), mpmath.hypot(w[0], w[2])
            polar = 8 * mpmath.atan2(ring, w[1])
            around = 8 * mpmath.atan2(w[0], w[2]) if ring else mpmath.mpf(0)
            dz = 8 * r**7 * dz + 1
            s = mpmath.sin(polar) if ring else mpmath.mpf(0)
            turned = (s * mpmath.sin(around), mpmath.cos(polar), s * mpmath.cos(around))
            w = [c[i] + r**8 * turned[i] for i in range(3)]
            m = mpmath.fsum(x * x for x in w)
            if m > BAILOUT:
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
def _estimates(k: float) -> tuple[np.ndarray, np.ndarray]:
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


def estimates(k: float) -> tuple[np.ndarray, np.ndarray]:
    with ALONE:
        return _estimates(k)


def c14_mandelbulb_poles(phase: Phase, strength: float) -> Outcome:
    points, known = estimates(strength)
    got = phase.distances(scene([BULB]), points)
    off = np.abs(got - known) / np.maximum(np.abs(known), FLOOR)
    off[~np.isfinite(got)] = np.nan
    groups = {"axis": off[:6], "origin": off[6:10], "surface": off[10:]}
    note = ", ".join(f"{k} {np.max(v):.1e}" for k, v in groups.items())
    return Outcome(float(np.max(off)), note=f"{note} relative")
