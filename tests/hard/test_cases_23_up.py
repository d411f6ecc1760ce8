"""The answers that hard cases 23 and up call known, computed again in another way (as test_cases_12_to_22.py
does); and that no case from 12 on is lacking, or lacks its source."""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest
from mpmath import mpf

from conformance import geometry
from hard.first_hits import first_hit_holds, on_ray
from study.experiments.stability.cases import cases, exact
from study.experiments.stability.cases.light import c26_light_inside as c26
from study.experiments.stability.cases.light import c30_deep_fog as c30
from study.experiments.stability.cases.rays import c23_camera_near_surface as c23
from study.experiments.stability.cases.rays import c24_wide_field as c24
from study.experiments.stability.cases.rays import c28_up_along_view as c28
from study.experiments.stability.cases.scenes import camera_frame, rays
from study.experiments.stability.cases.shapes import c25_coplanar as c25
from study.experiments.stability.cases.shapes import c31_bounds_cut as c31
from study.experiments.stability.cases.shapes import c33_lopsided_cells as c33


def own() -> list:
    return [case for case in cases() if case.number >= 12]


def test_all_cases_are_there() -> None:
    """12 to 22, and at least eight of our own."""
    numbers = [case.number for case in cases()]
    assert set(range(12, 23)) <= set(numbers) and sum(case.own for case in cases()) >= 8


@pytest.mark.parametrize("case", own(), ids=lambda case: case.name)
def test_pages_name_a_year(case) -> None:
    """A source that can be looked up has a year or a number."""
    assert any(
        word.strip("().,:;").isdigit() and len(word.strip("().,:;")) == 4 for word in case.source.split()
    )
    assert len(case.strengths) >= 5


def test_first_hits_of_a_wide_field() -> None:
    """The closed form of exact.py against distances from geometry, along the very rays of the case."""
    wide = c24.wall(170)
    first_hit_holds(wide, c24.SIZE, exact.plane(*rays(wide, c24.SIZE), [0.36, 0.48, 0.8], 1))


@pytest.mark.parametrize("ratio", [1, 2, 30])
def test_cones_of_the_column(ratio: float) -> None:
    """Ray against cone: on the surface of the nearest copy, and outside all copies before."""
    whole = c33.stack(ratio)
    origin, directions = rays(whole, (12, 12))
    top = c33.BOTTOM / ratio
    t, _ = exact.nearest(
        *(exact.cone(origin, directions, [0, c33.CELL * i, 0], c33.BOTTOM, top, c33.HALF) for i in c33.COPIES)
    )
    copies = {k: v for k, v in whole["shapes"][0].items() if k != "repeat"}
    union = whole | {"shapes": [copies | {"position": [0, c33.CELL * i, 0]} for i in c33.COPIES]}
    near = np.where(t < 12, t, np.inf)
    hit = np.isfinite(near)
    assert 0.2 < hit.mean() < 1
    on = geometry.scene_distance(on_ray(origin, directions[hit], near[hit]), union)
    assert np.abs(on).max() < 1e-12
    for share in np.linspace(0, 0.999, 100):
        before = geometry.scene_distance(on_ray(origin, directions, share * np.where(hit, near, 12)), union)
        assert before.min() > -1e-12


def test_nearer_surface_is_nearer() -> None:
    """Both faces are square to (0, 0.6, 0.8), the box's by the gap before the wall's."""
    for gap in (1e-1, 1e-5):
        whole = c25.layers(gap)
        origin, directions = rays(whole, (8, 5))
        wall = exact.plane(origin, directions, [0, 0.6, 0.8], 4)
        p = on_ray(origin, directions, wall)
        assert np.abs(geometry.shape_distance(p, whole["shapes"][c25.FAR])).max() < 1e-12
        assert np.abs(geometry.shape_distance(p, whole["shapes"][c25.NEAR]) + gap).max() < 1e-12
        assert (geometry.shape_distance(p * 0.9, whole["shapes"][c25.NEAR]) > 0).all()


def test_small_scenes() -> None:
    """Of the cases whose answer is by construction: that they are constructed so."""
    assert camera_frame(c23.over_floor(1e-7))[3][1] == 0
    for depth in c26.CASE.strengths:  # the light is inside the ball, in doubles too
        light, ball = c26.lamp(depth)["light"]["position"], c26.lamp(depth)["shapes"][1]
        assert math.dist(light, ball["position"]) < ball["radius"]
    straight = camera_frame(c28.leaning(None))
    for angle in c28.CASE.strengths:
        for a, b in zip(straight, camera_frame(c28.leaning(angle)), strict=True):
            assert np.abs(a - b).max() < 1e-9
    thick = c30.foggy(8, 0.7e-24)
    assert thick["fog"] * 1e24 == pytest.approx(0.7) and mpmath.exp(mpf(-0.7)) > 0.49
    for k in c31.CASE.strengths:
        whole = c31.cut(k)
        t = exact.plane(*rays(whole, c31.SIZE), [0, 0, 1], c31.FAR)
        share = (t <= whole["march"]["bounds_radius"]).mean()
        assert 0.005 < share < 0.9, "the disc's rim is in the picture"
