"""Boxes with rounding, and the scene that has them: by the words of its description, and what they cost."""

from __future__ import annotations

import itertools
import json

import numpy as np
import pytest
from phase_pictures import check_bits, picture, render

from conformance.feature_scenes import CELLS, TURNED, scene, shape
from conformance.harness import call, distances
from study.core import registry
from study.core.build import build
from study.pictures import images

LATTICE = registry.find_scene("lattice")
PHASES = list(registry.phases())


def described(p: np.ndarray) -> np.ndarray:
    """The words: q = mod(p, 4) − 2; the less of a cube, |max(|q| − 1, 0)| − 0.1 + min(0, most of |q| − 1),
    and a sphere of radius 1.3."""
    q = np.mod(p, 4) - 2
    over = np.abs(q) - 1
    cube = np.linalg.norm(np.maximum(over, 0), axis=1) - 0.1 + np.minimum(0, over.max(axis=1))
    return np.minimum(cube, np.linalg.norm(q, axis=1) - 1.3)


def points(count: int) -> np.ndarray:
    """In 40³ about the origin, a third of them near the surface; as floats have them."""
    random = np.random.default_rng(4)
    p = random.uniform(-20, 20, (count, 3))
    near = p[: count // 3]
    for _ in range(2):
        here = described(near)
        slope = [(described(near + step) - here) / 1e-4 for step in np.eye(3) * 1e-4]
        near -= here[:, None] * np.array(slope).T
    return p.astype(np.float32).astype(float)


@pytest.mark.slow
@pytest.mark.parametrize("phase", PHASES)
def test_the_lattice_is_as_described(phase):
    """Every phase of the ladder; a system beside it may refuse the scene."""
    drawn = call(phase, LATTICE.path, "-n", 1)
    if drawn.status == 4 and registry.phases()[phase].family == registry.SYSTEMS:
        return
    assert drawn.status == 0
    p = points(1500)
    found, nearest = distances(phase, LATTICE.path, p)
    wall = np.abs(np.mod(p, 4)).min(axis=1)
    assert (np.minimum(wall, 4 - wall) > 1e-6).all(), "on a cell's wall either side is right"
    off = np.abs(found - described(p))
    tolerance = 1e-14 * 40 if registry.phases()[phase].precision == "double" else 32 * 2.0**-23 * 35
    assert (off <= tolerance).all(), f"off by {off.max():.2e} at {p[off.argmax()]}"
    assert (nearest == 0).sum() > 100 and (nearest == 1).sum() > 100


def test_its_nearest_copy_is_the_cells_own():
    """So that the union of the repeated shapes is exact: over all copies, none is nearer."""
    p = np.random.default_rng(5).uniform(0, 4, (4000, 3))
    least = np.full(len(p), np.inf)
    for cell in itertools.product(range(-1, 2), repeat=3):
        q = p - 2 - 4 * np.array(cell)
        over = np.abs(q) - 1
        cube = np.linalg.norm(np.maximum(over, 0), axis=1) - 0.1 + np.minimum(0, over.max(axis=1))
        least = np.minimum(least, np.minimum(cube, np.linalg.norm(q, axis=1) - 1.3))
    assert np.abs(least - described(p)).max() == 0


@pytest.mark.slow
@pytest.mark.parametrize("phase", ["baseline", "opt4"])
def test_none_costs_nothing(phase, tmp_path):
    """A rounding of 0 is none: not a bit, and not a count, is different."""
    planes, records = [], []
    for more in ({}, {"rounding": 0}):
        box = scene([shape("box", repeat=CELLS, **TURNED, **more)])
        done = render(build(phase, "render-count"), box, tmp_path, size=(16, 9))
        planes.append(images.read(tmp_path / "picture.exr"))
        records.append(json.loads(done.stdout)["by_function"])
    check_bits(*planes)
    assert records[0] == records[1] and not records[1].get("sdf_rounded_box", {}).get("calls")


@pytest.mark.parametrize(("rounding", "half"), [(1e-9, 1), (1e-4, 1), (0.5, 1e-9), (5, 0.1)])
def test_extremes_against_truth(rounding, half, tmp_path):
    """Rounding that float does not see, boxes that are nearly balls: where solids are hit in closed form."""
    whole = scene([shape("box", half_size=[half] * 3, rounding=rounding, rotation_degrees=[30, 40, 0])])
    whole["camera"]["position"] = [0.4, 1.1, -4 * (half + rounding)]
    mine, exact = (picture(phase, whole, tmp_path, size=(48, 27)) for phase in ("opt9_convex", "truth"))
    assert np.array_equal(mine["id"], exact["id"]) and 0.05 < (exact["id"] >= 0).mean() < 0.9
    hit = exact["id"] >= 0
    assert np.abs(mine["Z"][hit] - exact["Z"][hit]).max() <= 4e-6 * exact["Z"][hit].max()
    turned = np.stack([mine[f"N.{a}"] - exact[f"N.{a}"] for a in "xyz"], axis=-1)[hit]
    few = 0.005 if rounding > 1e-8 else 0.0
    assert (np.linalg.norm(turned, axis=-1) > 1e-3).mean() <= few
