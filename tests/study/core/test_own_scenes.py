"""A scene is a path as well as a name: in every command, in the run, and in one that goes on."""

from __future__ import annotations

import hashlib
import json
import re
import subprocess
from pathlib import Path

import pytest

from study.commands.upkeep import publish
from study.core import commands, registry, store
from study.core.cli import StudyError
from study.core.registry import ROOT
from study.core.run import render

PARSERS = {name: commands.parser_of(one) for name, one in commands.find_all().items()}
TAKING = [name for name, parser in PARSERS.items() if "--scene" in parser._option_string_actions]
TAKING.remove("peers")  # its programs say which scenes they know


@pytest.fixture(autouse=True)
def own(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry, "_given", {})


def written(path: Path, **changed: object) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(registry.scenes()["two_spheres"].data | changed))
    return path


@pytest.mark.parametrize("name", TAKING)
def test_every_command_with_scenes_takes_a_path(name: str, tmp_path: Path) -> None:
    words = ["--scene", str(written(tmp_path / "mine.json"))]
    words = {"try": ["opt4", *words], "leaderboard": ["phases", *words]}.get(name, words)
    found = PARSERS[name].parse_args(words).scene
    assert found in ("mine", ["mine"]) and registry.find_scene("mine").path == tmp_path / "mine.json"
    assert registry.find_animated("mine").data == registry.find_scene("two_spheres").data
    for option in {"--left-scene"} & PARSERS[name]._option_string_actions.keys():
        assert PARSERS[name].parse_args([option, *words[-1:]]).left_scene == ["mine"]


def test_a_relative_path_is_of_the_folder_that_the_command_was_called_in(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = written(tmp_path / "mine.json")
    monkeypatch.chdir(tmp_path)
    registry.given("mine.json")
    monkeypatch.chdir("/")
    assert registry.find_scene("mine").path == path
    assert render("opt1", registry.find_scene("mine").path, 2, timed=False)["height"] == 2


def test_a_sweep_keeps_its_scene_and_goes_on_without_the_file(
    stepwise, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = written(tmp_path / "far" / "mine.json", fog=0.25)
    hashed, text = render("opt1", path, 2, timed=False)["scene_hash"], path.read_bytes()
    words = ["--phase", "opt1", "--scene", path, "two_spheres", "-n", 2, "--reps", 1, "--warmup", 0]
    done = stepwise("sweep", *words, "--launches", 2, "--results", tmp_path / "results", "--budget", 0)
    assert done.returncode == 0, done.stderr
    run = store.Run.latest(tmp_path / "results")
    assert {one.scene: one.scene_hash for one in run.plan.configurations}["mine"] == hashed
    assert (run.path / "own-scenes" / "mine.json").read_bytes() == text
    assert [p.name for p in (run.path / "own-scenes").iterdir()] == ["mine.json"]
    assert run.context.scenes == {"mine": hashlib.sha256(text).hexdigest()}
    path.unlink()
    monkeypatch.setattr(registry, "_given", {})  # as in another process
    done = stepwise("sweep", "--run", run.path, "--resume", "--budget", 60)
    assert done.returncode == 0, done.stderr
    assert {(one.scene, one.scene_hash) for one in run.lines() if one.scene == "mine"} == {("mine", hashed)}
    assert len(run.lines()) == 4
    (made := tmp_path / "published").mkdir()
    publish.copy_files(run.path, made)
    assert (made / "own-scenes" / "mine.json").read_bytes() == text


def test_other_commands_keep_it_too_and_the_checkout_stays_as_it_is(
    stepwise, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where a run has a scene of that name, another one is not taken."""
    path, run = written(tmp_path / "mine.json"), tmp_path / "run"
    state = ["git", "status", "--porcelain"]
    before = subprocess.run(state, cwd=ROOT, capture_output=True).stdout
    words = ["--phase", "opt1", "-n", 4, "--run", run]
    done = stepwise("verify", "--scene", path, *words)
    assert done.returncode == 0, done.stderr
    assert (run / "own-scenes" / "mine.json").read_bytes() == path.read_bytes()
    assert subprocess.run(state, cwd=ROOT, capture_output=True).stdout == before
    assert stepwise("verify", "--scene", path, *words).returncode == 0
    monkeypatch.setattr(registry, "_given", {})
    done = stepwise("verify", "--scene", written(path, fog=0.5), *words)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert str(run / "own-scenes" / "mine.json") in done.stderr


def test_a_scene_of_ours_by_its_path_is_that_scene(tmp_path: Path) -> None:
    """And is not kept with a run. One that stands apart is drawn where it is asked for like this."""
    scene = registry.animated()["flythrough"]
    assert registry.given(str(scene.path)) == "flythrough"
    assert registry.find_scene("flythrough").data == scene.data and registry.own_scenes() == {}
    assert registry.given(str(written(tmp_path / "two_spheres.json"))) == "two_spheres"
    assert registry.own_scenes() == {}
    assert registry.given("scene0") == "scene0"  # a name, whatever files there are


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("scene0.json", None, "common/scenes/scene0.json"),
        ("a b.json", None, "a b.json"),
        ("a+b.json", None, "a+b.json"),
        ("mine.json", "{", ":1:2"),
        ("mine.json", "[]", "object"),
        ("mine.json", "{}", "$.camera"),
        ("none/mine.json", "", "No such file"),
    ],
)
def test_what_is_no_scene_is_refused(name: str, text: str | None, said: str, tmp_path: Path) -> None:
    path = tmp_path / name
    if text is None:
        written(path)
    elif text:
        path.write_text(text)
    with pytest.raises(StudyError, match=re.escape(said)):
        registry.given(str(path))


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"shapes": [{"type": "sphere", "radius": 1, "material": "gold"}]}, "gold"),
        ({"camera": {"position": "here"}}, "camera"),
    ],
)
def test_what_scripts_read_of_a_scene_is_checked(changed: dict, said: str, tmp_path: Path) -> None:
    with pytest.raises(StudyError, match=said):
        registry.given(str(written(tmp_path / "mine.json", **changed)))


def test_two_files_of_one_name_are_refused(tmp_path: Path) -> None:
    registry.given(str(written(tmp_path / "a" / "mine.json")))
    with pytest.raises(StudyError, match=re.escape("a/mine.json")):
        registry.given(str(written(tmp_path / "b" / "mine.json", fog=1)))
    assert registry.given(str(written(tmp_path / "c" / "mine.json"))) == "mine"
