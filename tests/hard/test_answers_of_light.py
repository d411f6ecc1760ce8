"""Hard cases of light: their known answers, computed in another way."""

import math
from types import SimpleNamespace

import mpmath
import numpy as np
import pytest
from mpmath import mpf

from conformance import geometry
from hard.known import of, on_ray, strengths
from study.experiments.stability.cases import light, marches
from study.experiments.stability.cases.scenes import camera_frame, rays


@pytest.mark.parametrize("strength", [0.5, 8, 128])
def test_penumbra_by_sampling(strength: float) -> None:
    """The closed-form minimum against the least of 20,000 samples on the way to the light."""
    random = np.random.default_rng(1)
    points = np.column_stack([random.uniform(-2, 2, 300), np.zeros(300), random.uniform(-2, 2, 300)])
    known = light.ideal(points, strength)
    to_light = np.array(light.LIGHT) - points
    reach = np.linalg.norm(to_light, axis=1)
    least = np.full(300, np.inf)
    whole = light.room(strength, "soft")
    for shares in np.array_split(np.geomspace(1e-3 / reach.min(), 1, 20000), 200):
        t = np.maximum(shares[:, None] * reach, 1e-3)
        p = points + (t / reach)[..., None] * to_light
        ball = np.linalg.norm(p - light.CENTRE, axis=-1) - light.RADIUS
        least = np.minimum(least, (strength * np.minimum(ball, p[..., 1]) / t).min(axis=0))
    assert np.abs(np.clip(least, 0, 1) - known).max() < 2e-3
    assert known.min() < 0.01 and np.ptp(known) > 0.2
    assert whole["light"]["position"] == light.LIGHT


@strengths("strength", 16)
def test_a_picture_without_its_penumbra_fails(strength: float) -> None:
    """The shadow's own steps from pixel to pixel, in closed form, are above the limit at every strength: what
    is lit evenly leaves all of them out."""
    seen, known = light.shadowed(strength)
    pairs = seen[:, 1:] & seen[:, :-1]
    assert of(16).failed(float(np.abs(np.diff(known, axis=1))[pairs].max()))
    even = SimpleNamespace(render=lambda scene, size: {"R": np.full(size[::-1], 0.3, np.float32)})
    assert of(16).failed(light.c16_penumbra(even, strength).error)


def test_mirrors_by_recursion() -> None:
    """The colour between the mirrors for the middle ray, which goes to and fro on one line: by hand."""
    whole = light.between(3)
    known = light.series(whole)[light.FACING[1] // 2, light.FACING[0] // 2]
    color, total = np.array(light.SILVER), np.zeros(3)
    lamp = np.array(whole["light"]["position"])
    for bounce in range(4):
        wall = 2.0 if bounce % 2 == 0 else -2.0
        to_light = lamp - [0, 0, wall]
        distance = np.linalg.norm(to_light)
        facing = abs(to_light[2]) / distance  # mirrored at the wall and seen along z: the same cosine
        total += 0.1**bounce * (
            0.01 * color + 5 * color * facing / distance + 0.2 * 5 * facing**15 / distance
        )
    assert np.abs(known - total).max() < 1e-12


def test_how_deep_inside() -> None:
    """The depth at the camera by geometry; where the nearest surface is behind, the line meets it there."""
    for whole, depth in light.enclosed(3):
        origin, directions = rays(whole, (1, 1))
        assert geometry.scene_distance(origin[None], whole) == -depth
        if whole["shapes"][0]["type"] == "sphere":
            there = geometry.scene_distance(on_ray(origin, directions, np.array([[-depth]])), whole)
            assert abs(there[0]) < 1e-15 and depth == 0.5


def test_small_scenes() -> None:
    """Cases whose answer is by construction are constructed so."""
    assert camera_frame(marches.over_floor(1e-7))[3][1] == 0
    for depth in of(26).strengths:  # the light is inside the ball, in doubles too
        whole = light.lamp(depth)
        ball = whole["shapes"][1]
        assert math.dist(whole["light"]["position"], ball["position"]) < ball["radius"]
    thick = light.foggy(8, 0.7e-24)
    assert thick["fog"] * 1e24 == pytest.approx(0.7) and mpmath.exp(mpf(-0.7)) > 0.49
    for k in of(31).strengths:
        share = (marches.beyond_bounds(marches.cut(k)) <= 0).mean()
        assert 0.005 < share < 0.9, "the disc's rim is in the picture"
