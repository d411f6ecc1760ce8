"""opt9_convex, opt10_scene, opt11_ideal: groups by closed forms and by marches within brackets.

Pictures are held against baseline's, whose fields are plain recursion.
"""

from __future__ import annotations

import functools
import json
import math
import os
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import programs
import pytest
from phase_pictures import needs
from tile_pictures import EACH_WIDTH, WIDTHS, crowd, picture

from builds import GROUPS_BY_CLANG
from study.core import registry
from study.pictures import images

PHASES = ["opt9_convex", "opt10_scene", "opt11_ideal"]
SIZE = (96, 54)

pytestmark = needs(PHASES[0])


@functools.cache
def baselines(text: str) -> dict:
    with tempfile.TemporaryDirectory() as folder:
        return picture("baseline", json.loads(text), Path(folder), SIZE)


def psnr(mine: dict, other: dict) -> float:
    """PSNR of two pictures' linear colours, of peak 1, in dB."""
    square = np.mean((images.rgb(mine) - images.rgb(other)) ** 2)
    return -10 * np.log10(max(square, 1e-30))


def check(phase: str, scene: dict, tmp_path: Path, least: float, width: str = next(iter(WIDTHS))) -> None:
    """Holds the phase's picture against baseline's: hits, distances, colours by `least` dB."""
    theirs = baselines(json.dumps(scene))
    mine = picture(phase, scene, tmp_path, SIZE, **WIDTHS[width])
    few = mine["Z"].size // 1000
    assert (mine["id"] != theirs["id"]).sum() <= few
    both = np.isfinite(mine["Z"]) & np.isfinite(theirs["Z"])
    assert both.sum() > 100
    apart = np.abs(mine["Z"][both] - theirs["Z"][both])
    assert (~(apart <= 2e-5 * theirs["Z"][both])).sum() <= few
    assert psnr(mine, theirs) >= least


def scene_of(name: str, shadows: str) -> dict:
    scene: dict[str, Any] = json.loads(registry.groups()[name].path.read_text())
    scene["light"]["shadows"] = shadows
    return scene


@pytest.mark.parametrize("width", EACH_WIDTH)
@pytest.mark.parametrize("name", ["csg", "metaballs", "bumpy"])
def test_hard_shadows_and_hits_are_baselines(name: str, width: str, tmp_path: Path) -> None:
    check("opt9_convex", scene_of(name, "hard"), tmp_path, 50, width)


@pytest.mark.parametrize("name", ["csg", "metaballs", "bumpy"])
def test_soft_shadows_take_the_estimators_steps(name: str, tmp_path: Path) -> None:
    check("opt10_scene", scene_of(name, "soft"), tmp_path, 50)


@pytest.mark.parametrize(("name", "least"), [("csg", 50), ("metaballs", 88), ("bumpy", 50)])
def test_ideal_shadows_are_found(name: str, least: float, tmp_path: Path) -> None:
    check("opt11_ideal", scene_of(name, "ideal"), tmp_path, least)


@pytest.mark.parametrize("name", ["csg", "bumpy"])
def test_ideal_shadows_are_as_declared(name: str, tmp_path: Path) -> None:
    """At n = 180: 80 dB, linear and as displayed. Rays of bumpy begin at an edge: dips at t < 0.003."""
    scene, size = scene_of(name, "soft"), (320, 180)
    exact, mine = (picture(phase, scene, tmp_path, size) for phase in ("truth", "opt11_ideal"))
    colours = images.rgb(exact, "ideal."), images.rgb(mine)
    shown = [images.to_display(c) / 255.0 for c in colours]
    for one, other in (colours, shown):
        assert -10 * np.log10(np.mean((one - other) ** 2)) >= 80


def solid(kind: str, **keys: Any) -> dict:
    return {"type": kind, "material": "a", **keys}


def group(operation: str, *shapes: dict, **keys: Any) -> dict:
    return {"type": "group", "operation": operation, "shapes": [*shapes], **keys}


# The mirror's plane cuts the box and the cone, the half-space the union; one cut has a cut itself.
CUT = group(
    "difference",
    group(
        "intersection",
        group(
            "union",
            solid("box", half_size=[0.9, 0.7, 0.8], position=[0.6, 0.1, 0], rotation_degrees=[10, 40, 5]),
            solid("cone", bottom_radius=0.8, top_radius=0.3, half_height=0.9, position=[0.3, 0.9, 0.2]),
            group("union", solid("octahedron", radius=1.1), mirror="xz", position=[1.9, -0.3, 0.1]),
            mirror="x",
        ),
        solid("plane", normal=[0.1, 0.98, -0.17], offset=1.1),
        solid("sphere", radius=3),
    ),
    group(
        "difference",
        solid("capsule", radius=0.45, half_height=2, rotation_degrees=[80, 10, 0]),
        solid("sphere", radius=0.4, position=[0, 0.1, -1.2]),
    ),
    solid("capsule", radius=0.3, half_height=0.8, position=[1.6, 0, -0.6], rotation_degrees=[0, 0, 60]),
    position=[0.1, 0, 12],
    rotation_degrees=[15, 25, 0],
)


