"""Distances of every phase against geometry (conformance/geometry.py), and as 1-Lipschitz functions."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from conformance import geometry
from conformance.feature_scenes import FEATURES, FRACTALS, SIZES, scene, shape
from conformance.harness import PHASES, REDUCED, Unsupported, call, check_refusal, distances, keep
from study.core import registry


def has_own(phase: registry.Phase) -> bool:
    """A derived phase has the distance functions of its parent, unless it leaves out its parent's march."""
    return not phase.derives or "march/march.c" in phase.without


OWN = [name for name in PHASES if has_own(registry.phases()[name])]
pytestmark = pytest.mark.parametrize("phase", OWN)

EXACT = [kind for kind in SIZES if kind not in FRACTALS]  # theirs are estimates, no distances
COUNT = 300 if REDUCED else 3000


def roundoff(phase: str) -> float:
    """Spacing of the phase's numbers at 1."""
    return 2.0**-52 if registry.phases()[phase].precision == "double" else 2.0**-23


def probe(phase: str, whole: dict, points: np.ndarray, name: str) -> tuple[np.ndarray, np.ndarray, str]:
    """Distance, nearest shape, and what to say of the scene and the phase in a failure."""
    path = keep(name, whole)
    if not draws_everything(phase):
        refused_or_drawn(phase, path)
    return *distances(phase, path, points), f"{phase}, {path}"


def refused_or_drawn(phase: str, path: Path) -> None:
    """Raises Unsupported if the phase refuses the scene, properly."""
    run = call(phase, path, "-n", 1)
    if run.status == 4:
        check_refusal(run, 4)
        raise Unsupported(run.stderr.strip())


@functools.cache
def draws_everything(phase: str) -> bool:
    """Whether it need not be asked of each scene. (One refused after all would be off.)"""
    try:
        refused_or_drawn(phase, keep("everything", FEATURES["everything"]))
    except Unsupported:
        return False
    return True


def extent(whole: dict, points: np.ndarray) -> np.ndarray:
    """Per point the size of the numbers that make up its distances: coordinates and sizes."""
    sizes = [np.abs(np.ravel(v)).max() for s in whole["shapes"] for v in s.values() if not isinstance(v, str)]
    return np.linalg.norm(points, axis=1) + max(sizes, default=0)


def random_sizes(kind: str, random: np.random.Generator) -> dict:
    """Other sizes of the same shape, each between a third and three times its own."""
    sizes = {}
    for key, value in SIZES[kind].items():
        scaled = np.array(value) * 3 ** random.uniform(-1, 1, np.shape(value))
        sizes[key] = scaled.tolist() if np.ndim(scaled) else float(scaled)
    return sizes


