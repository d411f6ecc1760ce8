"""Hard cases by number, and first hits of rays held against distances from geometry."""

import mpmath
import numpy as np
import pytest

from conformance import geometry
from study.experiments.stability.cases import Case, find_cases
from study.experiments.stability.cases.scenes import rays

mpmath.mp.dps = 60


def of(number: int) -> Case:
    return find_cases([str(number)])[0]


def strengths(name: str, number: int) -> pytest.MarkDecorator:
    return pytest.mark.parametrize(name, of(number).strengths)


def on_ray(origin: np.ndarray, directions: np.ndarray, t: np.ndarray) -> np.ndarray:
    return (origin + t[..., None] * directions).reshape(-1, 3).astype(float)


def first_hit_holds(
    whole: dict, size: tuple[int, int], t: np.ndarray, scale: float = 1, reach: float = 50
) -> None:
    """Asserts that t ends on the surface with nothing before it, and that a ray without meets none so far."""
    origin, directions = rays(whole, size)
    t = t.reshape(-1).astype(float)
    directions = directions.reshape(-1, 3)
    hit = np.isfinite(t)
    if hit.any():
        there = geometry.scene_distance(on_ray(origin, directions[hit], t[hit]), whole)
        assert np.abs(there).max() < 1e-12 * scale
    for share in np.linspace(0, 0.999, 200):
        before = geometry.scene_distance(
            on_ray(origin, directions, share * np.where(hit, t, reach * scale)), whole
        )
        assert (before > -1e-12 * scale).all(), f"something lies before the first hit, at {share} of the way"
