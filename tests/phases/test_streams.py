"""opt8_streams: queues, cones and refilled lanes change when a ray is marched, and not what it finds.

Pictures are the parent's, but for a Mandelbulb alone, which is nearer to the march in double; and of any
number of threads to the bit.
"""

from __future__ import annotations

import copy

import numpy as np
import pytest
from phase_pictures import needs
from soft_shadows import SHARP, clamped
from tile_pictures import (
    EACH_WIDTH,
    WIDTHS,
    check_bits,
    check_same,
    crowd,
    flat_scenes,
    picture,
)

from conformance.feature_scenes import FEATURES
from study.core import registry
from study.pictures import images

PHASE, PARENT = "opt8_streams", "opt7_tiles"

pytestmark = needs(PHASE)


@pytest.mark.parametrize("width", EACH_WIDTH)
@pytest.mark.parametrize("shadows", [pytest.param("hard", marks=pytest.mark.slow), "soft"])
def test_cones_and_queues_are_the_parents_picture(shadows, width, tmp_path) -> None:
    """A march in float has noise at its first steps, which what is told without one has not."""
    for seed, count in ((3, 12), (4, 60)):
        scene = crowd(seed, count, shadows)
        mine = picture(PHASE, scene, tmp_path, (160, 90), **WIDTHS[width])
        check_same(mine, picture(PARENT, scene, tmp_path, (160, 90)), f"{count} shapes, {shadows}, {width}")


@pytest.mark.parametrize("name", SHARP)
def test_shadows_at_edges_are_the_parents(name, tmp_path) -> None:
    """Within two offsets of an edge a shape is not the flat one of which the first two terms are told.

    Not truth's, whose normals have no differences over an edge. Told flat, pixels were 0.81 and 0.011 off.
    """
    mine, march = (picture(phase, SHARP[name], tmp_path, (214, 122)) for phase in (PHASE, PARENT))
    assert np.array_equal(mine["id"], march["id"])
    assert np.abs(clamped(mine) - clamped(march)).max() < 1e-5


@pytest.mark.slow
@pytest.mark.parametrize("width", EACH_WIDTH)
def test_starts_are_the_parents(width, tmp_path) -> None:
    """The same squares and patches, from other arrangements of lanes.

    So what tests/phases/test_tiles.py holds against truth holds here, for every strip of a picture.
    """
    scenes = {name: scene.data for name, scene in registry.scenes().items()}
    scenes |= {name: FEATURES[name] for name in ("everything", "camera_within_a_shape", "nothing_to_see")}
    for name, scene in scenes.items():
        mine, parents = (
            picture(phase, scene, tmp_path, (175, 74), **WIDTHS[width]) for phase in (PHASE, PARENT)
        )
        assert np.array_equal(mine["start"], parents["start"]), name
        assert np.array_equal(mine["shapes"], parents["shapes"]), name


@pytest.mark.parametrize("width", EACH_WIDTH)
@pytest.mark.parametrize("name", flat_scenes())
def test_strides_to_a_plane_are_the_parents_steps(name, width, tmp_path) -> None:
    """Several steps between two questions: to the bit, and as many steps."""
    scene = flat_scenes()[name]
    mine, parents = (
        picture(phase, scene, tmp_path, (214, 120), **WIDTHS[width]) for phase in (PHASE, PARENT)
    )
    assert name == "beyond" or (parents["id"] == 0).sum() > 3000
    check_bits(mine, parents)


def hall_of_mirrors(bulb: bool) -> dict:
    """A floor and a ceiling that mirror each other, shapes of every kind between, and behind perhaps a bulb.

    Every pixel's ray and its three mirrored ones hit what is lit, and shadow rays have other lists than they.
    """
    scene = crowd(5, 10, "soft")
    scene["materials"]["glass"] = {"color": [0.6, 0.7, 0.8], "reflectivity": 1, "shininess": 15}
    ceiling = scene["shapes"][0] | {"normal": [0, -1, 0], "offset": -8}
    # Repeated, so that no cone tells anything, and every shadow ray waits.
    ball = {"type": "sphere", "radius": 0.3, "repeat": [3, 0, 0], "position": [0, -4, 12]}
    of_bulb = {"power": 8, "iterations": 4, "bailout": 256, "position": [0, 0, -40]}
    more = [of_bulb | {"type": "mandelbulb"}] * bulb
    scene["shapes"] = [shape | {"material": "glass"} for shape in [*scene["shapes"], ceiling, ball, *more]]
    scene["camera"] |= {"position": [0, 4, -2], "look_at": [0, -2, 10], "vertical_fov_degrees": 30}
    scene["light"] |= {"position": [3, 7, 2]}
    return scene