def points_around(random: np.random.Generator, whole: dict, count: int = COUNT) -> np.ndarray:
    """Far, near, and right at the surface of the scene, as float32 so that no phase rounds them."""
    far = random.uniform(-20, 20, (count // 3, 3))
    near = random.uniform(-3, 3, (count - count // 3, 3))
    # a step along the gradient, from differences, lands near the surface
    at = near[: count // 3]
    steps = np.eye(3) * 1e-4
    here = geometry.scene_distance(at, whole)
    slope = np.array([(geometry.scene_distance(at + step, whole) - here) / 1e-4 for step in steps]).T
    near[: count // 3] = at - here[:, None] * slope
    return np.concatenate([far, near]).astype(np.float32).astype(float)


@dataclass(frozen=True)
class Case:
    """A scene, points, and what geometry says there: worked out once for all phases."""

    name: str
    whole: dict
    points: np.ndarray
    every: np.ndarray  # each shape's distance at each point
    usable: np.ndarray  # not on the border between two cells, where either is right
    extent: np.ndarray


def case(name: str, whole: dict, points: np.ndarray) -> Case:
    every = np.array([geometry.shape_distance(points, s) for s in whole["shapes"]])
    usable = np.ones(len(points), bool)
    for s in whole["shapes"]:
        local = (points - s.get("position", [0, 0, 0])) @ geometry.rotation(
            s.get("rotation_degrees", [0, 0, 0])
        ).T
        for axis, cell in enumerate(s.get("repeat", [0, 0, 0])):
            if cell > 0:
                usable &= np.abs((local[:, axis] / cell + 0.5) % 1 - 0.5) < 0.5 - 1e-4
    return Case(name, whole, points, every, usable, extent(whole, points))


def check_distances(phase: str, one: Case) -> None:
    points, every, usable = one.points, one.every, one.usable
    found, nearest, where = probe(phase, one.whole, points, one.name)
    # 32 roundings of the coordinates: three rotations of two products each, then a few squares and a root
    tolerance = 32 * roundoff(phase) * one.extent
    off = np.abs(found - every.min(axis=0))
    worst = int(np.argmax(np.where(usable, off / tolerance, 0)))
    assert not (usable & ~(off <= tolerance)).any(), (
        f"{where}: at {points[worst].tolist()} {found[worst]!r}, geometry says {every.min(axis=0)[worst]!r}"
    )
    own = np.take_along_axis(every, nearest[None], axis=0)[0]
    wrong = usable & ~(own - every.min(axis=0) <= tolerance)
    assert not wrong.any(), (
        f"{where}: at {points[wrong][0].tolist()} shape {nearest[wrong][0]} is not the nearest"
    )


@functools.cache
def of_sizes(kind: str) -> list[Case]:
    random, cases = np.random.default_rng(1), []
    for i in range(3):
        whole = scene([shape(kind, **(random_sizes(kind, random) if i else {}))])
        cases.append(case(f"distance_{kind}_{i}", whole, points_around(random, whole)))
    return cases


@pytest.mark.parametrize("kind", EXACT)
def test_shape(phase: str, kind: str) -> None:
    for one in of_sizes(kind):
        check_distances(phase, one)


@functools.cache
def special(kind: str) -> Case:
    grid = np.array([-1.5, -1.2, -0.9, -0.7, -0.4, -0.0, 0.0, 0.4, 0.7, 0.9, 1.2, 1.5], np.float32)
    tiny = np.array([-1e-30, -1e-7, 0, 1e-7, 1e-30, 1])
    points = [np.array(np.meshgrid(axis, axis, axis)).reshape(3, -1).T for axis in (grid.astype(float), tiny)]
    return case(f"special_{kind}", scene([shape(kind)]), np.concatenate(points))


@pytest.mark.parametrize("kind", EXACT)
def test_special_points(phase: str, kind: str) -> None:
    """Centre, axes, edges, corners: where formulas divide by zero or change their case."""
    check_distances(phase, special(kind))


@functools.cache
def placed_in_cells(kind: str) -> list[Case]:
    random, cases = np.random.default_rng(2), []
    for i, cells in enumerate([[0, 0, 0], [9, 0, 0], [0, 8, 0], [0, 0, 7.5], [9, 8, 7.5]]):
        degrees = random.uniform(-180, 180, 3) if i != 1 else np.array([0, 33, 0])
        placed = shape(
            kind, repeat=cells, rotation_degrees=degrees.tolist(), position=random.uniform(-2, 2, 3).tolist()
        )
        whole = scene([placed])
        cases.append(case(f"placed_{kind}_{i}", whole, points_around(random, whole)))
    return cases


@pytest.mark.parametrize("kind", EXACT)
def test_placed(phase: str, kind: str) -> None:
    """Translation, then rotation about x, y and z in turn, then repetition."""
    for one in placed_in_cells(kind):
        check_distances(phase, one)


@functools.cache
def of_many(name: str) -> Case:
    return case(name, FEATURES[name], points_around(np.random.default_rng(4), FEATURES[name]))


MANY = ["shapes_64", "shapes_64_turned", "shapes_overlap", "shapes_same_place"]


@pytest.mark.parametrize("name", [*MANY, "rounded", "rounded_turned_repeated"])
def test_many_shapes(phase: str, name: str) -> None:
    check_distances(phase, of_many(name))


def bulb_points(random: np.random.Generator) -> np.ndarray:
    near = random.uniform(-1.3, 1.3, (COUNT, 3))
    far = random.uniform(-5, 5, (COUNT // 4, 3))
    axis = random.uniform(-1.3, 1.3, (COUNT // 4, 3)) * [[1, 10**9, 1]] * 1e-9
    points = np.concatenate([near, far, axis, np.array([[0, 0.5, 0], [0, -1.1, 0], [0, 3, 0]])])
    return points.astype(np.float32).astype(float)


@functools.cache
def bulb_answers(iterations: int, bailout: float, unit: float) -> tuple[np.ndarray, ...]:
    """Points, their distances, how far noise of that unit roundoff moves them, and where it leaves the
    number of turns alone: the same for every phase of that precision."""
    bulb = shape("mandelbulb", iterations=iterations, bailout=bailout)
    points = bulb_points(np.random.default_rng(5))
    exact, margin = geometry.mandelbulb(points, bulb)
    noisy = [geometry.mandelbulb(points, bulb, unit, seed) for seed in range(8)]
    spread = np.max([np.abs(estimate - exact) for estimate, _ in noisy], axis=0)
    # where rounding decides whether there is another turn, two answers are right
    margins = np.array([m for _, m in noisy])
    return points, exact, spread, (margin > 10 * np.ptp(margins, axis=0)) & (margin > 1e3 * unit)


@pytest.mark.parametrize("iterations, bailout", [(1, 256), (4, 256), (7, 256), (4, 4)])
def test_mandelbulb(phase: str, iterations: int, bailout: float) -> None:
    """Against the map by angles in 80-bit floats, within what rounding of the phase's size can do.

    The map multiplies rounding errors at every turn, more than a thousandfold where it is chaotic. What they
    come to at a point is measured: the map again with noise of one unit roundoff at every turn.
    """
    bulb = shape("mandelbulb", iterations=iterations, bailout=bailout)
    points, exact, spread, decided = bulb_answers(iterations, bailout, roundoff(phase))
    found, _, where = probe(phase, scene([bulb]), points, f"distance_mandelbulb_{iterations}_{bailout}")
    assert np.isfinite(found).all(), f"{where}: at {points[~np.isfinite(found)][0].tolist()} not finite"
    assert decided.mean() > 0.8, f"{where}: only {decided.mean():.2f} of the points tell anything"
    tolerance = 16 * spread + 16 * roundoff(phase) * (np.abs(exact) + 1e-3)
    off = np.abs(found - exact)
    wrong = decided & ~(off <= tolerance)
    worst = int(np.argmax(np.where(decided, off / tolerance, 0)))
    assert not wrong.any(), (
        f"{where}: {wrong.sum()} of {len(points)} points, worst at {points[worst].tolist()}: "
        f"{found[worst]!r} for {exact[worst]!r}, tolerance {tolerance[worst]:.2e}"
    )


def test_mandelbulb_at_its_poles(phase: str) -> None:
    """On the axis, at the origin and far away the formula divides, takes logarithms and overflows: finite."""
    tiny = np.array([0, -0.0, 1e-300, -1e-200, 1e-160, 1e-45, -1e-38, 1e-20, 1e-12, 1e-6, 1e-4, 1e-3])
    points = np.array(np.meshgrid(tiny, [0, 1e-300, 1e-9, 0.7, -1.1, 3, 90], tiny)).reshape(3, -1).T
    points = np.concatenate([points, np.eye(3) * 100, -np.eye(3) * 1000, np.eye(3) * 1e5])
    for iterations in (1, 4, 9):
        whole = scene([shape("mandelbulb", iterations=iterations)])
        found, _, where = probe(phase, whole, points, f"poles_{iterations}")
        assert np.isfinite(found).all(), f"{where}: at {points[~np.isfinite(found)][0].tolist()} not finite"
        origin = found[(points == 0).all(axis=1)]
        assert (np.abs(origin) < 1e-3).all(), f"{where}: {origin[0]!r} at the origin, where √m·ln m is 0"


BOXES = {
    "negative": {},
    "two": {"scale": 2, "iterations": 12},
    "other radii": {"scale": -2.5, "fold_limit": 0.7, "minimum_radius": 0.2, "fixed_radius": 1.3},
    "no inversion": {"minimum_radius": 1, "scale": 1.5},
    "shrinking": {"scale": -0.5, "iterations": 40},
}


@functools.cache
def box_answers(name: str, unit: float) -> tuple[np.ndarray, ...]:
    """Points, their distances, and how far noise of that unit roundoff moves them."""
    random, box = np.random.default_rng(6), shape("mandelbox", **BOXES[name])
    near = random.uniform(-2.3, 2.3, (COUNT, 3))
    far = random.uniform(-30, 30, (COUNT // 4, 3))
    border = np.array([-2, -1, -0.5, 0, 0.25, 0.5, 1, 1.5, 2, 3])  # where the map changes its case
    grid = np.array(np.meshgrid(border, border, border)).reshape(3, -1).T
    points = np.concatenate([near, far, grid]).astype(np.float32).astype(float)
    exact = geometry.mandelbox(points, box)
    noisy = [geometry.mandelbox(points, box, unit, seed) for seed in range(8)]
    return points, exact, np.max([np.abs(estimate - exact) for estimate in noisy], axis=0)


@pytest.mark.parametrize("name", BOXES)
def test_mandelbox(phase: str, name: str) -> None:
    """Against reflections and inversions in 80-bit floats, within what rounding can do."""
    points, exact, spread = box_answers(name, roundoff(phase))
    whole = scene([shape("mandelbox", **BOXES[name])])
    found, _, where = probe(phase, whole, points, f"distance_mandelbox_{name.replace(' ', '_')}")
    tolerance = 16 * spread + 16 * roundoff(phase) * (np.abs(exact) + 1e-3)
    off = np.abs(found - exact)
    worst = int(np.argmax(off / tolerance))
    assert (off <= tolerance).all(), (
        f"{where}: {(~(off <= tolerance)).sum()} of {len(points)} points, worst at {points[worst].tolist()}: "
        f"{found[worst]!r} for {exact[worst]!r}, tolerance {tolerance[worst]:.2e}"
    )


# What the scene's reader lets through at most: scale and iterations, radii, and both.
FURTHEST = [
    {"scale": 1e6, "iterations": 1},
    {"scale": -10, "iterations": 6, "fixed_radius": 1e9, "minimum_radius": 1.1e7, "fold_limit": 1e9},
    {"scale": 1, "iterations": 100, "minimum_radius": 1, "fold_limit": 1e-9},
]


def test_mandelbox_is_finite(phase: str) -> None:
    """At the centre, on the axes, and further away than any ray goes."""
    axes = [np.eye(3) * x for x in (0, 1e-30, 1, -2, 100, -1e5, 1e9)]
    points = np.concatenate([*axes, np.full((1, 3), 1e9)])
    for i, sizes in enumerate(FURTHEST):
        found, _, where = probe(phase, scene([shape("mandelbox", **sizes)]), points, f"mandelbox_finite_{i}")
        assert np.isfinite(found).all() and (found >= 0).all(), f"{where}: {found.tolist()}"
