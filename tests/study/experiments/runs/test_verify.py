"""The pictures that the gate looks at (study.pictures.gallery) and scripts/stepwise verify."""

from __future__ import annotations

import dataclasses
import json
import math
import time
from pathlib import Path

import emitted
import msgspec
import numpy as np
import pytest
from complete import SMOOTH, bound, phase

from study.core import build, registry
from study.core.cli import StudyError
from study.core.registry import ROOT, Spec
from study.core.run import DriverError
from study.pictures import gallery, images
from study.pictures.gallery import Gallery

# --- pictures on disk, with a driver that copies a prepared EXR


class FakeDriver:
    """Stands for build and render: a program is a file, its picture is made by `pictures[spec]`."""

    def __init__(self, folder: Path, write_exr, pictures: dict[str, object]) -> None:
        self.folder, self.write_exr, self.pictures, self.calls = folder, write_exr, pictures, []
        folder.mkdir()

    def build(self, spec: Spec) -> Path:
        path = self.folder / str(spec)
        if not path.exists():
            path.write_text(str(spec))
        return path

    def render(
        self, spec: Spec, scene: Path, height: int, width: int, *, aov: bool, out: Path, timed: bool
    ) -> dict:
        assert aov
        self.calls.append((str(spec), scene.stem, width, height))
        time.sleep(0.02)  # so that a picture wanted twice would be begun twice
        made = self.pictures[str(spec)]
        if isinstance(made, Exception):
            raise made
        self.write_exr(out, made(height, width))
        return {}


@pytest.fixture
def driver(tmp_path, monkeypatch, write_exr, blank):
    def off(height, width):
        picture = blank(height, width)
        picture["R"] += np.float32(0.01)
        return picture

    fake = FakeDriver(tmp_path / "bin", write_exr, {"baseline": blank, "opt1": blank, "opt4": off})
    monkeypatch.setattr(gallery, "build", fake.build)
    monkeypatch.setattr(gallery, "render", fake.render)
    monkeypatch.delenv("STEPWISE_ISA_LIMIT", raising=False)
    declared = {"smooth": bound(psnr_db=55), "fractal": bound(antialiased={"psnr_db": 30})}
    known = {
        "baseline": phase({}, "baseline"),
        "opt1": phase({"smooth": bound(identical=True), "fractal": bound(identical=True)}, "opt1"),
        "opt4": phase(declared, "opt4"),
        "alien": phase(declared, "alien", ("sve2",)),
    }
    known["baseline"] = msgspec.structs.replace(known["baseline"], parent=None)
    monkeypatch.setattr(registry, "phases", lambda root=ROOT: known)
    return fake


def test_a_picture_is_rendered_once_until_program_scene_or_size_change(tmp_path, driver):
    opt1, folder = Spec("opt1", "opt1"), tmp_path / "images"
    scene = dataclasses.replace(SMOOTH, path=tmp_path / "trio.json")
    scene.path.write_text("{}")

    def take(size=(4, 3)):
        made = Gallery(folder, [opt1])
        assert made.render_all([(opt1, scene, size)] * 2, jobs=2) == {}
        return made.path(opt1, scene, size).name

    first = take()
    assert take() == first and len(driver.calls) == 1
    driver.build(opt1).write_text("another program")
    second = take()
    assert second != first and len(driver.calls) == 2
    scene.path.write_text("{ }")
    third = take()
    assert len(driver.calls) == 3
    fourth = take((5, 3))
    assert len(driver.calls) == 4
    assert sorted(p.name for p in folder.iterdir()) == sorted([third, fourth])  # what is out of date is gone


# --- the command


@pytest.fixture
def command(tmp_path, monkeypatch, capsys):
    """Runs verify in this process: exit status, standard output, standard error."""

    def call(*words: str) -> tuple[int, str, str]:
        words = ("--run", str(tmp_path / "run"), "-n", "9", "--antialias-n", "4", "--jobs", "2", *words)
        return emitted.told("verify", *words), *capsys.readouterr()

    return call