@pytest.mark.parametrize("width", EACH_WIDTH)
def test_cuts_mirrors_and_half_spaces_meet_rays_as_their_field_does(width: str, tmp_path: Path) -> None:
    check("opt9_convex", over_floor("hard", CUT), tmp_path, 50, width)


def test_rays_along_a_half_spaces_face_are_in_it_or_not(tmp_path: Path) -> None:
    """The middle row is level with the cuts, the middle column lies in the mirror's plane: slopes of 0."""
    ball, below = solid("sphere", radius=0.9), {"normal": [0, 1, 0]}
    cuts = [
        group("intersection", ball, solid("plane", offset=height, **below), position=[x, 0, 12])
        for x, height in ((-2, 0.4), (2, -0.3))
    ]
    pair = group("union", solid("box", half_size=[0.5, 0.9, 0.5], position=[0.3, 0, 12]), mirror="x")
    scene = over_floor("hard", *cuts, pair)
    scene["camera"] |= {"position": [0, 0, 0], "look_at": [0, 0, 12]}
    theirs, mine = (picture(name, scene, tmp_path, (97, 55)) for name in ("baseline", "opt9_convex"))
    assert np.array_equal(mine["id"], theirs["id"]), np.argwhere(mine["id"] != theirs["id"]).tolist()


def lens(**keys: Any) -> dict:
    ball = solid("sphere", radius=0.7, position=[0.3, 0, 0])
    return group("intersection", ball, solid("box", half_size=[0.5, 0.9, 0.5]), **keys)


# What is taken away is an intersection; two joined, one of which is cut; and images of one that their mirrors
# cut, whose outside is more parts than a group may have: it is marched.
TAKEN = [
    lens(position=[0.6, 0.4, -0.8]),
    group("union", lens(), group("difference", lens(position=[0, 0.8, 0]), solid("sphere", radius=0.6))),
    group("union", lens(position=[0.2, 0.3, -0.8]), mirror="xyz"),
]


@pytest.mark.parametrize("taken", range(len(TAKEN)))
def test_what_is_taken_away_leaves_what_its_field_does(taken: int, tmp_path: Path) -> None:
    whole = group("union", solid("box", half_size=[1.2, 0.8, 0.9]), solid("octahedron", radius=1.7))
    cut = group("difference", whole, TAKEN[taken], position=[0, 0, 12], rotation_degrees=[10, 30, 0])
    check("opt9_convex", over_floor("hard", cut), tmp_path, 50)
    check("opt11_ideal", over_floor("ideal", cut), tmp_path, 50)


def over_floor(shadows: str, *shapes: dict) -> dict:
    scene = scene_of("csg", shadows)
    scene["materials"]["a"] = {"color": [0.5, 0.4, 0.3], "reflectivity": 0.2, "shininess": 20}
    scene["shapes"][1:] = shapes
    return scene