@pytest.mark.parametrize("bulb", [False, True])
@pytest.mark.parametrize("width", EACH_WIDTH)
def test_full_queues(width, bulb, tmp_path) -> None:
    """Four shadow rays of a pixel wait where there is room for one: a full queue is worked off, and
    the rays that are under way then keep their own lists. Without a Mandelbulb each group's are."""
    scene = hall_of_mirrors(bulb)
    parents = picture(PARENT, scene, tmp_path, (256, 90))
    assert np.isfinite(parents["Z"]).all()
    check_same(picture(PHASE, scene, tmp_path, (256, 90), **WIDTHS[width]), parents, width)


BULBS = [
    name
    for name, scene in registry.scenes().items()
    if any(shape["type"] == "mandelbulb" for shape in scene.data["shapes"])
]


@pytest.mark.parametrize("width", EACH_WIDTH)
@pytest.mark.parametrize("name", BULBS)
@pytest.mark.parametrize("hit_distance", [None, 2e-3])
def test_a_mandelbulbs_streams_are_the_parents_packets(name, hit_distance, width, tmp_path) -> None:
    """Lanes that are filled again find what those of a packet find: to the bit, and as many steps.

    With a pebble behind the camera, or hits told less exactly: else a lone Mandelbulb goes another way."""
    scene = copy.deepcopy(registry.scenes()[name].data)
    if hit_distance:
        scene["march"]["hit_distance"] = hit_distance
    else:
        pebble = {"type": "sphere", "radius": 0.1, "position": [0, 1, -60], "material": "blue"}
        scene["shapes"].append(pebble)
    mine, parents = (picture(phase, scene, tmp_path, (160, 90), **WIDTHS[width]) for phase in (PHASE, PARENT))
    bulb = next(i for i, s in enumerate(scene["shapes"]) if s["type"] == "mandelbulb")
    hit = parents["id"] == bulb
    assert hit.sum() > 500 and np.array_equal(mine["id"], parents["id"])
    for plane in ("Z", "N.x", "N.y", "N.z", "evals"):
        assert np.array_equal(mine[plane][hit], parents[plane][hit]), plane
    for channel in "RGB":
        apart = np.abs(mine[channel] - parents[channel])
        assert (
            apart[hit] if hit_distance else apart
        ).max() < 1e-5  # the plane's hits: anywhere within hit_distance


def lone(name: str) -> dict:
    """A Mandelbulb alone, or with a plane: as in the project's scenes, and otherwise."""
    scene = copy.deepcopy(registry.scenes()["mandelbulb"].data)
    floor, bulb = scene["shapes"]
    if name in BULBS:
        scene = copy.deepcopy(registry.scenes()[name].data)
    elif name == "turned, nothing beside, hard shadows":
        bulb |= {"position": [0.3, -0.2, 5], "rotation_degrees": [20, -50, 80], "iterations": 7}
        scene["shapes"] = [bulb]
        scene["light"]["shadows"] = "hard"
    elif name == "within its ball":
        scene["camera"] |= {"position": [0, 0.9, 5.5], "look_at": [0, 0, 6]}
    elif name == "within itself":
        scene["camera"] |= {"position": [0.2, 0.3, 6.1], "look_at": [1, 1, 9]}
    elif name == "mirrors":
        scene["materials"]["white"]["reflectivity"] = 0.7
        scene["materials"]["blue"]["reflectivity"] = 0.4
    elif name == "few steps":
        scene["march"]["max_steps"] = 60
    elif name == "a plane through it, from below":
        floor |= {"normal": [0.6, 0.8, 0], "offset": 0.2}
        scene["camera"] |= {"position": [-2, -2.5, 2], "look_at": [0, 0, 6]}
    return scene


