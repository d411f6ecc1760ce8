"""Bands in a soft shadow."""

from __future__ import annotations

import functools

import numpy as np

from study.experiments.stability.cases import Outcome, Phase, exact
from study.experiments.stability.cases.scenes import rays, scene, shape, worst

SIZE, RADIUS, CENTRE, LIGHT = (64, 36), 0.5, [0.0, 2.0, 0.0], [1.0, 8.0, 0.5]


def room(strength: float, shadows: str) -> dict:
    """A ball over a floor, seen from the side."""
    return scene(
        [shape("plane", normal=[0, 1, 0], offset=0), shape("sphere", radius=RADIUS, position=CENTRE)],
        light={"position": LIGHT, "shadows": shadows, "shadow_strength": strength},
        camera={"position": [0, 4, -6], "look_at": [-0.3, 0, 0], "vertical_fov_degrees": 26},
    )


def ideal(points: np.ndarray, strength: float) -> np.ndarray:
    """Clamp of the least strength·h(t)/t on the way to the light, h the distance to the ball.

    The floor's h/t is the light's height over its distance, which the ball's is below at the light itself.

    In closed form: h/t to the ball is stationary where r·|p + t·l − c| = |p − c|² − b·t, b = l·(c − p):
    squared, a quadratic in t.
    """
    p, c = points.astype(np.longdouble), np.asarray(CENTRE, np.longdouble)
    to_light = np.asarray(LIGHT, np.longdouble) - p
    reach = np.sqrt((to_light**2).sum(-1))
    unit = to_light / reach[..., None]
    b, far = ((c - p) * unit).sum(-1), ((c - p) ** 2).sum(-1)
    r = np.longdouble(RADIUS)
    qa, qb, qc = r * r - b * b, 2 * b * (far - r * r), far * (r * r - far)
    root = np.sqrt(np.maximum(qb * qb - 4 * qa * qc, 0))
    start = np.longdouble(room(strength, "soft")["march"]["surface_offset"])
    least = np.full(b.shape, np.inf, np.longdouble)
    with np.errstate(divide="ignore", invalid="ignore"):
        for t in ((-qb + root) / (2 * qa), (-qb - root) / (2 * qa), np.full(b.shape, start), reach):
            t = np.clip(np.where(np.isfinite(t), t, reach), start, reach)
            h = np.sqrt(np.maximum(t * t - 2 * b * t + far, 0)) - r
            least = np.minimum(least, h / t)
    return np.clip(strength * least, 0, 1).astype(float)


@functools.cache
def truth(strength: float) -> tuple[np.ndarray, np.ndarray]:
    """Which pixels see the floor, and its ideal shadow, 1 elsewhere."""
    origin, directions = rays(room(strength, "soft"), SIZE)
    floor = exact.plane(origin, directions, [0, 1, 0], 0)
    ball = exact.sphere(origin, directions, CENTRE, RADIUS)
    seen = np.isfinite(floor) & (floor < ball)
    points = origin + np.where(seen, floor, 1)[..., None] * directions
    return seen, np.where(seen, ideal(points, strength), 1)


def run(phase: Phase, strength: float) -> Outcome:
    seen, known = truth(strength)
    soft, bare = (phase.render(room(strength, how), SIZE)["R"].astype(float) for how in ("soft", "none"))
    ambient = 0.01 * 0.6
    got = np.where(seen, (soft - ambient) / (np.where(seen, bare, 1) - ambient), 1)
    pairs = seen[:, 1:] & seen[:, :-1]
    jump = np.abs(np.diff(got - known, axis=1))[pairs]
    return Outcome(worst(jump), note=f"largest error {worst(np.abs(got - known)[seen]):.3f}")
