"""Truth's cache: made once, whole or not at all; what the phase left undecided is decided exactly."""

from __future__ import annotations

import copy
import json
import math
import signal
import subprocess
import sys

import emitted
import numpy as np
import pytest
import started

from study.core import cli, registry, run
from study.core.cli import StudyError
from study.core.registry import ROOT
from study.pictures import images
from study.truth import judging, truth

SIZE = (16, 12)
# Planes that hang on the primary hit.
HANGING = [f"N.{axis}" for axis in "xyz"] + [p + c for p in ("", "ideal.", "none.") for c in "RGB"]
HANGING += ["shadow", "shadow.ideal"]


@pytest.fixture
def cache(tmp_path, monkeypatch):
    monkeypatch.setattr(truth, "CACHE", tmp_path / "cache")
    return tmp_path / "cache"


@pytest.fixture
def scene():
    return registry.find_scene("two_spheres")


def test_made_once(cache, scene, monkeypatch):
    first = truth.summary(scene, SIZE)
    assert not first.cached and first.proved == 16 * 12 and first.undecided == first.converged_only == 0
    assert 0 <= first.widest < 1e-9
    monkeypatch.setattr(run, "render", lambda *_, **__: pytest.fail("rendered again"))
    again = truth.summary(scene, SIZE)
    assert again.cached and again.seconds == first.seconds
    assert [path.name for path in cache.iterdir()] == [truth.path_of(scene, SIZE).name]
    picture = truth.picture(scene, SIZE)
    assert {*images.AOVS, "status", "width", "shadow", "ideal.R", "none.B"} <= picture.keys()


def test_undecided_rays_are_decided(cache, scene):
    """Every pixel forgotten, and found again by the other program."""
    right = truth.picture(scene, SIZE)
    assert (right["id"] >= 0).any() and (right["id"] < 0).any()
    planes = copy.deepcopy(right)
    planes["status"][:], planes["status.all"][:], planes["id"][:] = truth.UNDECIDED, truth.UNDECIDED, 7
    planes["Z"][:] = planes["width"][:] = np.nan
    assert truth.decide(scene.data, planes) == (16 * 12, 16 * 12)
    assert (planes["status.all"] == truth.UNDECIDED).all()
    for name in HANGING:
        assert np.isnan(planes[name]).all(), name
    assert (planes["status"] == truth.PROVED).all() and (planes["id"] == right["id"]).all()
    hit = right["id"] >= 0
    assert (np.abs(planes["Z"][hit] - right["Z"][hit]) <= np.spacing(right["Z"][hit])).all()
    assert (planes["Z"][~hit] == np.inf).all() and (planes["width"] <= 1e-13).all()


def test_only_a_right_guess_with_a_normal_keeps_its_colours(cache, scene):
    """Undecided: a hit guessed right, one whose normal is lost, one taken for another, a miss."""
    right = truth.picture(scene, SIZE)
    hits, misses = (list(zip(*np.nonzero(mask), strict=True)) for mask in (right["id"] >= 0, right["id"] < 0))
    kept, bare, other, missed = *hits[:3], misses[0]
    planes = copy.deepcopy(right)
    for spot in (kept, bare, other, missed):
        planes["status"][spot] = planes["status.all"][spot] = truth.UNDECIDED
    for axis in "xyz":
        planes[f"N.{axis}"][bare] = 0
    planes["id"][other] = 1 - right["id"][other]
    assert truth.decide(scene.data, planes) == (4, 1)
    for name in HANGING:
        assert np.isnan([planes[name][bare], planes[name][other]]).all(), name
        for spot in (kept, missed):
            assert planes[name][spot] == right[name][spot], name
    assert (planes["status.all"] < truth.CONVERGED).sum() == 4
    made = {name: right[name] for name in images.AOVS}
    found = judging.metrics(planes, made)
    assert found["unjudged_colours"] == 2 and found["undecided_pixels"] == 0
    assert found["psnr_db"] == math.inf and found["normal_p99_degrees"] == 0
    assert found["false_hits_ppm"] == found["false_misses_ppm"] == found["wrong_shape_ppm"] == 0


def test_a_cache_that_cannot_be_written_to_is_said_before_rendering(tmp_path, scene, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setattr(truth, "CACHE", tmp_path / "file" / "cache")
    monkeypatch.setattr(run, "render", lambda *_, **__: pytest.fail("rendered"))
    with pytest.raises(StudyError, match="file"):
        truth.make(scene, SIZE)


def test_a_fractal_is_left_alone(scene):
    planes = {"status": np.zeros((2, 2), np.float32)}
    assert truth.decide({"shapes": [{"type": "mandelbulb"}]}, planes) == (0, 0)


def test_a_killed_run_leaves_no_half_picture(cache, scene):
    code = f"""
import os, signal, sys
sys.path.insert(0, {str(ROOT / "scripts")!r})
from pathlib import Path
from study.core import registry, run
from study.truth import truth
truth.CACHE = Path({str(cache)!r})
truth._write = lambda path, *_: (path.write_bytes(b"half"), os.kill(os.getpid(), signal.SIGKILL))
truth.make(registry.find_scene("two_spheres"), {SIZE!r})
"""
    done = subprocess.run([sys.executable, "-c", code])
    assert done.returncode == -signal.SIGKILL
    left = list(cache.iterdir())
    assert len(left) == 1 and left[0].is_dir() and left[0].name.startswith(".")
    path = truth.make(scene, SIZE)
    assert list(cache.iterdir()) == [path] and images.read(path)["status"].shape == SIZE[::-1]


def test_a_scene_is_its_values(scene):
    other = json.loads(json.dumps(scene.data))
    other["march"] = dict(reversed(other["march"].items()))
    other["fog"] = float(other["fog"])
    assert truth.scene_hash(other) == truth.scene_hash(scene.data)
    other["march"]["hit_distance"] *= 2
    assert truth.scene_hash(other) != truth.scene_hash(scene.data)


def test_the_script(tmp_path):
    def script(*arguments):
        command = [sys.executable, ROOT / "scripts" / "stepwise", "truth", *arguments]
        return started.run(command)

    done = script("--scene", "two_spheres", "-n", "12", "-w", "16", "--json", "--run", tmp_path)
    assert done.returncode == cli.OK, done.stderr
    (found,) = emitted.result(done.stdout)["rows"]
    assert (found["proved"], found["undecided"], found["converged_only"]) == (16 * 12, 0, 0)
    wrong = script("--scene", "two_sphere", "-n", "12")
    assert wrong.returncode == cli.BAD_INPUT and "two_spheres" in wrong.stderr