def test_a_sharp_hit_has_the_surface_of_its_leaf(tmp_path: Path) -> None:
    """Each leaf has a colour of its own; of two that are equal the first decides."""
    kept = group(
        "union",
        solid("box", half_size=[0.9, 0.7, 0.8], material="a"),
        solid("capsule", radius=0.6, half_height=0.9, position=[0.9, 0.3, 0.2], material="b"),
        solid("sphere", radius=0.8, position=[0, 0.8, 0], material="c"),
        solid("sphere", radius=0.8, position=[0, 0.8, 0], material="d"),
        solid("octahedron", radius=0.9, position=[-0.8, 0.2, -0.5], material="e"),
    )
    whole = group(
        "difference",
        group("intersection", kept, solid("plane", normal=[0.2, 0.9, -0.387], offset=1.1, material="f")),
        solid(
            "cone", bottom_radius=0.5, top_radius=0.2, half_height=1, position=[0.3, 0, -0.6], material="g"
        ),
        position=[0, 0, 12],
        rotation_degrees=[10, 30, 0],
        mirror="x",
    )
    scene = over_floor("none", whole)
    scene["materials"] |= {
        name: {"color": [k % 2, k // 2 % 2, k // 4 / 2 + 0.2], "reflectivity": 0.1 * k, "shininess": 5 + k}
        for k, name in enumerate("abcdefg")
    }
    check("opt9_convex", scene, tmp_path, 50)
    theirs, mine = baselines(json.dumps(scene)), picture("opt9_convex", scene, tmp_path, SIZE)
    seen = (mine["id"] > 0) & (theirs["id"] > 0)
    apart = sum(mine[n] * theirs[n] for n in ("N.x", "N.y", "N.z"))[seen]
    assert seen.sum() > 300 and (apart < 0.9999).sum() <= 2  # on an edge another leaf may decide
    assert (np.abs(images.rgb(mine) - images.rgb(theirs)).max(-1) > 0.01).sum() <= 4


# Solids that lie apart: what cuts one of them is far from the first.
PARTS = group(
    "union",
    group(
        "difference",
        group("union", *(solid("sphere", radius=0.7, position=[x, 0.5, 0]) for x in (-2, 0.3))),
        solid("capsule", radius=0.3, half_height=1, position=[0.3, 0.5, 0], rotation_degrees=[90, 0, 0]),
    ),
    group(
        "difference",
        solid("box", half_size=[0.7, 0.6, 0.5], position=[2.3, 0, 0]),
        solid("sphere", radius=0.3, position=[1.6, 0.6, -0.5]),
    ),
    solid("capsule", radius=0.25, half_height=0.5, position=[-1, -0.7, -1], rotation_degrees=[0, 0, 70]),
    position=[0, 0, 13],
)
# More than 16 balls: they stand in a hierarchy.
MANY = group(
    "union",
    *(
        solid(
            "sphere", radius=0.2 + 0.01 * i, position=[3.2 * math.sin(7 * i), 1.3 * math.sin(3 * i), i / 12]
        )
        for i in range(1, 33)
    ),
    blend=0.15,
    position=[0, 0, 13],
)
TURNED = MANY | {"rotation_degrees": [20, 50, 130]}
# The field is less than the way to the solids: their shadows reach beyond a solid's own.
STEEP = group(
    "union",
    solid("sphere", radius=0.7, position=[-2, 0.2, 0], displace={"amplitude": 0.06, "frequency": [9, 8, 7]}),
    solid("ellipsoid", radius=[0.9, 0.3, 0.6], rotation_degrees=[20, 0, 30]),
    solid("sphere", radius=0.5, position=[1.9, 0.2, 0.1]),
    blend=0.2,
    position=[0, 0, 13],
)


@pytest.mark.parametrize("phase", ["opt9_convex", "opt11_ideal"])
@pytest.mark.parametrize("shapes", [PARTS, MANY, TURNED, STEEP], ids=["parts", "many", "turned", "steep"])
def test_parts_that_lie_apart_have_their_shadows(phase: str, shapes: dict, tmp_path: Path) -> None:
    shadows = "ideal" if phase == "opt11_ideal" else "soft" if shapes is STEEP else "hard"
    check(phase, over_floor(shadows, shapes), tmp_path, 50)


def test_a_shadow_ray_that_begins_inside_is_dark(tmp_path: Path) -> None:
    scene = over_floor("hard", PARTS | {"position": [0, -0.8, 13]})
    scene["march"]["surface_offset"] = 0.3
    check("opt9_convex", scene, tmp_path, 50)


def test_a_steep_field_is_marched_to_its_end(tmp_path: Path) -> None:
    """A round pill is itself however it is twisted. Here that makes the slope 135: over a thousand steps."""
    pill = solid("capsule", radius=0.3, half_height=0.6, position=[0, 0, 12])
    scenes = [over_floor("hard", one) for one in (pill, pill | {"twist": 450})]
    plain, mine = (picture("opt9_convex", scene, tmp_path, SIZE) for scene in scenes)
    assert np.array_equal(mine["id"], plain["id"]) and psnr(mine, plain) >= 50


@pytest.mark.parametrize("phase", ["opt9_convex", "opt11_ideal"])
def test_a_sharp_union_is_its_solids(phase: str, tmp_path: Path) -> None:
    """With soft shadows: the march's of all solids, and of the one group."""
    plain = crowd(5, 8, "soft")
    floors = [s for s in plain["shapes"] if s["type"] == "plane"]
    solids = [s for s in plain["shapes"] if s["type"] != "plane"]
    whole = plain | {"shapes": [*floors, group("union", *solids)]}
    mine, parts = (picture(phase, scene, tmp_path, SIZE) for scene in (whole, plain))
    few = mine["Z"].size // 1000
    assert (np.isfinite(mine["Z"]) != np.isfinite(parts["Z"])).sum() <= few
    assert psnr(mine, parts) >= 50


@pytest.mark.parametrize("keys", [{"repeat": [9, 0, 9]}, {"shell": 0.05}, {"offset": 0.1}])
def test_groups_without_brackets_are_marched(keys: dict, tmp_path: Path) -> None:
    scene = scene_of("metaballs", "hard")
    scene["shapes"][0] |= keys
    check("opt9_convex", scene, tmp_path, 45)


@pytest.mark.slow
@pytest.mark.parametrize("width", EACH_WIDTH)
@pytest.mark.parametrize("name", ["csg", "metaballs", "bumpy"])
def test_what_clang_makes_draws_them_too(name: str, width: str, tmp_path: Path) -> None:
    """Its own rounding and order of sums: nearly gcc's picture, and no crash."""
    phase, out = GROUPS_BY_CLANG, tmp_path / "clang.exr"
    program = programs.built(f"{phase}/render", "build/clang")
    scene = tmp_path / "groups.json"
    scene.write_text(json.dumps(scene_of(name, "ideal")))
    words = [program, scene, "-n", str(SIZE[1]), "-w", str(SIZE[0]), "-o", out]
    subprocess.run(words, check=True, env=os.environ | {"STEPWISE_CC": "none", **WIDTHS[width]})
    mine = picture(phase, json.loads(scene.read_text()), tmp_path, SIZE, **WIDTHS[width])
    assert psnr(images.read(out), mine) >= 60
