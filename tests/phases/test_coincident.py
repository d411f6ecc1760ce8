"""Thousands of shapes in one place: every picture is that of one, of the first; what loses it."""

from __future__ import annotations

import functools
from pathlib import Path

import needs
import numpy as np
import pytest

from conformance.feature_scenes import FLOOR, scene, shape
from study.core import registry, store
from study.core.registry import Scene
from study.measuring import hits

COUNT, SIZE = 4096, (43, 24)
# Its disc is within the first block of 16 × 16 pixels: no ray through a corner of a block meets it.
PLACE, RADIUS = [-3.66, 0.93, 2.0], 0.43
AWAKE = {
    "fixed": ("STEPWISE_FIXED", "clear=safe"),
    "fixed_simd": ("STEPWISE_FIXED", ""),
    "fixed_float": ("STEPWISE_FIXED", ""),
    "rods_simd": ("STEPWISE_RODS", ""),
    "packets": ("STEPWISE_PACKETS", ""),
}
LADDER = [
    name for name in registry.phases() if name.startswith("opt") and name not in ("opt1", "opt2", "opt3")
]


def expected() -> np.ndarray:
    """The pixels whose middle's ray comes closer to the centre than its radius."""
    rows, columns = np.mgrid[: SIZE[1], : SIZE[0]]
    half = np.tan(np.radians(60) / 2) / SIZE[1]
    along = np.stack(
        [(2 * columns + 1 - SIZE[0]) * half, (SIZE[1] - 1 - 2 * rows) * half, np.ones(rows.shape)], axis=-1
    )
    along /= np.linalg.norm(along, axis=-1, keepdims=True)
    centre = np.array(PLACE) - [0, 0, -4]
    return np.linalg.norm(np.cross(along, centre), axis=-1) < RADIUS


@pytest.fixture(scope="module")
def draw(tmp_path_factory):
    """The picture of so many of them by a phase, in the words of its variable, if it has one."""
    folder = tmp_path_factory.mktemp("coincident")

    @functools.cache
    def one(phase: str, count: int, variable: str, words: str):
        data = scene(
            [shape("sphere", radius=RADIUS, position=PLACE, material="plain")] * count,
            camera={"position": [0, 0, -4], "look_at": [0, 0, 0], "vertical_fov_degrees": 60},
            light={"shadows": "hard"},
        )
        path: Path = folder / f"{count}.json"
        store.write_json(path, data)
        told = {variable: words} if variable else {}
        return hits.picture(phase, Scene(path.stem, path, data, False), SIZE, told)

    return one


@pytest.mark.slow
@pytest.mark.parametrize("phase", [*AWAKE, "baseline", *LADDER])
def test_they_are_one_sphere_and_the_first(draw, phase):
    needs.cpu_for(phase)
    there = expected()
    assert there.sum() == 8
    many, alone = (draw(phase, count, *AWAKE.get(phase, ("", ""))) for count in (COUNT, 1))
    assert np.array_equal(many["id"] >= 0, there), f"{(many['id'] >= 0).sum()} pixels"
    assert set(np.unique(many["id"])) == {-1.0, 0.0}, "the first in the scene has it"
    for plane in ("R", "G", "B", "Z"):
        assert np.array_equal(many[plane], alone[plane]), plane
        assert np.isfinite(many[plane][there]).all()


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["octahedron", "box", "sphere"])
@pytest.mark.parametrize("phase", LADDER[1:])
def test_mirrors_in_one_place_in_soft_light(phase: str, kind: str, tmp_path: Path) -> None:
    """4,095 of them and one, over a floor that has their shadow and that they mirror: the same hits and
    colours. (opt5_threads is opt4's code; baseline would take minutes.)"""
    needs.cpu_for(phase)

    def draw(count: int, shadows: str) -> dict[str, np.ndarray]:
        shapes = [FLOOR, *[shape(kind, material="mirror")] * count]
        data = scene(shapes, light={"shadows": shadows}, march={"max_bounces": 2})
        path = tmp_path / f"{count}-{shadows}.json"
        store.write_json(path, data)
        return hits.picture(phase, Scene(path.stem, path, data, False), (32, 18))

    one, many, unshadowed = draw(1, "soft"), draw(COUNT - 1, "soft"), draw(1, "none")
    assert set(np.unique(one["id"])) == {-1.0, 0.0, 1.0}
    assert ((one["id"] == 0) & (unshadowed["R"] - one["R"] > 1 / 255)).any(), "the floor has a shadow"
    assert np.array_equal(one["id"], many["id"]), "the first of them has it"
    hit = one["id"] >= 0
    assert (np.abs(one["Z"][hit] - many["Z"][hit]) <= 2e-6 * one["Z"][hit]).all()
    for plane in ("R", "G", "B", "N.x", "N.y", "N.z"):
        assert (np.abs(one[plane] - many[plane]) <= 1e-4).all(), plane


def test_the_articles_corners_lose_all_of_them(draw):
    made = draw("fixed", COUNT, "STEPWISE_FIXED", "roots=article clear=corners")
    assert (made["id"] < 0).all() and (made["cleared"][expected()] == 1).all()
    whole = draw("fixed", COUNT, "STEPWISE_FIXED", "roots=article clear=never")
    assert np.array_equal(whole["id"] >= 0, expected()), "it is the clearing that loses them"