def test_one_pair(driver, command, tmp_path):
    status, out, err = command("--phase", "opt4", "--scene", "trio", "--json")
    said = emitted.whole(out)
    assert (said["command"], said["status"], said["run"]) == ("verify", "failed", str(tmp_path / "run"))
    (found,) = said["result"]["pairs"]
    assert status == 1
    wanted = {"psnr_db", "max_abs", "fraction_over_1_255", "mask_mismatch_ppm", "id_mismatch_ppm", "dt_p99"}
    assert wanted | {"dt_max", "flip_mean", "non_finite", "within_tolerance"} <= found.keys()
    assert found["psnr_db"] == pytest.approx(40 + 10 * math.log10(3), abs=1e-3)
    assert found["fraction_over_1_255"] == 1
    assert found["failed"] == ["psnr_db"] and found["within_tolerance"] is False
    assert "flip-evaluator" in said["result"]["flip_tool"]
    assert "psnr_db: 44.7712" in err


def test_the_parents_row_stands_beside_and_is_not_judged(driver, command, monkeypatch):
    """opt4 is off by 0.01 in red and fails; its child opt1 here is judged alone."""
    monkeypatch.setitem(
        registry.phases(), "opt1", msgspec.structs.replace(registry.phases()["opt1"], parent="opt4")
    )
    status, out, err = command("--phase", "opt1", "--scene", "trio", "--json")
    pairs = emitted.result(out)["pairs"]
    assert [(p["phase"], p["beside"], p["within_tolerance"]) for p in pairs] == [
        ("opt4", True, False),
        ("opt1", False, True),
    ]
    assert status == 0 and "opt4" not in err
    assert command("--phase", "opt4", "opt1", "--scene", "trio")[0] == 1, "asked for, so judged"


def test_infinite_psnr_is_null_and_passes(driver, command):
    status, out, _ = command("--phase", "opt1", "--scene", "trio", "--json")
    (found,) = emitted.result(out)["pairs"]
    assert (status, found["psnr_db"], found["within_tolerance"]) == (0, None, True)


def test_several_pairs_and_what_is_kept_of_them(driver, command, tmp_path):
    status, out, _ = command("--scene", "trio", "mandelbulb", "--json")
    found = emitted.result(out)
    assert status == 1
    kept = json.loads((tmp_path / "run" / "verify.json").read_text())
    assert kept == found
    verdicts = {(p["scene"], p["phase"]): p["within_tolerance"] for p in found["pairs"]}
    assert verdicts == {
        ("trio", "opt1"): True,
        ("trio", "opt4"): False,
        ("mandelbulb", "opt1"): True,
        ("mandelbulb", "opt4"): True,
    }
    assert [(one["phase"], one["scene"]) for one in found["skipped"]] == [("alien", None)]
    for pair in found["pairs"]:
        assert (pair["antialiased"] is not None) == (pair["scene"] == "mandelbulb")
        assert (pair["heatmap"] is not None) == (not pair["within_tolerance"])
        for key in ("image", "png", "reference_image", "reference_png"):
            assert (tmp_path / "run" / pair[key]).is_file()
    # The reference once a scene and size: 16:9 of 9, and four times 16:9 of 4 to be averaged.
    assert sorted(c[1:] for c in driver.calls if c[0] == "baseline") == [
        ("mandelbulb", 16, 9),
        ("mandelbulb", 28, 16),
        ("trio", 16, 9),
    ]


def test_table_has_a_line_a_pair_and_heat_maps_on_request(driver, command, tmp_path):
    status, out, _ = command("--phase", "opt1", "--scene", "trio", "--heatmaps")
    assert status == 0
    _, _, line, *_ = out.splitlines()
    assert {"trio", "opt1", "16×9", "identical"} <= {cell.strip() for cell in line.split("|")}
    maps = [p.name for p in (tmp_path / "run" / "images").glob("*-against-*")]
    assert maps == ["trio-opt1-16x9-against-baseline.png"]


def test_what_cannot_run_here_is_skipped_by_name(driver, command):
    status, out, err = command("--phase", "alien", "--json")
    assert status == 3
    assert emitted.result(out)["pairs"] == []
    assert "skipped alien" in err
    assert not driver.calls


def test_a_refusal_is_skipped_a_crash_fails_and_bad_input_ends_it(driver, command):
    driver.pictures["opt1"] = DriverError(4, "no planes here")
    status, _, err = command("--phase", "opt1", "--scene", "trio")
    assert status == 3 and "no planes here" in err
    driver.pictures["opt1"] = DriverError(-11, "killed by SIGSEGV")
    status, out, err = command("--phase", "opt1", "--scene", "trio")
    assert status == 1 and "OUTSIDE" in out and "SIGSEGV" in err
    driver.pictures["opt1"] = DriverError(2, "too large")
    with pytest.raises(DriverError, match="too large"):
        command("--phase", "opt1", "--scene", "trio")


