"""Tolerances as phases declare them, and judging by them."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from complete import FRACTAL, SMOOTH, bound, phase

from study.core import registry
from study.core.cli import StudyError
from study.pictures import gate, images


def test_a_scene_by_name_wins_over_its_class():
    declared = {"smooth": bound(psnr_db=50), "trio": bound(psnr_db=60), "fractal": bound(psnr_db=30)}
    assert gate.tolerance(phase(declared), SMOOTH)["psnr_db"] == 60
    assert gate.tolerance(phase(declared), FRACTAL)["psnr_db"] == 30
    del declared["trio"]
    assert gate.tolerance(phase(declared), SMOOTH)["psnr_db"] == 50


def test_a_class_without_tolerance_fails(blank):
    none = gate.tolerance(phase({"smooth": bound(psnr_db=50)}), FRACTAL)
    assert none is None
    assert list(gate.failures(images.compare(blank(), blank()), none)) == ["tolerance"]


@pytest.mark.parametrize(
    "declared, message",
    [
        (bound(psnr=50), r"smooth\.psnr: "),
        (bound(antialiased={"flip_mean": 1}), r"antialiased\.flip_mean: "),
        ({"psnr_db": 50}, r"smooth: "),
        (bound(reason=" ", psnr_db=50), r"smooth: "),
        (bound(), r"smooth: "),
        (bound(psnr_db=math.nan), r"smooth\.psnr_db: nan"),
        (bound(psnr_db="50"), r"smooth\.psnr_db: '50'"),
        (bound(psnr_db=True), r"smooth\.psnr_db: True"),
        (bound(identical=False), r"smooth\.identical: False"),
        (bound(identical=1), r"smooth\.identical: 1"),
    ],
)
def test_a_tolerance_that_says_nothing_clear_is_refused(declared, message):
    with pytest.raises(StudyError, match=message):
        gate.check(phase({"smooth": declared}))


def test_a_tolerance_for_what_is_no_scene_is_refused():
    with pytest.raises(StudyError, match=r"tolerance\.smoth: "):
        gate.check(phase({"smoth": bound(psnr_db=50)}))


@pytest.mark.parametrize("name", registry.ladder())
def test_what_the_phases_declare_is_understood(name):
    gate.check(registry.find_phase(name))


# --- judging


def outside(bounds: dict, **metrics: object) -> list[str]:
    return list(gate.failures({"non_finite": 0, **metrics}, bounds))


@pytest.mark.parametrize("name", ["psnr_db", "psnr_display_db", "depth_agree_fraction"])
def test_lower_bounds(name):
    values = [50, 50.1, math.inf, 49.9, math.nan]
    assert [outside({name: 50}, **{name: value}) for value in values] == [[], [], [], [name], [name]]


@pytest.mark.parametrize(
    "name", ["dt_p99", "max_abs", "flip_mean", "mask_mismatch_ppm", "normal_p99_degrees"]
)
def test_upper_bounds(name):
    values = [0.5, 0.1, 0.6, math.nan, math.inf]
    assert [outside({name: 0.5}, **{name: value}) for value in values] == [[], [], [name], [name], [name]]


def test_what_was_not_measured_is_outside():
    assert outside({"dt_p99": 1}) == ["dt_p99"]
    assert list(gate.failures({"psnr_db": 99}, {"psnr_db": 50})) == ["non_finite"]


def test_bounds_of_the_antialiased_picture():
    bounds = {"antialiased": {"psnr_db": 30, "fraction_over_1_255": 0.1}}
    assert outside(bounds, antialiased={"psnr_db": 31, "fraction_over_1_255": 0.1}) == []
    both = ["antialiased.psnr_db", "antialiased.fraction_over_1_255"]
    assert outside(bounds, antialiased={"psnr_db": 29, "fraction_over_1_255": 0.2}) == both
    assert outside(bounds, psnr_db=99) == both


def test_no_tolerance_lets_a_sample_pass_that_is_not_finite(blank):
    picture = blank()
    picture["R"][0, 0] = math.nan
    found = gate.failures(images.compare(picture, picture), bound(identical=True, mask_mismatch_ppm=1e6))
    assert list(found) == ["non_finite"]
    found = gate.failures(
        images.compare(picture, picture), bound(psnr_db=0, fraction_over_1_255=1, max_abs=1e9)
    )
    assert list(found) == ["non_finite", "psnr_db", "fraction_over_1_255", "max_abs"]
    large = images.compare(blank(), blank(), (picture, picture))
    assert list(gate.failures(large, bound(psnr_db=50))) == ["antialiased.non_finite"]


def test_failures_come_in_the_order_of_the_gate_with_value_and_bound():
    metrics = {"psnr_db": 47.3, "mask_mismatch_ppm": 30.0, "identical": False, "non_finite": 0}
    found = gate.failures(metrics, {"psnr_db": 55, "mask_mismatch_ppm": 20, "identical": True})
    assert list(found) == ["identical", "mask_mismatch_ppm", "psnr_db"]
    assert re.findall(r"[\d.]+", found["psnr_db"]) == ["47.3", "55"]
    assert re.findall(r"[\d.]+", found["mask_mismatch_ppm"]) == ["30", "20"]


def test_identical_pictures_pass_every_bound(blank):
    metrics = images.compare(blank(), blank(), (blank(40, 40), blank(40, 40)))
    bounds = {name: 1000 if name in gate.AT_LEAST else 0 for name in gate.METRICS}
    assert not gate.failures(metrics, {**bounds, "depth_agree_fraction": 1, "identical": True})


def test_without_flip_its_bounds_are_left_out_and_said_so(monkeypatch):
    """No wheel for Python 3.14: the other bounds hold on."""
    declared = {"flip_mean": 1e-5, "psnr_db": 50, "reason": "x"}
    assert set(gate.failures({"psnr_db": 40, "non_finite": 0}, declared)) == {"flip_mean", "psnr_db"}
    monkeypatch.setattr(images, "HAS_FLIP", False)
    assert set(gate.failures({"psnr_db": 40, "non_finite": 0}, declared)) == {"psnr_db"}
    black = np.zeros((2, 2, 3), np.float32)
    assert "flip_mean" not in images.colour_errors(black, black)
