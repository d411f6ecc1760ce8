"""Boxes with rounding: what none costs, and extremes (distances: tests/conformance/test_distances.py)."""

from __future__ import annotations

import json

import numpy as np
import pytest
from phase_pictures import check_bits, picture, render

from conformance.feature_scenes import CELLS, TURNED, scene, shape
from study.core.build import build
from study.pictures import images


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
