"""Generated scenes: the share of the picture that they cover, by each shape's own equations."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from study.core import generated_scenes, run
from study.core.cli import StudyError
from study.pictures import images


def hits(scene: dict, width: int, height: int) -> np.ndarray:
    """Which camera rays meet a shape, by each shape's own equations: quadratic, slabs, eight half-spaces."""
    half = math.tan(math.radians(scene["camera"]["vertical_fov_degrees"]) / 2)
    i, j = np.meshgrid(np.arange(width), np.arange(height))
    x = (2 * (i + 0.5) / width - 1) * width / height * half
    y = (1 - 2 * (j + 0.5) / height) * half
    d = np.stack([x, y, np.ones_like(x)], -1).reshape(-1, 3)
    found = np.zeros(len(d), bool)
    for shape in scene["shapes"]:
        o = -np.array(shape["position"])
        if shape["type"] == "sphere":
            a, b, c = (d * d).sum(1), d @ o, o @ o - shape["radius"] ** 2
            found |= b * b - a * c >= 0
            continue
        if shape["type"] == "box":
            normals = np.eye(3)
            bounds = np.array(shape["half_size"])
        else:
            normals = np.array([(1, s, t) for s in (1, -1) for t in (1, -1)], float)
            bounds = np.full(4, shape["radius"])
        along, start = d @ normals.T, normals @ o
        with np.errstate(divide="ignore", invalid="ignore"):
            one, other = (-bounds - start) / along, (bounds - start) / along
        near, far = np.fmin(one, other).max(1), np.fmax(one, other).min(1)
        found |= (near <= far) & (far > 0)
    return found


@pytest.mark.parametrize("arrangement", generated_scenes.ARRANGEMENTS)
@pytest.mark.parametrize("count", [1, 16, pytest.param(150, marks=pytest.mark.slow)])
def test_the_share_of_rays_that_hit_is_the_stated_one(arrangement: str, count: int) -> None:
    scene = generated_scenes.data(arrangement, count, seed=3)
    assert len(scene["shapes"]) == count
    # A lattice has rays of equal gauge, so that the share can leap by a few of them.
    assert hits(scene, *generated_scenes.RAYS).mean() == pytest.approx(generated_scenes.COVERAGE, abs=0.005)
    # A picture of another size has its own sampling of the outlines.
    assert hits(scene, 213, 120).mean() == pytest.approx(generated_scenes.COVERAGE, abs=0.015)


def test_a_rendered_scene_covers_what_it_should(tmp_path: Path) -> None:
    scene = generated_scenes.of_shapes("clustered", 60, 1, tmp_path)
    run.render("baseline", scene.path, 45, 80, aov=True, out=tmp_path / "a.exr")
    made = images.read(tmp_path / "a.exr")["id"] >= 0
    assert (made != hits(scene.data, 80, 45).reshape(45, 80)).mean() < 0.002


def test_scenes_are_made_by_their_seed_alone(tmp_path: Path) -> None:
    one, same, other = (generated_scenes.data("scattered", 20, seed) for seed in (1, 1, 2))
    assert one == same and one != other
    first = generated_scenes.of_shapes("scattered", 20, 1, tmp_path)
    assert first.data == one and json.loads(first.path.read_text()) == one
    stamp = first.path.stat().st_mtime_ns
    assert generated_scenes.of_shapes("scattered", 20, 1, tmp_path).path.stat().st_mtime_ns == stamp


@pytest.mark.slow
def test_the_driver_takes_the_largest_scene_and_there_is_no_larger(tmp_path: Path) -> None:
    scene = generated_scenes.of_shapes("corridors", generated_scenes.MOST_SHAPES, 1, tmp_path)
    assert len(scene.data["shapes"]) == 4096
    assert run.render("baseline", scene.path, 1, 1, max_steps=1)["frames"]
    for count in (0, 4097):
        with pytest.raises(StudyError):
            generated_scenes.of_shapes("scattered", count, 1, tmp_path)
    with pytest.raises(StudyError, match="strewn"):
        generated_scenes.of_shapes("strewn", 4, 1, tmp_path)


def test_nearly_every_ray_of_the_hall_is_mirrored_as_often_as_it_may_be() -> None:
    """By unfolding: mirror k is met at x = ±2 after (2 + 4k)/|dx| of the way, inside the bounds."""
    scene = generated_scenes.hall(16)
    aim = np.array(scene["camera"]["look_at"])
    half = math.tan(math.radians(scene["camera"]["vertical_fov_degrees"]) / 2)
    right = np.cross([0, 1, 0], aim)
    u, v = np.meshgrid(np.linspace(-1, 1, 81) * half * 16 / 9, np.linspace(-1, 1, 45) * half)
    d = aim + u[..., None] * right + v[..., None] * np.array([0, 1, 0])
    s = (2 + 4 * 16) / np.abs(d[..., 0])  # the way to the seventeenth wall, of which the first is no bounce
    inside = np.hypot(s * d[..., 1], s * d[..., 2]) < scene["march"]["bounds_radius"]
    assert scene["march"]["max_bounces"] == 16 and inside.mean() > 0.9
