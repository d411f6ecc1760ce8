"""Hard cases of shapes: their known answers, computed in another way."""

import itertools
import math
from fractions import Fraction
from itertools import pairwise

import mpmath
import numpy as np
import pytest
from mpmath import mpf

from conformance import geometry
from hard.known import first_hit_holds, strengths
from study.experiments.stability.cases import fields, many, surfaces
from study.experiments.stability.cases.scenes import rays


@strengths("delta", 2)
def test_silhouette(delta: float) -> None:
    placed = surfaces.starts(delta)
    assert len(placed) == 8
    for i, (x, y, meets) in enumerate(placed):
        impact = mpmath.hypot(mpf(x), mpf(y))
        assert meets == (impact < 1) == (i % 2 == 0)
        assert abs(abs(impact - 1) / mpf(delta) - 1) < 2**-52 / delta  # δ, but for the doubles' rounding
        camera = surfaces.beside(x, y)["camera"]
        assert camera["position"][:2] == camera["look_at"][:2] == [x, y]


@strengths("cell", 9)
def test_repetition(cell: float) -> None:
    """The geometry's distances in that cell are those of the centre cell, bit for bit."""
    p, far = many.points(), np.array([cell * 4, cell * 4, 0])
    assert all(
        Fraction(x) == Fraction(a) + Fraction(b) for x, a, b in zip((p + far)[7], p[7], far, strict=True)
    )
    scene = many.lattice(0)
    for one in scene["shapes"]:
        assert np.array_equal(geometry.shape_distance(p + far, one), geometry.shape_distance(p, one))
    home, away = many.lattice(0), many.lattice(cell)
    for a, b in pairwise((home["camera"]["position"], away["camera"]["position"])):
        assert [Fraction(y) - Fraction(x) for x, y in zip(a, b, strict=True)] == [4 * cell, 4 * cell, 0]
    reach = np.linalg.norm(np.add(away["camera"]["position"], [16, 16, 16]))
    assert reach < away["march"]["bounds_radius"]


def test_overstep() -> None:
    """Against the distances of 49 single cones: the wrapped one is too large by more than 1 somewhere."""
    cone = {k: v for k, v in many.LAYERS[2].items() if k != "repeat"}
    p = many.points()
    copies = [[4 * i, 4 * j, 10] for i in range(-3, 4) for j in range(-3, 4)]
    true = np.min([geometry.shape_distance(p, cone | {"position": at}) for at in copies], axis=0)
    wrapped = geometry.shape_distance(p, many.LAYERS[2])
    over = float(np.max(np.where(wrapped > 0, wrapped - np.abs(true), 0)))
    assert math.isclose(over, many.overstep(p, wrapped), abs_tol=1e-12) and over > 1


@strengths("thickness", 10)
def test_thin_plate(thickness: float) -> None:
    """At t the geometry's distance is 0, on the way before it is not, and behind it there is the plate."""
    scene, t = surfaces.plate(thickness), surfaces.to_plate(thickness)[0]
    origin, directions = geometry.rays(scene, *surfaces.PLATE_SIZE)
    assert (
        np.abs(geometry.scene_distance((origin + t[..., None] * directions).reshape(-1, 3), scene)).max()
        < 1e-14
    )
    for share in (0.1, 0.5, 0.9, 0.999):
        assert (
            geometry.scene_distance((origin + share * t[..., None] * directions).reshape(-1, 3), scene) > 0
        ).all()
    behind = (t + thickness / 2)[..., None]
    assert (geometry.scene_distance((origin + behind * directions).reshape(-1, 3), scene) < 1e-15).all()
    ring = surfaces.wire(thickness)
    top = np.array([[1, 5 - (5 - thickness / 2), 0]])
    assert abs(geometry.scene_distance(top, ring)[0]) < 1e-15
    assert geometry.scene_distance(top + np.array([0, 1e-3, 0]), ring)[0] == pytest.approx(1e-3, rel=1e-9)


@strengths("delta", 11)
def test_edges(delta: float) -> None:
    """The spot is on the surface, flat for half of δ around with that normal, and no longer for three δ."""
    random = np.random.default_rng(11)
    for name, one, point, normal in surfaces.spots(delta):
        assert abs(geometry.shape_distance(point[None], one)[0]) < 1e-15, name
        assert math.isclose(np.linalg.norm(normal), 1, rel_tol=1e-15), name
        around = random.normal(size=(400, 3))
        around /= np.linalg.norm(around, axis=1, keepdims=True)
        around -= np.outer(np.minimum(around @ normal, 0), 2 * normal)  # to the outer side
        curved = delta**2 if "rim" in name else 0  # the cone's side
        for reach, flat in ((0.5, True), (3.0, False)):
            off = geometry.shape_distance(point + reach * delta * around, one) - reach * delta * (
                around @ normal
            )
            assert (np.abs(off).max() < curved * reach**2 + 1e-15) == flat, (name, reach)


def test_mandelbulb_against_geometry() -> None:
    """60 digits by angles against 80-bit floats by angles, where those have digits enough."""
    for k in (2, 6, 10):
        points, known = fields.estimates(k)
        other = geometry.mandelbulb(points, fields.BULB)[0]
        assert np.abs(other - known).max() < 1e-11
    points, known = fields.estimates(1000)
    assert (points[6:10] ** 2 == 0).all() and (np.abs(known[6:10]) < 1e-290).all()
    assert known[10:].max() < 1e-14, "the last points lie on the surface"


def test_torus_rim_by_distance() -> None:
    """Whether a ray meets the torus: the least of its distance along the ray, refined, in 60 digits."""
    for k, side in itertools.product((4, 19, 28), (-1, 1)):
        x = surfaces.MAJOR - surfaces.MINOR + side * 2.0**-k
        origin, directions = rays(surfaces.above(x), surfaces.RIM_SIZE)
        for row in range(surfaces.RIM_SIZE[1]):
            o, d = ([mpf(float(c)) for c in v] for v in (origin, directions[row, 0]))

            def distance(t: mpf, o=o, d=d) -> mpf:
                p = [a + t * b for a, b in zip(o, d, strict=True)]
                return mpmath.hypot(mpmath.hypot(p[0], p[2]) - surfaces.MAJOR, p[1]) - surfaces.MINOR

            low, high = mpf(2), mpf(4)  # one minimum, at the rim
            for _ in range(110):
                a, b = low + (high - low) / 3, high - (high - low) / 3
                low, high = (low, b) if distance(a) < distance(b) else (a, high)
            known = surfaces.to_rim(x)[row, 0]
            assert np.isfinite(known) == bool(distance(low) < 0), (k, side, row)
            if np.isfinite(known):
                assert abs(distance(mpf(float(known)))) < 1e-13


@pytest.mark.parametrize("ratio", [1, 2, 30])
def test_cones_of_the_column(ratio: float) -> None:
    """Ray against cone: on the surface of the nearest copy, and outside all copies before."""
    whole = many.stack(ratio)
    t = many.to_stack(ratio, (12, 12))
    assert 0.2 < np.isfinite(t).mean() < 1
    copy = {k: v for k, v in whole["shapes"][0].items() if k != "repeat"}
    union = whole | {"shapes": [copy | {"position": [0, many.STACKED * i, 0]} for i in many.COPIES]}
    first_hit_holds(union, (12, 12), t, reach=12)
