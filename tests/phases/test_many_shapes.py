"""opt9_convex's crowds: scenes of more shapes than can be asked one by one, against a march of all."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import phase_pictures
import pytest
from phase_pictures import check_bits, needs

from study.core import generated_scenes as scaling_scenes
from study.core import registry
from study.pictures import images

PHASE, MARCHED = "opt9_convex", "opt6_wide"

pytestmark = needs(PHASE)


def picture(
    phase: str, data: dict[str, Any], tmp_path: Path, n: int = 48, *options: object
) -> images.Picture:
    return phase_pictures.picture(phase, data, tmp_path, *options, size=(round(16 * n / 9), n))


def crowd(count: int, shadows: str = "soft", floor: bool = False, mirrors: float = 0.0) -> dict[str, Any]:
    data = scaling_scenes.data("scattered", count, 3)
    data["light"]["shadows"] = shadows
    for material in data["materials"].values():
        material["reflectivity"] = mirrors
    if floor:
        plane = {"type": "plane", "normal": [0, 1, 0], "offset": -9.0, "material": "green"}
        data["shapes"].insert(7, plane)
    return data


def psnr(a: images.Picture, b: images.Picture) -> float:
    return images.colour_errors(images.rgb(a), images.rgb(b), with_flip=False)["psnr_db"]


@pytest.mark.parametrize(
    ("count", "shadows", "floor", "mirrors"),
    [
        (16, "soft", True, 0.0),  # the most solids that are no crowd
        (17, "soft", False, 0.0),
        (31, "hard", False, 0.0),  # nor are these in other shadows
        (32, "soft", False, 0.0),
        (257, "soft", True, 0.0),  # a node with a single shape
        (300, "soft", True, 0.5),
        (300, "hard", True, 0.5),
        (500, "none", False, 0.5),
    ],
)
def test_as_the_march_of_all_shapes(
    count: int, shadows: str, floor: bool, mirrors: float, tmp_path: Path
) -> None:
    """The same shapes in the same light, but for pixels at rims, and at edges, where the march's normal is a
    difference over two faces."""
    data = crowd(count, shadows, floor, mirrors)
    mine, all_asked = (picture(phase, data, tmp_path) for phase in (PHASE, MARCHED))
    off = np.abs(images.rgb(mine) - images.rgb(all_asked)).max(axis=-1)
    assert (mine["id"] != all_asked["id"]).sum() <= 3
    assert not ((off > 0.002).sum() > 3) and np.isfinite(off).all()


def test_crowd256_is_the_generators() -> None:
    assert registry.find_scene("crowd256").data == scaling_scenes.data("scattered", 256, 1)


@pytest.mark.parametrize("strength", [1.05, 1.6])
def test_a_light_near_by_of_little_strength(strength: float, tmp_path: Path) -> None:
    """Rays of a beam turn apart there, and their cones are next to as wide as any can be: what is ahead of
    all at once cannot be told, so it is asked ray by ray. (Such rays were once asked about for ever.)"""
    data = crowd(40)
    data["light"] |= {"position": [4.0, 2.0, 24.0], "shadow_strength": strength}
    all_asked = picture(MARCHED, data, tmp_path, 240)
    assert psnr(picture(PHASE, data, tmp_path, 240), all_asked) >= 50


@pytest.mark.parametrize("steps", [3, 10, 50])
def test_few_steps_are_each_taken(steps: int, tmp_path: Path) -> None:
    """A cap that ends a shadow's march shapes its value in a crowd too; counted by packet, 492 of 4,080
    pixels were off, by up to 0.86. A ray told dark may not have the steps to come there: 2 pixels at 50."""
    data = crowd(40)
    data["march"]["max_steps"] = steps
    mine, exact = (picture(phase, data, tmp_path) for phase in (PHASE, "truth"))
    off = np.abs(images.rgb(mine).clip(0, 1) - images.rgb(exact).clip(0, 1)).max(axis=-1)
    assert np.array_equal(mine["id"], exact["id"])
    assert np.isfinite(off).all() and not (off > 1 / 255).any(), f"{(off > 1 / 255).sum()} pixels"


def test_coincident_shapes(tmp_path: Path) -> None:
    """4,096 spheres in one place: the picture of one, and the first of them has it."""
    data = scaling_scenes.data("scattered", 1, 3)
    one = picture(PHASE, data, tmp_path, 24)
    data["shapes"] *= 4096
    many = picture(PHASE, data, tmp_path, 24)
    assert np.array_equal(one["id"], many["id"])
    assert psnr(one, many) >= 80


def test_threads(tmp_path: Path) -> None:
    data = crowd(300, "soft", True, 0.5)
    one, three = (picture(PHASE, data, tmp_path, 48, "--threads", threads) for threads in (1, 3))
    check_bits(one, three)


def against_truth(data: dict[str, Any], tmp_path: Path) -> None:
    """Both phases' crowds, to truth's pixels that show the same shape."""
    exact = picture("truth", data, tmp_path, 96)
    for phase in (PHASE, "opt10_scene"):
        mine = picture(phase, data, tmp_path, 96)
        same = mine["id"] == exact["id"]
        off = np.abs(images.rgb(mine).clip(0, 1) - images.rgb(exact).clip(0, 1)).max(axis=-1)[same]
        assert not ((~same).sum() > 3) and np.isfinite(off).all(), phase
        assert not (off > 1 / 255).any(), f"{phase}: {(off > 1 / 255).sum()} pixels, {off.max():.3f}"


@pytest.mark.slow
def test_rings_in_their_own_shadow(tmp_path: Path) -> None:
    """A ring is not convex: rays that leave it can come back to it, so it stays in their way (a convex solid
    does not: PROOFS.md, 7.)."""
    data = crowd(64)
    for k, shape in enumerate(data["shapes"]):
        size = shape.pop("radius", None) or max(shape.pop("half_size"))
        shape |= {"type": "torus", "major_radius": size, "minor_radius": 0.3 * size}
        shape["rotation_degrees"] = [37.0 * k % 180, 0.0, 53.0 * k % 180]
    against_truth(data, tmp_path)


@pytest.mark.slow
def test_solids_that_bend_within_the_first_steps(tmp_path: Path) -> None:
    """With so long a first step, of spheres and near edges the shadow is marched, not told by facing and
    curvature: there a ray's own solid brings its least term, and must not be left out before that."""
    data = crowd(64)
    data["march"]["surface_offset"] = 0.05
    for k, shape in enumerate(data["shapes"]):
        size = shape.get("radius") or max(shape["half_size"])
        if k % 5 in (3, 4):
            shape.pop("radius", None)
            shape.pop("half_size", None)
        if k % 5 == 3:
            shape |= {"type": "cone", "bottom_radius": size, "top_radius": 0.4 * size, "half_height": size}
        if k % 5 == 4:
            shape |= {"type": "box", "half_size": [0.7 * size] * 3, "rounding": 0.3 * size}
        shape["rotation_degrees"] = [37.0 * k % 180, 0.0, 53.0 * k % 180]
    against_truth(data, tmp_path)
