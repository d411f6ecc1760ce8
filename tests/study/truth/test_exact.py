"""The exact oracle: cases known by hand or in closed form, and what it refuses."""

from __future__ import annotations

import math
from fractions import Fraction

import enclosures
import mpmath
import pytest
from exact_scenes import BALL, CONE, CUBE, STAR, TORUS, one, several

from study.core.cli import StudyError
from study.truth import exact

OFF = Fraction(1, 2**200)  # far beyond double's reach


@pytest.mark.parametrize(
    "shape, origin, direction, s",
    [
        ({"kind": "sphere", "radius": 1}, (0, 0, -5), (0, 0, 1), 4),
        ({"kind": "sphere", "radius": 1}, (0, 0, -5), (0, 0, 8), 0.5),
        ({"kind": "sphere", "radius": 1}, (0, 1, -5), (0, 0, 1), 5),  # touches
        ({"kind": "sphere", "radius": 1}, (0, 1 + OFF, -5), (0, 0, 1), None),
        ({"kind": "sphere", "radius": 1}, (0, 0, 5), (0, 0, 1), None),  # behind
        ({"kind": "sphere", "radius": 1}, (0, 0, 0.5), (0, 0, 1), 0.5),  # from inside
        ({"kind": "sphere", "radius": 1}, (0, 0, 1), (0, 0, 1), 0),  # from the surface
        ({"kind": "sphere", "radius": 5}, (-7, 4, 0), (1, 0, 0), 4),
        ({"kind": "plane", "normal": [0, 2, 0], "offset": 3}, (0, 4, 0), (1, -1, 0), 2.5),
        ({"kind": "plane", "normal": [0, 2, 0], "offset": 3}, (0, 4, 0), (1, 0, 0), None),
        ({"kind": "plane", "normal": [0, 2, 0], "offset": 3}, (0, 1.5, 0), (1, 0, 0), 0),
        (CUBE, (-3, -3, 0), (1, 1, 0), 2),  # onto an edge
        (CUBE, (-3, -1, 0), (1, 0, 0), 2),  # along a face
        (CUBE, (-3, -1 - OFF, 0), (1, 0, 0), None),
        (CUBE, (0, -1, 0), (1, 0, 0), 0),  # from a face, along it
        (CUBE, (-2, 0, 0), (1, 1, 0), 1),  # touches an edge
        (CUBE, (-2, OFF, 0), (1, 1, 0), None),
        (CUBE, (-3, -3, -3), (1, 1, 1), 2),  # onto a corner
        (STAR, (-3, 0, 0), (1, 0, 0), 2),  # onto a vertex
        (STAR, (-3, 1, 0), (1, 0, 0), 3),  # past another one
        (STAR, (-3, 1 + OFF, 0), (1, 0, 0), None),
        (STAR, (-2, -2, -2), (4, 4, 4), (2 - Fraction(1, 3)) / 4),
        (CONE, (0, 0, 0), (0, 0, 1), 1.5),
        (CONE, (0, 5, 0), (0, -1, 0), 3),
        (CONE, (5, 2, 0), (-1, 0, 0), 3),  # along the upper disc
        (CONE, (1, -5, 0), (0, 1, 0), 3),  # onto the lower rim
        (CONE, (2, -5, 0), (0, 1, 0), 7),  # touches the upper rim
        (CONE, (2 + OFF, -5, 0), (0, 1, 0), None),
        (TORUS, (0, 0, -5), (0, 0, 1), 3.75),
        (TORUS, (0, 0, 0), (0, 0, 1), 0.75),
        (TORUS, (0, 5, 0), (0, -1, 0), None),  # through the hole
        (TORUS, (0.75, -5, 0), (0, 1, 0), 5),  # touches the hole's rim
        (TORUS, (Fraction(3, 4) - OFF, -5, 0), (0, 1, 0), None),
        (TORUS, (0, 0.25, -5), (0, 0, 1), 4),  # touches the top twice
        (TORUS, (0, Fraction(1, 4) + OFF, -5), (0, 0, 1), None),
        ({"kind": "torus", "major_radius": 1, "minor_radius": 2}, (0, 0, 0), (0, 0, 1), 3),  # no hole
    ],
)
def test_known(shape, origin, direction, s):
    found = exact.first_hit(one(**shape), origin, direction)
    if s is None:
        assert found == exact.First("miss")
    else:
        assert (found.status, found.shape) == ("hit", 0)
        assert found.low <= s <= found.high and found.high - found.low <= Fraction(1e-15) * found.low


@pytest.mark.parametrize("k", [10, 52, 60, 300])
@pytest.mark.parametrize("angles", [[0, 0, 0], [10, 20, 30]])
def test_a_hair_beside_the_silhouette(k, angles):
    """b = R(1 ± 2⁻ᵏ): s = d − R·√(1 − (1 − 2⁻ᵏ)²), or nothing. Turning a sphere changes nothing."""
    ball, hair = one("sphere", radius=1, rotation_degrees=angles), Fraction(1, 2**k)
    assert exact.first_hit(ball, (0, 1 + hair, -8), (0, 0, 1)).status == "miss"
    found = exact.first_hit(ball, (0, 1 - hair, -8), (0, 0, 1))
    with mpmath.workdps(300):
        s = 8 - mpmath.sqrt(1 - (1 - mpmath.mpf(2) ** -k) ** 2)
        low, high = (mpmath.mpf(x.numerator) / x.denominator for x in (found.low, found.high))
        assert low <= s <= high and high - low < 1e-14


