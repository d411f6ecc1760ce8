"""Truth's cache: made once, whole or not at all."""

from __future__ import annotations

import json
import signal
import subprocess
import sys

import emitted
import pytest
import started

from study.core import cli, registry, run
from study.core.cli import StudyError
from study.core.registry import ROOT
from study.pictures import images
from study.truth import truth

SIZE = (16, 12)


@pytest.fixture
def cache(tmp_path, monkeypatch):
    monkeypatch.setattr(truth, "CACHE", tmp_path / "cache")
    return tmp_path / "cache"


@pytest.fixture
def scene():
    return registry.find_scene("two_spheres")


def test_made_once(cache, scene, monkeypatch):
    picture = truth.picture(scene, SIZE)
    assert (picture["status"] == truth.PROVED).all() and picture["width"].max() < 1e-9
    monkeypatch.setattr(run, "render", lambda *_, **__: pytest.fail("rendered again"))
    assert images.sha256(truth.picture(scene, SIZE)) == images.sha256(picture)
    assert [path.name for path in cache.iterdir()] == [truth.path_of(scene, SIZE).name]
    assert {*images.AOVS, "status", "width", "shadow", "ideal.R", "none.B"} <= picture.keys()


def test_a_cache_that_cannot_be_written_to_is_said_before_rendering(tmp_path, scene, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setattr(truth, "CACHE", tmp_path / "file" / "cache")
    monkeypatch.setattr(run, "render", lambda *_, **__: pytest.fail("rendered"))
    with pytest.raises(StudyError, match="file"):
        truth.make(scene, SIZE)


def test_a_killed_run_leaves_no_half_picture(cache, scene):
    code = f"""
import os, signal, sys
sys.path.insert(0, {str(ROOT / "scripts")!r})
from pathlib import Path
from study.core import registry, run
from study.truth import truth
truth.CACHE = Path({str(cache)!r})
run.render = lambda *_, out, **__: (out.write_bytes(b"half"), os.kill(os.getpid(), signal.SIGKILL))
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
