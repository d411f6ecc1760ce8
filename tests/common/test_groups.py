"""Groups beside what phases draw of them: the smooth minimum, and scenes that are refused."""

from __future__ import annotations

import itertools
import random

import numpy as np
import pytest

from conformance.feature_scenes import scene, shape
from conformance.group_scenes import group, made
from conformance.harness import PHASES, REFERENCE, call, check_refusal, distances, keep
from study.core import generated_scenes, registry

NO_GROUPS = [name for name in PHASES if not registry.phases()[name].groups]


def balls(count: int, seed: int) -> list[dict]:
    draw = random.Random(seed)
    place = [[draw.uniform(-1, 1) for _ in range(3)] for _ in range(count)]
    return [made("sphere", radius=draw.uniform(0.3, 0.8), position=at) for at in place]


def probed(shapes: list[dict], k: float, points: np.ndarray, operation: str = "union") -> np.ndarray:
    whole = scene([group(operation, *shapes, blend=k)])
    return distances(REFERENCE, keep("smooth_minimum", whole), points)[0]


def of_each(shapes: list[dict], points: np.ndarray) -> np.ndarray:
    """The distances (children, points) of spheres."""
    return np.array([np.linalg.norm(points - s["position"], axis=1) - s["radius"] for s in shapes])


def least_by_supports(d: np.ndarray, k: float) -> float:
    """The quadratic programme by its definition: over each set of children that may have a part, the
    stationary weights; of those that are not negative the least value."""
    values = []
    for size in range(1, len(d) + 1):
        for some in itertools.combinations(d, size):
            weights = ((k + sum(some)) / size - np.array(some)) / k
            if (weights >= 0).all():
                values.append(weights @ some + k / 2 * (weights @ weights - 1))
    return min(values)


POINTS = np.random.default_rng(3).uniform(-2, 2, (60, 3))


@pytest.mark.parametrize("count", [1, 2, 5])
@pytest.mark.parametrize("k", [0.05, 0.7, 5.0])
def test_smooth_minimum_is_the_least_of_its_programme(count: int, k: float) -> None:
    shapes = balls(count, 10 * count)
    d = of_each(shapes, POINTS)
    found = probed(shapes, k, POINTS)
    expected = [least_by_supports(column, k) for column in d.T]
    assert np.allclose(found, expected, rtol=0, atol=1e-13)
    d[0] = -d[0]  # a difference is −smin(−d₁, d₂, …)
    expected = [-least_by_supports(column, k) for column in d.T]
    assert np.allclose(probed(shapes, k, POINTS, "difference"), expected, rtol=0, atol=1e-13)


def test_of_two_it_is_quilezs() -> None:
    """I. Quilez, "smooth minimum": the quadratic polynomial."""
    shapes, k = balls(2, 1), 0.6
    a, b = of_each(shapes, POINTS)
    quilez = np.minimum(a, b) - np.maximum(k - np.abs(a - b), 0) ** 2 / (4 * k)
    assert np.allclose(probed(shapes, k, POINTS), quilez, rtol=0, atol=1e-13)


def test_order_does_not_matter_nor_does_what_is_far() -> None:
    """Children in any order; and without those that are farther than the nearest by more than k."""
    shapes, k = balls(9, 4), 0.5
    found = probed(shapes, k, POINTS)
    assert np.abs(found - probed(shapes[::-1], k, POINTS)).max() < 1e-14
    d = of_each(shapes, POINTS[:5])
    for point, column in zip(POINTS[:5], d.T, strict=True):
        near = [s for s, x in zip(shapes, column, strict=True) if x <= column.min() + k]
        assert len(near) < len(shapes)
        assert abs(probed(near, k, point[None])[0] - found[POINTS.tolist().index(point.tolist())]) < 1e-14


REFUSED = {
    "a group": group("union", shape("sphere")),
    "a modifier": shape("sphere", shell=0.1),
    "a shape of groups alone": made("ellipsoid"),
}


@pytest.mark.parametrize("phase", NO_GROUPS)
def test_other_phases_say_no(phase: str) -> None:
    for one in REFUSED.values():
        check_refusal(call(phase, keep("refused_group", scene([one])), "-n", 4), 4)


def test_the_molecule_is_the_generators() -> None:
    assert registry.find_scene("molecule").data == generated_scenes.molecule(1001, 1)
