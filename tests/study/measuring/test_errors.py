"""Errors of made-up pictures, known by hand."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from study.measuring import hits


def test_errors_to_a_picture(blank, miss) -> None:
    reference, made = blank(10, 10, 0.5), blank(10, 10, 0.6)
    miss(made, (0, 0))
    for name in "RGB":
        made[name][0, 0] = 0.6
    found = hits.to_picture(reference, made)
    assert found["psnr_db"] == pytest.approx(20, abs=1e-4) and found["wrong_ppm"] == pytest.approx(10_000)
    checked = blank(8, 8, 0.5)
    for name in "RGB":
        checked[name] += np.float32(0.1) * (-1) ** np.add(*np.mgrid[:8, :8]).astype(np.float32)
    found = hits.to_picture(blank(8, 8, 0.5), checked, fractal=True)
    assert found["rmse"] < 1e-6 and found["depth_agree_fraction"] == 1  # it is gone in the 4 × 4 means
    assert hits.to_picture(blank(8, 8), checked)["psnr_db"] == pytest.approx(20, abs=1e-3)


def test_errors_to_truth_count_proved_pixels_and_known_colours(blank, miss) -> None:
    exact, made = blank(10, 10, 0.5), blank(10, 10, 0.5)
    for prefix, name in itertools.product(("ideal.", "none."), "RGB"):
        exact[prefix + name] = exact[name].copy()
    for name, value in (("shadow", 1), ("status", 2), ("status.all", 2)):
        exact[name] = np.full((10, 10), value, np.float32)
    miss(made, (slice(0, 2), 0))  # two wrong pixels, of which truth has proved one
    for name in "RGB":
        made[name][0, 0] = made[name][1, 0] = 0.5
    exact["status"][0, 0] = exact["status.all"][0, 0] = 0
    exact["R"][0, 0] = np.nan
    found = hits.to_truth(exact, made)
    assert found["wrong_ppm"] == pytest.approx(1e6 / 99)
    assert found["psnr_db"] is None and found["rmse"] == 0
