"""Figures of pictures.panels, stepwise pictures and stepwise demo: what must be seen in them is there."""

from __future__ import annotations

import json
import math
import re
import sys

import emitted
import numpy as np
import OpenImageIO as oiio
import pytest
import started
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from study.commands import demo, pictures
from study.core.cli import StudyError
from study.core.registry import ROOT, Spec
from study.numbers import accuracy
from study.numbers.schema import Verify
from study.pictures import images, panels


def pixels(path) -> np.ndarray:
    return oiio.ImageBuf(str(path)).get_pixels(oiio.UINT8)


def share_of(shown: np.ndarray, colour: tuple[int, int, int]) -> float:
    return float((shown == colour).all(axis=-1).mean())


# --- heat maps


@given(st.integers(1, 40), st.integers(1, 40), st.integers(1, 9), st.data())
def test_no_wrong_pixel_is_lost_when_a_heat_map_is_made_smaller(height, width, factor, data):
    plane = np.zeros((height, width), np.float32)
    y, x = data.draw(st.integers(0, height - 1)), data.draw(st.integers(0, width - 1))
    plane[y, x] = 1
    small = panels.block_max(plane, factor)
    assert small.shape == (math.ceil(height / factor), math.ceil(width / factor))
    assert small.sum() == 1 and small[y // factor, x // factor] == 1


def pair_figure(reference, image, metrics=None):
    metrics = metrics or images.compare(reference, image)
    return panels.pair((reference, image), ("baseline", "opt4"), "a title", metrics, ("one", "two", "three"))


@pytest.mark.slow
def test_a_single_wrong_pixel_of_a_large_picture_is_seen(tmp_path, blank):
    black, wrong = (blank(1080, 1920, grey=0) for _ in range(2))
    metrics = images.compare(blank(9, 16), blank(9, 16))  # words under the panels, which no one reads here
    same = pixels(panels.save(pair_figure(black, wrong, metrics), tmp_path / "same.png"))
    for name in "RGB":
        wrong[name][543, 1231] = 1  # of the brightest colour, at the right of the third panel
    shown = pixels(panels.save(pair_figure(black, wrong, metrics), tmp_path / "wrong.png"))
    third = np.s_[: shown.shape[0] * 3 // 4, shown.shape[1] * 64 // 100 : shown.shape[1] * 92 // 100]
    assert (shown[third].astype(int) - same[third]).max() > 200


def test_evaluations_share_one_scale(tmp_path):
    planes = {"few": np.full((9, 16), 10.0), "many": np.full((9, 16), 1000.0)}
    figure = panels.evaluations(planes, "baseline")
    limits = {panel.images[0].get_clim() for panel in figure.axes if panel.images}
    assert limits == {(1, 1000)}
    panels.save(figure, tmp_path / "a.png")
    assert pixels(tmp_path / "a.png").shape[2] == 3


# --- contact sheet


@pytest.fixture
def run_folder(tmp_path, write_exr, blank):
    """A verified run: two scenes, opt4 outside its tolerance on one, alien skipped."""
    (tmp_path / "images").mkdir()
    for name, grey in (("a", 0.2), ("b", 0.8)):
        write_exr(tmp_path / "images" / f"{name}.exr", blank(45, 80, grey))
    pairs = [
        {
            "phase": phase,
            "reference": "baseline",
            "scene": scene,
            "width": 80,
            "height": 45,
            "non_finite": 0,
            "identical": phase == "opt1",
            "psnr_db": None if phase == "opt1" else 47.25,
            "within_tolerance": (phase, scene) != ("opt4", "trio"),
            "reference_image": "images/a.exr",
            "image": "images/b.exr",
        }
        for scene in ("trio", "mandelbulb")
        for phase in ("opt1", "opt4")
    ]
    pairs[3]["antialiased"] = {"psnr_db": 51.0, "fraction_over_1_255": 0.0}
    skipped = [{"phase": "opt9", "scene": None, "reason": "this CPU lacks sve2"}]
    verified = {"schema": 1, "reference": "baseline", "pairs": pairs, "skipped": skipped}
    (tmp_path / "verify.json").write_text(json.dumps(verified))
    return tmp_path


def test_captions_of_the_contact_sheet(run_folder):
    verified = Verify.load(run_folder / "verify.json")
    axes = pictures.contact_sheet(run_folder, verified).axes
    assert [a.get_title().partition(":")[0] for a in axes[:4]] == ["baseline", "opt1", "opt4", "opt9"]
    assert [a.get_ylabel() for a in axes[::4]] == ["trio\n80×45", "mandelbulb\n80×45"]
    captions = [a.get_xlabel() for a in axes]
    assert captions[3].split()[-1] == "sve2"
    colours = [a.xaxis.label.get_color() for a in axes]
    assert [i for i, colour in enumerate(colours) if colour == panels.BAD] == [2]


def test_a_sheet_of_some_scenes_and_phases_with_their_error_to_truth(run_folder, monkeypatch):
    verified = Verify.load(run_folder / "verify.json")
    size = {"scene": "mandelbulb", "phase": "opt4", "width": 16, "height": 9, "converged_only": True}
    march = accuracy.Row(**size, antialiased=accuracy.Colours(psnr_db=51.4))
    surface = accuracy.Surface(psnr_db=38, antialiased=accuracy.Colours(psnr_db=42.8))
    some = pictures.chosen(verified, ["mandelbulb"], ["baseline", "opt4"])
    for row, said in ((march, "51.4"), (replace(march, surface=surface), "42.8")):
        monkeypatch.setattr(pictures.accuracy, "rows", lambda run, row=row: [row])
        captions = [a.get_xlabel() for a in pictures.contact_sheet(run_folder, some).axes]
        assert [re.findall(r"\d+\.\d+", one) for one in captions] == [[], ["47.2", "51.0", said]]
        assert ("march" in captions[1]) == (row is march)
    with pytest.raises(StudyError, match="mandelbulb, trio"):
        pictures.chosen(verified, ["x"], None)


def test_thumbnails_are_averaged_in_linear_light(tmp_path, write_exr, blank):
    board = blank(720, 1280)
    for name in "RGB":
        board[name][...] = np.indices((720, 1280)).sum(0) % 2
    shown = pictures.thumbnail(write_exr(tmp_path / "a.exr", board))
    assert shown.shape == (180, 320, 3)
    assert np.unique(shown).tolist() == [math.trunc(255 * 0.5**0.4545)]


def test_the_command_writes_both_figures(run_folder):
    done = started.run(
        [sys.executable, ROOT / "scripts/stepwise", "pictures", "--run", run_folder, "--json"],
    )
    assert done.returncode == 0, done.stderr
    made = emitted.result(done.stdout)
    assert made.keys() == {"contact_sheet", "evaluations"}
    for path in made.values():
        assert pixels(path).std() > 10
    assert sorted(p.name for p in (run_folder / "figures").iterdir()) == [
        "contact-sheet.png",
        "evaluations.png",
    ]


def test_a_run_that_is_not_verified_is_told_what_to_do(tmp_path):
    done = started.run([sys.executable, ROOT / "scripts/stepwise", "pictures", "--run", tmp_path])
    assert done.returncode == 2


# --- demo


@pytest.mark.parametrize(
    "ns_per_pixel, seconds, height",
    [
        (17000, 1280 * 720 * 17000 / 1e9, 720),
        (17000, 1e4, 720),
        (17000, 640 * 360 * 17000 / 1e9 + 1e-6, 360),
        (17000, 640 * 360 * 17000 / 1e9 - 1e-3, 324),
        (17000, 1e-3, 36),
        (17000, -1, 36),
    ],
)
def test_demo_size_fits_the_time(ns_per_pixel, seconds, height):
    assert demo.height_for(ns_per_pixel, seconds) == height


def test_demo_takes_the_furthest_phase_that_runs_here(monkeypatch, capsys):
    monkeypatch.setenv("STEPWISE_ISA_LIMIT", "none")
    assert demo.able(Spec.parse("opt4")) == Spec.parse("opt2")
    assert demo.able(Spec.parse("opt1")) == Spec.parse("opt1")
    with pytest.raises(StudyError, match="opt1@opt4 cannot run"):
        demo.able(Spec.parse("opt1@opt4"))


def test_demo_with_the_real_driver(tmp_path):
    words = ["--phase", "opt1", "--budget", "0.01", "-o", tmp_path / "demo.png", "--json"]
    done = started.run([sys.executable, ROOT / "scripts/stepwise", "demo", *words])
    assert done.returncode == 0, done.stderr
    found = emitted.result(done.stdout)
    assert found["identical"] and found["psnr_db"] is None and found["max_abs"] == 0
    assert found["reference"]["ns_per_pixel"] == found["reference"]["ns"] / (64 * 36)
    assert found["speedup"] == found["reference"]["ns"] / found["phase"]["ns"] > 1
    shown = pixels(tmp_path / "demo.png")
    assert shown.shape[1] > 1500 and shown.std() > 30
