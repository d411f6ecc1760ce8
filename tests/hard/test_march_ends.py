"""How a march ends, for every phase of the ladder, where the answer is exact: past a near miss, on a thin
plate, at the bounds, on a sphere wider than they are, from inside a shape. Few other scenes lead there.
"""

import numpy as np
import pytest

from study.core import registry
from study.experiments.stability.cases import Phase, exact, marches, measure
from study.experiments.stability.cases.scenes import (
    angle_degrees,
    ball,
    eye,
    floor,
    found,
    normals,
    rays,
    scene,
    shape,
    wall,
)

PHASES, _ = measure.able(None)
pytestmark = pytest.mark.parametrize("phase", PHASES)
HIT = 1e-6  # hit distance of the scenes
SIZE = (17, 17)


@pytest.mark.parametrize("distance", [10, 1000, 1900])
def test_a_near_miss_is_passed(phase: str, distance: float) -> None:
    """Three hit distances beside the ray there is no hit, be the sphere near or far. A float march may take
    it for one, for t has 1.2e-4 between its neighbours at 1900, but has to look again."""
    for clearance in (1e-4, 1e-5, 3e-6):
        picture = Phase(phase).render(marches.passing(clearance, distance), (1, 1))
        assert picture["id"][0, 0] == 1, f"{clearance:g} beside the sphere"
        assert picture["Z"][0, 0] == marches.BACKGROUND


@pytest.mark.parametrize("distance", [10, 1000])
def test_after_a_near_miss_there_may_be_nothing(phase: str, distance: float) -> None:
    whole = marches.passing(1e-5, distance)
    picture = Phase(phase).render(whole | {"shapes": whole["shapes"][:1]}, (1, 1))
    assert picture["id"][0, 0] == -1 and picture["Z"][0, 0] == np.inf


