"""Errors of hits by hand, and how they are said."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from study.measuring import hit_tables, hits
from study.measuring.schema import Gain, HitErrors
from study.pictures.images import Picture


def planes(**other: list[float]) -> Picture:
    """A picture of four pixels in a row; truth's planes among its own."""
    base = {"id": [0, 0, 1, -1], "Z": [1, 2, 3, np.inf], "status": [2] * 4, "status.all": [2] * 4}
    base |= {name: [0.5] * 4 for name in "RGB"} | {f"N.{axis}": [0] * 4 for axis in "xyz"}
    base |= {"evals": [1] * 4} | other
    return Picture({name: np.array([row], np.float32) for name, row in base.items()})


MADE = planes(id=[0, -1, 0, 1], Z=[1.25, np.inf, 3, 9], R=[0.5, 0.5, 0.5, 1.0])


def test_errors_by_hand() -> None:
    same, found = hits.errors(planes(), planes()), hits.errors(planes(), MADE)
    assert same.wrong_ppm == 0 and same.psnr_db is None and same.judged == same.known == 1
    assert found.false_hits_ppm == found.false_misses_ppm == found.wrong_shape_ppm == 250_000
    assert found.wrong_ppm == 750_000 and found.dt_p50 == found.dt_p100 == 0.25
    assert found.psnr_db == pytest.approx(-10 * math.log10(0.25 / 12))
    found = hits.errors(planes(), planes(Z=[1, 2, np.nan, np.inf]))
    assert found.false_misses_ppm == 250_000
    found = hits.errors(planes(), planes(R=[0, 0, 0, np.nan]))
    assert found.non_finite == 1 and found.psnr_db and math.isnan(found.psnr_db)


def test_errors_are_of_the_pixels_that_truth_knows() -> None:
    found = hits.errors(planes(status=[2, 2, 2, 0]), MADE)
    assert (found.false_hits_ppm, found.known) == (0, 0.75)
    assert found.false_misses_ppm == pytest.approx(1e6 / 3)
    beside = hits.errors(planes(status=[1, 1, 1, 2]), MADE)  # a fractal and the air about it, which is proved
    assert (beside.wrong_ppm, beside.judged, beside.known) == (1_000_000, 0.25, 1)
    assert hit_tables.ppm(beside).startswith("1,000,000 (of 25\u00a0%")
    assert hits.errors(planes(status=[1, 1, 1, 0]), MADE).false_misses_ppm == pytest.approx(1e6 / 3)
    assert math.isnan(hits.errors(planes(status=[0] * 4), MADE).wrong_ppm or 0)


def test_how_errors_are_said() -> None:
    assert hit_tables.error(HitErrors(psnr_db=49.66, wrong_ppm=417.2)).startswith("49.7 dB, 417 ppm")
    assert hit_tables.error(HitErrors(wrong_ppm=0)).startswith("identical, 0 ppm")
    rows = [("a", HitErrors(non_finite=0)), ("b", HitErrors(non_finite=3)), ("c", HitErrors())]
    assert [line.split(":")[0] for line in hit_tables.not_finite(rows)] == ["b"]


@pytest.mark.parametrize(
    ("low", "high", "said"),
    [(1.01, 1.2, "gain"), (0.98, 1.3, "cannot be told"), (0.7, 0.99, "loss"), (1.0, 1.2, "cannot be told"),
     (None, None, "cannot be told"), (math.nan, math.nan, "cannot be told")],
)  # fmt: skip
def test_a_gain_is_one_where_its_interval_says_so(low: float, high: float, said: str) -> None:
    assert hit_tables.verdict(Gain(gain=1.05, gain_low=low, gain_high=high)) == said


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
