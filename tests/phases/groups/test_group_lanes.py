"""opt6_wide, opt7_tiles, opt8_streams: groups as programs over lanes.

Their pictures are baseline's, and a group that only holds shapes is those shapes. That a part of a program
has the bits of the whole: tests/c/phases/group_programs.h.
"""

from __future__ import annotations

import copy
import functools
import tempfile
from pathlib import Path

import numpy as np
import pytest
from phase_pictures import needs
from tile_pictures import EACH_WIDTH, WIDTHS, check_same, crowd, picture

from study.core import registry
from study.pictures import images

PHASES = ["opt6_wide", "opt7_tiles", "opt8_streams"]
SIZE = (80, 45)

pytestmark = needs(PHASES[0])


@functools.cache
def baselines(name: str) -> dict:
    with tempfile.TemporaryDirectory() as folder:
        return picture("baseline", registry.groups()[name].path, Path(folder), SIZE)


def peak_error(mine: dict, other: dict) -> float:
    """PSNR of two pictures' linear colours of peak 1, in dB."""
    square = np.mean((images.rgb(mine) - images.rgb(other)) ** 2)
    return -10 * np.log10(max(square, 1e-30))


@pytest.mark.parametrize("width", EACH_WIDTH)
@pytest.mark.parametrize("name", ["csg", "metaballs", "bumpy"])
@pytest.mark.parametrize("phase", PHASES)
def test_pictures_are_baselines(phase: str, name: str, width: str, tmp_path: Path) -> None:
    scene, theirs = registry.groups()[name].path, baselines(name)
    mine = picture(phase, scene, tmp_path, SIZE, **WIDTHS[width])
    few = mine["Z"].size // 1000
    assert (mine["id"] != theirs["id"]).sum() <= few
    both = np.isfinite(mine["Z"]) & np.isfinite(theirs["Z"])
    apart = np.abs(mine["Z"][both] - theirs["Z"][both])
    assert (~(apart <= 1e-5 * np.abs(theirs["Z"][both]))).sum() <= few
    assert peak_error(mine, theirs) >= 50


def grouped(scene: dict) -> dict:
    """The scene with all its solids in one sharp union."""
    whole = copy.deepcopy(scene)
    floors = [s for s in whole["shapes"] if s["type"] == "plane"]
    solids = [s for s in whole["shapes"] if s["type"] != "plane"]
    union = {"type": "group", "operation": "union", "position": [0.5, -0.25, 12], "shapes": solids}
    for solid in solids:
        solid["position"] = (np.array(solid["position"]) - union["position"]).tolist()
    return whole | {"shapes": [*floors, union]}


@pytest.mark.parametrize("shadows", ["soft", "hard", "ideal"])
@pytest.mark.parametrize("phase", PHASES)
def test_a_sharp_union_is_its_shapes(phase: str, shadows: str, tmp_path: Path) -> None:
    """Mirrors and floors too. But the group is one shape: its number is 1."""
    plain = crowd(5, 14, shadows)
    mine, parts = (picture(phase, scene, tmp_path) for scene in (grouped(plain), plain))
    parts["id"] = np.minimum(parts["id"], 1)
    check_same(mine, parts, f"{phase}, {shadows}")


def test_clusters_of_a_molecule(tmp_path: Path) -> None:
    """A large union is sorted into clusters; opt6_wide runs the whole program."""
    scene = registry.large()["molecule"].path
    mine, parents = (picture(phase, scene, tmp_path, (32, 18)) for phase in ("opt8_streams", "opt6_wide"))
    check_same(mine, parents, "molecule")


@pytest.mark.parametrize("phase", ["opt8_streams", "opt9_convex", "opt10_scene"])
def test_an_intersection_clears_no_soft_shadow(phase: str, tmp_path: Path) -> None:
    """The greater of two distances is no distance: near it the estimator darkens rays whose cone is free."""
    boxes = [
        {"half_size": [0.429, 0.703, 0.766], "rounding": 0.258, "position": [-0.979, -0.421, -0.606]},
        {"half_size": [0.595, 0.987, 0.392], "position": [0.166, 0.944, -0.243]},
    ]
    inside = [{"type": "box", "material": "a"} | box for box in boxes]
    scene = crowd(1, 1, "soft")
    scene["materials"]["a"] = {"color": [0.6, 0.5, 0.4], "reflectivity": 0, "shininess": 15}
    scene["camera"] |= {"position": [2.169, 1.145, -6.599], "look_at": [0, 0, 0], "vertical_fov_degrees": 50}
    scene["light"] |= {"position": [-1.249, 4.059, -2.787], "shadow_strength": 8}
    scene["shapes"] = [
        {"type": "group", "operation": "intersection", "position": [0, -0.8, 0], "shapes": inside},
        {"type": "plane", "normal": [0, 1, 0], "offset": -2.0, "material": "a"},
    ]
    mine, theirs = (picture(name, scene, tmp_path, (123, 75)) for name in (phase, "baseline"))
    assert (np.abs(images.rgb(mine) - images.rgb(theirs)).max(axis=-1) > 0.05).sum() <= 3


@pytest.mark.parametrize("width", EACH_WIDTH)
def test_a_blends_passes_come_to_an_end(width: str, tmp_path: Path) -> None:
    """Rounding must not raise the level that they lower: two lanes would take turns for ever."""
    scene = registry.groups()["metaballs"].path
    for phase in ("opt6_wide", "opt9_convex"):
        picture(phase, scene, tmp_path, (640, 360), "--warmup", 1, "--reps", 3, **WIDTHS[width])