def test_the_steps_may_end_behind_a_near_miss(phase: str) -> None:
    """At any cap the ray ends, with the wall or with nothing."""
    whole = marches.passing(1e-5, 1000)
    if registry.phases()[phase].exact_hits:  # no steps: no cap is too low
        assert all(Phase(phase).render(whole, (1, 1), max_steps=cap)["id"][0, 0] == 1 for cap in (1, 2, 40))
        return
    needed = int(Phase(phase).render(whole, (1, 1))["evals"][0, 0])
    for cap in (needed, needed - 1, needed // 2 + 3, needed // 2, needed // 3):
        picture = Phase(phase, time_limit=5).render(whole, (1, 1), max_steps=cap)
        assert picture["id"][0, 0] == (1 if cap == needed else -1), f"{cap} of {needed} steps"


@pytest.mark.parametrize("angle", [0, 3, 40])
def test_a_far_plate_thinner_than_an_ulp(phase: str, angle: float) -> None:
    """A float t of 1500 has neighbours at 1.2e-4: one that ends behind the plate may not go on."""
    size = {"half_size": [400, 400, 4e-6], "rotation_degrees": [angle, angle, 0]}
    shapes = [shape("box", position=[0, 0, 1500], **size), wall(marches.BACKGROUND, material="other")]
    whole = scene(shapes, camera=eye([0, 0, 0], [0, 0, 1], 5), march={"bounds_radius": 4096})
    picture = Phase(phase).render(whole, (33, 33))
    assert (picture["id"] == 0).all(), f"{(picture['id'] != 0).sum()} of 1089 rays pass"


def test_near_misses_of_some_rays(phase: str) -> None:
    """Rows of spheres at different distances, between which rays pass at 3 to 100 hit distances, and which
    others hit: every ray ends on its own surface, wherever its neighbours do."""
    places = [(600.0, 5e-6), (900.0, 2e-5), (1300.0, 3e-6), (1700.0, 1e-4)]
    at = [3.0 * i for i in range(len(places))]  # columns: one ray beside a sphere, one through its middle
    balls = [ball(1, x + 1 + gap, 0, z) for x, (z, gap) in zip(at, places, strict=True)]
    shapes = [*balls, wall(marches.BACKGROUND, material="other")]
    whole = scene(shapes, camera=eye([0, 0, 0], [0, 0, 1], 1), march={"bounds_radius": 4096})
    origin, directions = rays(whole, (33, 33))
    spheres = (exact.sphere(origin, directions, one["position"], 1) for one in balls)
    t, ids = exact.nearest(*spheres, exact.plane(origin, directions, [0, 0, 1], marches.BACKGROUND))
    picture = Phase(phase).render(whole, (33, 33))
    assert len(set(ids.ravel().tolist())) > 3
    assert (picture["id"] == ids).all() and np.abs(picture["Z"] - t).max() < 1e-3


@pytest.mark.parametrize("k", [1, 8, 14, 17])
def test_a_hit_beyond_the_bounds_is_none(phase: str, k: float) -> None:
    """The bounds cut a disc out of a wall. A march may stop a hit distance short of it, still within."""
    whole = marches.cut(k)
    beyond = marches.beyond_bounds(whole)
    rim = (beyond > -1e-7) & (beyond < 1.2 * HIT)
    hit = found(Phase(phase).render(whole, marches.CUT_SIZE))
    assert rim.sum() < 40 and 100 < (beyond < 0).sum() < 900
    assert (hit == (beyond < 0))[~rim].all()


@pytest.mark.parametrize("radius", [101.0, 1e3, 1e5, 1e7])
@pytest.mark.parametrize("turn", [[0, 0, 0], [10, 20, 30]])
def test_a_sphere_wider_than_the_bounds(phase: str, radius: float, turn: list[float]) -> None:
    """Standing on a planet: at 1e7 a float of |p| − radius would know the height to 0.5. A march stops
    a hit distance above it, which is 1/sin of the angle as much along the ray."""
    centre = np.array([3.0, -radius, -2.0])
    planet = ball(radius, *centre.tolist(), rotation_degrees=turn)
    whole = scene([planet], camera=eye([0, 2, 0], [0, 0, 6], 10))
    origin, directions = rays(whole, SIZE)
    t = exact.sphere(origin, directions, centre, radius).astype(float)
    assert np.isfinite(t).all()
    picture = Phase(phase).render(whole, SIZE)
    n = (origin + t[..., None] * directions - centre) / radius
    slant = np.abs((n * directions).sum(-1))
    assert found(picture).all() and (np.abs(picture["Z"] - t) <= 1.1 * HIT / slant + 1e-7 * t).all()
    assert angle_degrees(normals(picture), n).max() < 0.02


def test_a_shadow_of_a_sphere_wider_than_the_bounds(phase: str) -> None:
    """The planet is between a ball beside it and the light beyond its edge; and lit from above it is not."""
    planet = ball(1e4, 0, -1e4, 0)
    brightness = []
    for height in (-40.0, 40.0):
        light = {"position": [0, height, 30], "shadows": "hard"}
        whole = scene([planet], camera=eye([0, 2, -5], [0, 0, 0]), light=light)
        brightness.append(Phase(phase).render(whole, (9, 9))["R"][5, 4])
    assert brightness[0] == pytest.approx(0.006, rel=1e-5) and brightness[1] > 0.03  # ambient alone; lit


@pytest.mark.parametrize("distance", [50.0, 150.0])
def test_from_inside_a_shape_also_beyond_the_bounds(phase: str, distance: float) -> None:
    """The surface is asked for before the bounds of 100 are: who starts 0.75 deep is hit 0.75 behind."""
    whole = scene([floor(0.75)], camera=eye([distance, 0, 0], [distance, 0, 1]))
    picture = Phase(phase).render(whole, (5, 5))
    assert (picture["id"] == 0).all() and np.abs(picture["Z"] + 0.75).max() <= HIT


def test_from_inside_the_shape_is_that_of_the_start(phase: str) -> None:
    """The step back, up through the floor's surface, ends inside a ball that was not the nearest."""
    camera = eye([0, 0, 0], [0, -1, 0], 5, up=[0, 0, 1])
    picture = Phase(phase).render(scene([floor(0.75), ball(5, 0, 5.5, 0)], camera=camera), (5, 5))
    assert (picture["id"] == 0).all() and np.abs(picture["Z"] + 0.75).max() <= HIT
