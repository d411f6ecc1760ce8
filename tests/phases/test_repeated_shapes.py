"""Repeated shapes of opt9_convex: against truth, which walks through the cells by proofs of its own."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from opt9_pictures import PHASE, looks, needs_opt9, picture
from soft_shadows import clamped, lit

from conformance.feature_scenes import FLOOR, TURNED, scene, shape

pytestmark = needs_opt9


GRID = [4.4, 4.2, 5]
LATTICE = shape("box", repeat=GRID, **TURNED)
AGLOW = {"light": {"emission": [90, 80, 70]}, "background": [0.9, 0.5, 0.1]}

# Repeated shapes, held against truth, which walks through the cells by proofs of its own.
REPEATED = {
    "every shape, turned": scene(
        [
            shape(kind, repeat=[7, 6, 8], rotation_degrees=[25, -40, 70], position=[i, 2 - i, 2 * i])
            for i, kind in enumerate(["sphere", "box", "octahedron"])
        ]
    ),
    "a box whose cell is cut short by its sides": scene(
        [shape("box", half_size=[2.1, 0.3, 2], repeat=GRID)], camera=looks([0.4, 1.1, 0.3], [1, 0.9, 9])
    ),
    "in one frame: boxes, spheres and tori, turned": scene(
        [
            shape("torus", repeat=GRID, major_radius=1.1, minor_radius=0.25, **TURNED),
            shape("box", repeat=GRID, half_size=[0.8, 0.7, 0.9], **TURNED),
            shape("sphere", repeat=GRID, radius=1.05, **TURNED),
        ]
    ),
    "many cells abreast": scene(
        [shape("sphere", repeat=[1, 1, 1], radius=0.1), shape("octahedron", repeat=[1, 1, 1], radius=0.12)],
        march={"bounds_radius": 24},
        camera=looks([0.5, 0.5, 0.5], [3, 1.5, 9]),
    ),
    "rounded boxes, mirrors and hard shadows": scene(
        [shape("box", rounding=0.2, repeat=[4, 0, 4], half_size=[0.9, 0.7, 0.8], material="mirror"), FLOOR],
        light=lit("hard", [1, 3, -3]) | {"emission": [90, 80, 70]},
    ),
    "along walls of cells": scene(
        [shape("box", repeat=GRID, rotation_degrees=[90, 0, 0])],
        camera=looks([2.2, 2.43, -2.17], [2.2, 1.31, 9]),
    ),
    "copies beyond the bounds": scene(
        [shape("octahedron", repeat=GRID)],
        march={"bounds_radius": 9},
        background=[0.3, 0.1, 0.1],
        camera=looks([0.4, 2.1, -5], [0, 2.1, 0]),
    ),
    "cells of negative numbers": scene(
        [LATTICE, shape("sphere", radius=0.7, position=[2, 2, 2.4], repeat=GRID)],
        camera=looks([-37, -22, -41], [-60, -30, -70]),
    ),
    "mirrors": scene(
        [LATTICE | {"material": "mirror"}], camera=looks([2.2, 2.1, -2.5], [2.2, 1.1, 9]), **AGLOW
    ),
    "soft shadows": scene(
        [
            FLOOR,
            shape("sphere", repeat=[4, 0, 4], radius=1),
            shape("box", repeat=[5, 0, 0], position=[0, 1.5, -1], half_size=[0.3, 0.3, 0.3]),
        ],
        light=lit("soft", [3, 5, -1]),
    ),
    "800 cells away": scene(
        [shape("box", repeat=[7.5] * 3, half_size=[1.5, 0.75, 1.5], rotation_degrees=[90, 15, 15])],
        march={"bounds_radius": 1000},
        camera=looks([700, 31, -612], [0, 0.3, 9]),
    ),
}


def narrow(shapes: list[dict], eye: list[float], light: list[float], **more) -> dict:
    """So that 4 × 4 rays are near to each other: as bundles they go from cell to cell together.

    See repeated_bundles.c.
    """
    camera = looks(eye, [eye[0] + 2, eye[1] - 1.1, eye[2] + 4]) | {"vertical_fov_degrees": 20}
    return scene(shapes, camera=camera, light=lit("none", light), march={"bounds_radius": 30}, **more)


ROUND = {"rounding": 0.1, "half_size": [1, 0.9, 1.1]}
TWO_GRIDS = (("box", ROUND, GRID), ("sphere", {"radius": 0.7}, [3.1, 4.3, 3.7]), ("torus", {}, [7, 5, 6]))
REPEATED |= {
    "bundles, the light at the camera": narrow(
        [shape("box", repeat=GRID, **ROUND, **TURNED), shape("sphere", radius=1.3, repeat=GRID, **TURNED)],
        [-3.1, 3.3, -2.2],
        [-3.1, 3.3, -2.2],
        fog=1e-5,
    ),
    "bundles, a plane before and behind": narrow(
        [FLOOR, shape("sphere", radius=1.2, repeat=GRID), shape("box", repeat=[5, 0, 4.5])],
        [2.2, 2.0, -2.4],
        [2.2, 2.0, -2.4],
    ),
    "bundles among shapes repeated otherwise": narrow(
        [shape(kind, repeat=cell, **size) for kind, size, cell in TWO_GRIDS],
        [2.2, 2.0, -2.4],
        [2.2, 2.0, -2.4],
    ),
    "bundles with mirrors": narrow(
        [shape("sphere", radius=1.3, repeat=GRID), shape("box", repeat=GRID, **ROUND, material="mirror")],
        [2.2, 2.0, -2.4],
        [1, 3, -3],
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", REPEATED)
def test_repeated_shapes_are_truths(name: str, tmp_path: Path) -> None:
    """Silhouettes too: no ray is decided otherwise."""
    size = ("-n", "37", "-w", "65")
    mine, exact = (picture(REPEATED[name], tmp_path, *size, phase=phase) for phase in (PHASE, "truth"))
    proved = exact["status.all"] >= 1
    assert proved.mean() > 0.99 and (exact["id"] >= 0).mean() > 0.1
    assert np.array_equal(mine["id"][proved], exact["id"][proved])
    found = proved & (exact["id"] >= 0)
    apart = np.abs(mine["Z"][found] - exact["Z"][found]) / np.maximum(exact["Z"][found], 1)
    assert np.quantile(apart, 0.99) < 2e-6, np.quantile(apart, 0.99)
    assert np.abs(clamped(mine) - clamped(exact))[proved].max() < 1e-3


# Where the copies have no closed form together, the camera is in one of them, or mirror rays start in one:
# the march's picture.
FOLDED = {
    "soft shadows of the shape itself": scene(
        [shape("octahedron", repeat=GRID, **TURNED)], light=lit("soft", [3, 2, -3])
    ),
    "a shape wider than its cell": scene(
        [shape("sphere", repeat=[2, 0, 4], radius=1.3)], light=lit("soft", [3, 4, -1])
    ),
    "a cone along its axis": scene([shape("cone", repeat=[0, 2.5, 4])], light=lit("hard", [3, 4, -1])),
    "the camera inside of a copy": scene(
        [shape("box", repeat=GRID)], camera=looks([4.5, 0.2, 0.1], [0, 0.3, 9])
    ),
    "boxes, crevices": scene(
        [
            shape(
                "box",
                repeat=[2.5, 0, 1.9],
                rotation_degrees=[0, 20, 0],
                position=[0, -0.75, 3],
                material="mirror",
            )
        ],
        march={"surface_offset": 0.2},
        **AGLOW,
    ),
}


@pytest.mark.parametrize("name", FOLDED)
def test_repeated_shapes_where_a_march_is_the_picture(name: str, tmp_path: Path) -> None:
    """Three pixels of `crevices` are off: a ray from a copy is not asked of that copy again."""
    mine, march = (picture(FOLDED[name], tmp_path, phase=phase) for phase in (PHASE, "baseline"))
    assert (mine["id"] != march["id"]).sum() <= 2
    off = np.abs(clamped(mine) - clamped(march)).max(axis=-1)
    assert (off > 1 / 255).sum() <= 3, f"{(off > 1 / 255).sum()} pixels"


@pytest.mark.parametrize("name", ["scene0", "spheres40", "cubes", "many cells abreast"])
def test_lanes_and_threads_change_nothing(name: str, tmp_path: Path) -> None:
    whole = REPEATED.get(name, name)
    base = picture(whole, tmp_path)
    for other in (picture(whole, tmp_path, "--threads", "2"), picture(whole, tmp_path, lanes="avx2")):
        for plane, values in base.items():
            assert np.array_equal(values, other[plane], equal_nan=True), plane