LONE = [*BULBS, "turned, nothing beside, hard shadows", "within its ball", "within itself"]
LONE += ["mirrors", "few steps", "a plane through it, from below"]


@pytest.mark.slow
@pytest.mark.parametrize("width", EACH_WIDTH)
@pytest.mark.parametrize("name", LONE)
def test_a_lone_mandelbulb_is_nearer_to_the_march_in_double(name, width, tmp_path) -> None:
    """Than the parent's is: as many depths agree, or more, the mean of 4 × 4 pixels errs no more, and its
    number of steps less. The march in double is opt3's. `allowed`: what chance may add."""
    scene, allowed = lone(name), 1.1
    bulb = next(i for i, s in enumerate(scene["shapes"]) if s["type"] == "mandelbulb")
    wrong, rms, evals = np.zeros(2), np.zeros(2), np.zeros(2)
    for size in ((192, 108), (224, 126), (256, 144)):
        double = picture("opt3", scene, tmp_path, size)
        assert (double["id"] >= 0).sum() > 1000
        for i, phase in enumerate((PHASE, PARENT)):
            image = picture(phase, scene, tmp_path, size, **WIDTHS[width])
            seen = np.isfinite(image["Z"]) & np.isfinite(double["Z"])
            agree = (image["id"] == double["id"]) & (seen | (np.isnan(image["Z"]) == np.isnan(double["Z"])))
            apart = np.abs(image["Z"][seen] - double["Z"][seen])
            agree[seen] &= apart <= 1e-4 * np.abs(double["Z"][seen])
            wrong[i] += (~agree).sum()
            rms[i] += images.antialiased(double, image)["rmse"] ** 2
            evals[i] += np.abs(image["evals"] - double["evals"])[agree & (image["id"] == bulb)].sum()
    assert wrong[0] <= wrong[1] * allowed + 2, wrong
    assert rms[0] <= rms[1] * allowed + 1e-9, rms
    assert evals[0] <= evals[1] + 1, evals


@pytest.mark.parametrize("width", EACH_WIDTH)
@pytest.mark.parametrize("camera", [[0, 0, 0], [0, 0, -3]], ids=["within the bounds", "outside"])
def test_a_mandelbulb_at_the_bounds_is_the_parents(camera, width, tmp_path) -> None:
    """Its far side is beyond the bounds, where nothing is hit."""
    scene = lone("mandelbulb")
    scene["march"]["bounds_radius"] = 5.8 if camera[2] == 0 else 2
    scene["camera"]["position"] = camera
    mine, parents = (picture(phase, scene, tmp_path, (96, 54), **WIDTHS[width]) for phase in (PHASE, PARENT))
    assert (parents["id"] >= 0).any() == (camera[2] == 0)
    check_same(mine, parents, width)


@pytest.mark.parametrize("width", EACH_WIDTH)
@pytest.mark.parametrize("shadows", ["hard", "soft"])
def test_stretches_of_two_bulbs_over_two_planes(shadows, width, tmp_path) -> None:
    """Where along a shadow ray either bulb may be nearer than either plane: both bulbs throw shadows on
    the floor and on the wall behind."""
    bulb = {"type": "mandelbulb", "power": 8, "iterations": 4, "bailout": 256, "material": "plain"}
    floor = {"type": "plane", "normal": [0, 1, 0], "offset": -1.2, "material": "plain"}
    wall = {"type": "plane", "normal": [0.6, 0, -0.8], "offset": -6, "material": "plain"}
    scene = copy.deepcopy(FEATURES["everything"]) | {"fog": 0}
    scene["shapes"] = [floor, bulb | {"position": [-1.3, 0, 0]}, wall, bulb | {"position": [1.2, 0.3, 3]}]
    scene["light"] |= {"position": [3, 4, -5], "shadows": shadows}
    scene["camera"] |= {"position": [0, 2, -8], "look_at": [0, 0, 2], "vertical_fov_degrees": 45}
    mine, parents = (picture(phase, scene, tmp_path, (96, 54), **WIDTHS[width]) for phase in (PHASE, PARENT))
    assert set(np.unique(parents["id"])) >= {0, 1, 2, 3}
    check_same(mine, parents, f"two bulbs, {shadows}, {width}")