def test_a_tie_is_never_guessed():
    ball = {"type": "sphere", "radius": 1, "rotation_degrees": [10, 20, 30]}
    assert exact.first_hit(several(ball), (0, 1, -5), (0, 0, 1)).status == "undecided"
    # Turned by 45°, the edge towards the ray is a tie of two faces, but where it lies is known.
    found = exact.first_hit(one(**CUBE, rotation_degrees=[0, 45, 0]), (0, 0, -5), (0, 0, 1))
    assert float(found.low) == pytest.approx(5 - math.sqrt(2), rel=1e-15)


def test_the_first_of_equals():
    other = {"type": "box", "half_size": [1, 1, 1]}
    for shapes in ((BALL, other), (other, BALL)):
        assert exact.first_hit(several(*shapes), (0, 0, -5), (0, 0, 1)).shape == 0
    # Irrational and equal: √2 − … of two spheres through the same circle.
    twins = {**BALL, "position": [-0.5, 0, 0]}, {**BALL, "position": [0.5, 0, 0]}
    for pair in (twins, twins[::-1]):
        found = exact.first_hit(several(*pair), (0, 0.25, -5), (0, 0, 1))
        assert (found.status, found.shape) == ("hit", 0)


def test_a_touch_behind_is_behind():
    ahead = {**BALL, "position": [0, 1, 9]}
    found = exact.first_hit(several(BALL, ahead), (0, 1, 3), (0, 0, 1))
    assert (found.shape, found.low) == (1, 5)


def test_from_inside_the_union_is_left():
    chain = [{**BALL, "position": [x, 0, 0]} for x in (3.0, 1.5, 0.0)]
    found = exact.first_hit(several(*chain), (0, 0, 0), (1, 0, 0))
    assert (found.shape, found.low) == (0, 4)
    # Within a face of one box, out of another: both end the union.
    boxes = [{"type": "box", "half_size": [1, 1, 1], "position": p} for p in ([0, 0, 0], [1, 1, 0])]
    assert exact.first_hit(several(*boxes), (-0.5, 0, 0), (1, 0, 0)).low == Fraction(3, 2)
    # Two boxes that share a face: the distance is zero there.
    boxes = [{"type": "box", "half_size": [1, 1, 1], "position": [x, 0, 0]} for x in (0, 2)]
    assert exact.first_hit(several(*boxes), (0, 0, 0), (1, 0, 0)).low == 1


def test_repetition_and_bounds():
    data = enclosures.scene("sphere")
    data["shapes"] = [{**BALL, "repeat": [4, 4, 4]}]
    data["march"]["bounds_radius"] = 20
    balls = exact.Scene.of(data)
    assert exact.first_hit(balls, (2, 2, 0), (0, 0, 1)).status == "miss"  # between the copies
    assert exact.first_hit(balls, (2, 2, 2), (1, 1, 1)).low == pytest.approx(2 - 1 / math.sqrt(3))
    assert exact.first_hit(balls, (2, 0, -2), (0, 0, 1)).status == "miss"
    assert exact.first_hit(balls, (0, 0, 2), (0, 0, 1)).low == 1
    # Across more than its cell: the next copy begins at the wall, and all is one solid.
    data["shapes"] = [{**BALL, "radius": 3, "repeat": [4, 4, 4]}]
    found = exact.first_hit(exact.Scene.of(data), (0, 0, 0), (0, 0, 1))
    assert found.status == "miss"
    data["shapes"] = [BALL]
    data["march"]["bounds_radius"] = 3
    ball = exact.Scene.of(data)
    assert exact.first_hit(ball, (0, 0, -3), (0, 0, 1)).low == 2
    assert exact.first_hit(ball, (0, 0, -4), (0, 0, 1)).low == 3  # its first step ends inside, at −1
    assert exact.first_hit(ball, (0, 0.99, -4), (0, 0, 1)).status == "hit"
    # The same ray is over when something beside it keeps the first step short of the bounds.
    data["shapes"] = [BALL, {**BALL, "radius": 0.1, "position": [1, 0, -4.9]}]
    assert exact.first_hit(exact.Scene.of(data), (0, 0, -4.9), (0, 0, 1)).status == "miss"
    data["shapes"] = [BALL, {**BALL, "radius": 0.1, "position": [2.1, 0, -4.9]}]
    assert exact.first_hit(exact.Scene.of(data), (0, 0, -4.9), (0, 0, 1)).shape == 0
    data["shapes"] = [BALL]
    data["march"]["bounds_radius"] = 0.5
    assert exact.first_hit(exact.Scene.of(data), (0, 0, -0.25), (0, 0, 1)).status == "miss"


@pytest.mark.parametrize(
    "origin, direction",
    [((0, 0, 0), (0, 0, 0)), ((math.nan, 0, 0), (0, 0, 1)), ((0, 0, 0), (math.inf, 0, 1))],
)
def test_what_is_no_ray_is_refused(origin, direction):
    with pytest.raises(StudyError, match="finite"):
        exact.first_hit(several(BALL), origin, direction)


def test_a_fractal_has_no_exact_truth():
    with pytest.raises(StudyError, match="mandelbulb"):
        several({"type": "mandelbulb", "power": 8, "iterations": 4, "bailout": 100})
    with pytest.raises(StudyError, match="mandelbox"):
        several({"type": "mandelbox", "scale": -1.5})