def test_a_wrong_tolerance_ends_it_before_anything_is_rendered(driver, command, monkeypatch):
    monkeypatch.setitem(registry.phases(), "opt4", phase({"smooth": bound(psnr=3)}, "opt4"))
    with pytest.raises(StudyError, match="no such metric"):
        command("--scene", "trio")
    assert not driver.calls


TRUTH_ALONE = {"truth": bound(psnr_db=0.1)}


@pytest.fixture
def step(driver, monkeypatch):
    """Puts a step with these tolerances behind opt4, whose picture is opt4's: off by 0.01 in red."""

    def put(tolerance: dict, order: int = 6) -> None:
        made = msgspec.structs.replace(phase(tolerance, "opt9"), order=order)
        monkeypatch.setitem(registry.phases(), "opt9", made)
        driver.pictures["opt9"] = driver.pictures["opt4"]

    return put


def test_a_step_held_against_truth_alone_is_left_to_accuracy(step, driver, command, tmp_path):
    step(TRUTH_ALONE)
    status, out, err = command("--phase", "opt9", "--scene", "trio", "mandelbulb", "--json")
    pairs = emitted.result(out)["pairs"]
    assert status == 0 and [pair["within_tolerance"] for pair in pairs] == [None, None]
    assert pairs[0]["left_to"] == "scripts/stepwise accuracy" and pairs[0]["failed"] == []
    assert pairs[0]["psnr_db"] == pytest.approx(40 + 10 * math.log10(3), abs=1e-3)  # for the report
    assert err.count("scripts/stepwise accuracy") == 1 and pairs[0]["heatmap"] is None


def test_a_step_left_to_accuracy_may_not_write_what_is_not_finite_nor_crash(step, driver, command, blank):
    step(TRUTH_ALONE)

    def broken(height, width):
        picture = blank(height, width)
        picture["R"][0, 0] = math.nan
        return picture

    driver.pictures["opt9"] = broken
    status, out, err = command("--phase", "opt9", "--scene", "trio")
    assert status == 1 and "OUTSIDE" in out and "non_finite" in err
    driver.pictures["opt9"] = DriverError(-11, "killed by SIGSEGV")
    assert command("--phase", "opt9", "--scene", "mandelbulb")[0] == 1


@pytest.mark.parametrize(
    "tolerance, order",
    [
        (TRUTH_ALONE, 4),  # up to opt4 baseline is the reference
        ({}, 6),  # declares nothing at all
        (TRUTH_ALONE | {"fractal": bound(psnr_db=1)}, 6),  # and forgot the other class
        (TRUTH_ALONE | {"smooth": bound(psnr_db=55)}, 6),
    ],
)
def test_who_declares_more_or_nothing_is_judged_here(step, command, tolerance, order):
    step(tolerance, order)
    status, out, _ = command("--phase", "opt9", "--scene", "trio", "--json")
    assert status == 1 and emitted.result(out)["pairs"][0]["within_tolerance"] is False


@pytest.mark.parametrize(
    "words, message",
    [
        (["--phase", "opt11"], "opt1"),
        (["--scene", "scene00"], "scene0"),
        (["--reference", "none"], "none"),
        (["--left-scene", "trio00"], "trio"),
        (["--phase", "opt9_convex", "--scene", "scene0", "--left-scene", "trio"], "--left-scene"),
    ],
)
def test_bad_names_are_said_with_what_would_be_right(words, message):
    with pytest.raises(StudyError, match=message):
        emitted.told("verify", *words)


# --- the real driver


def test_end_to_end_with_the_real_driver(tmp_path, capsys):
    words = ["--phase", "opt1", "opt1@opt2", "--scene", "scene0", "mandelbulb", "-n", 18, "--antialias-n", 5]
    assert emitted.told("verify", *words, "--run", tmp_path, "--json") == 0
    pairs = emitted.result(capsys.readouterr().out)["pairs"]
    assert [(p["phase"], p["scene"]) for p in pairs] == [
        ("opt1", "scene0"),
        ("opt1@opt2", "scene0"),
        ("opt1", "mandelbulb"),
        ("opt1@opt2", "mandelbulb"),
    ]
    assert all(pair["identical"] and pair["non_finite"] == 0 for pair in pairs)
    shown = images.read(tmp_path / pairs[0]["image"])
    assert set(images.AOVS) == shown.keys()
    assert build.build(Spec("opt1", "opt1")).is_file()
