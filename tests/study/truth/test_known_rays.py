"""Truth's first hits of rays whose answer is known by hand: it is that, or undecided where a hair decides."""

from __future__ import annotations

import json
import math

import enclosures
import numpy as np
import pytest

from study.core.build import build

BALL = {"type": "sphere", "radius": 1}
TORUS = {"type": "torus", "major_radius": 1, "minor_radius": 0.25}
CONE = {"type": "cone", "bottom_radius": 1, "top_radius": 2, "half_height": 2}
CUBE = {"type": "box", "half_size": [1, 1, 1]}
STAR = {"type": "octahedron", "radius": 1}
FLOOR = {"type": "plane", "normal": [0, 2, 0], "offset": 3}


@pytest.fixture
def claims(tmp_path):
    """status, id, s_lo, s_hi of rays through shapes, by build/truth/rays."""

    def ask(shapes, rays, bounds=1e9):
        data = enclosures.scene("sphere")
        data["shapes"] = [one | {"material": "white"} for one in shapes]
        data["march"]["bounds_radius"] = bounds
        path = tmp_path / "scene.json"
        path.write_text(json.dumps(data))
        return enclosures.claimed(build("truth", "rays"), path, np.array(rays, float))[:, :4]

    return ask


def holds(claim, s, shape=0):
    status, index, low, high = claim
    assert status == 2 and index == (-1 if s is None else shape), claim
    assert s is None or low - 1e-15 <= s <= high + 1e-15, claim


@pytest.mark.parametrize(
    "shape, known",
    [
        (BALL, {(0, 0, -5, 0, 0, 1): 4, (0, 0, -5, 0, 0, 8): 0.5, (0, 0, 5, 0, 0, 1): None}),
        (BALL, {(0, 0, 0.5, 0, 0, 1): 0.5, (0, 1 + 2**-52, -5, 0, 0, 1): None}),  # from inside; past it
        (BALL | {"radius": 5}, {(-7, 4, 0, 1, 0, 0): 4}),
        (FLOOR, {(0, 4, 0, 1, -1, 0): 2.5, (0, 4, 0, 1, 0, 0): None}),
        (CUBE, {(-3, -1 - 2**-52, 0, 1, 0, 0): None, (-2, 2**-52, 0, 1, 1, 0): None}),
        (STAR, {(-3, 1 + 2**-52, 0, 1, 0, 0): None, (-2, -2, -2, 4, 4, 4): (2 - 1 / 3) / 4}),
        (CONE, {(0, 0, 0, 0, 0, 1): 1.5, (0, 5, 0, 0, -1, 0): 3, (2 + 2**-51, -5, 0, 0, 1, 0): None}),
        (TORUS, {(0, 0, -5, 0, 0, 1): 3.75, (0, 0, 0, 0, 0, 1): 0.75, (0, 5, 0, 0, -1, 0): None}),
        (TORUS, {(0.75 - 2**-53, -5, 0, 0, 1, 0): None, (0, 0.25 + 2**-54, -5, 0, 0, 1): None}),
        (TORUS | {"minor_radius": 2}, {(0, 0, 0, 0, 0, 1): 3}),  # no hole
    ],
)
def test_one_shape(claims, shape, known):
    for claim, s in zip(claims([shape], list(known)), known.values(), strict=True):
        holds(claim, s)


@pytest.mark.parametrize(
    "shape, ray, s",
    [
        (BALL, (0, 1, -5, 0, 0, 1), 5),
        (BALL, (0, 0, 1, 0, 0, 1), 0),  # from the surface
        (BALL | {"rotation_degrees": [10, 20, 30]}, (0, 1, -5, 0, 0, 1), 5),
        (CUBE, (-3, -3, 0, 1, 1, 0), 2),  # onto an edge
        (CUBE, (-3, -1, 0, 1, 0, 0), 2),  # along a face
        (CUBE, (-2, 0, 0, 1, 1, 0), 1),  # touches an edge
        (CUBE | {"rotation_degrees": [0, 45, 0]}, (0, 0, -5, 0, 0, 1), 5 - math.sqrt(2)),
        (STAR, (-3, 0, 0, 1, 0, 0), 2),  # onto a vertex
        (STAR, (-3, 1, 0, 1, 0, 0), 3),  # past another one
        (CONE, (1, -5, 0, 0, 1, 0), 3),  # onto the lower rim
        (CONE, (2, -5, 0, 0, 1, 0), 7),  # touches the upper rim
        (TORUS, (0.75, -5, 0, 0, 1, 0), 5),  # touches the hole's rim
        (TORUS, (0, 0.25, -5, 0, 0, 1), 4),  # touches the top twice
    ],
)
def test_a_tie_is_never_guessed(claims, shape, ray, s):
    (claim,) = claims([shape], [ray])
    if claim[0] != 0:
        holds(claim, s)


def test_the_first_of_equals(claims):
    for shapes in ([BALL, BALL], [CUBE, CUBE], [FLOOR, FLOOR]):
        holds(claims(shapes, [(0, 5, -5, 0, -3, 3.5)])[0], claims(shapes[:1], [(0, 5, -5, 0, -3, 3.5)])[0][2])


def test_a_touch_behind_is_behind(claims):
    holds(claims([BALL, BALL | {"position": [0, 1, 9]}], [(0, 1, 3, 0, 0, 1)])[0], 5, 1)


def test_from_inside_the_union_is_left(claims):
    chain = [BALL | {"position": [x, 0, 0]} for x in (3.0, 1.5, 0.0)]
    holds(claims(chain, [(0, 0, 0, 1, 0, 0)])[0], 4)


def test_repetition_and_bounds(claims):
    balls = [BALL | {"repeat": [4, 4, 4]}]
    known = {(2, 2, 0, 0, 0, 1): None, (2, 2, 2, 1, 1, 1): 2 - 1 / math.sqrt(3), (0, 0, 2, 0, 0, 1): 1}
    for claim, s in zip(claims(balls, list(known), 20), known.values(), strict=True):
        holds(claim, s)
    # From outside the bounds, the first step has to lead inside; what is beside it may keep it short.
    for s, claim in zip((2, 3), claims([BALL], [(0, 0, -3, 0, 0, 1), (0, 0, -4, 0, 0, 1)], 3), strict=True):
        holds(claim, s)
    for x, s in ((1, None), (2.1, 3.9)):
        beside = BALL | {"radius": 0.1, "position": [x, 0, -4.9]}
        holds(claims([BALL, beside], [(0, 0, -4.9, 0, 0, 1)], 3)[0], s)
    holds(claims([BALL], [(0, 0, -0.25, 0, 0, 1)], 0.5)[0], None)
