"""The main job's parts: which scripts they call, and which ends they take for an end."""

import argparse
import subprocess
from pathlib import Path
from unittest.mock import create_autospec

import pytest

import run_study
from study import cli

FIXTURE = Path(__file__).resolve().parents[1] / "fixtures" / "run"


@pytest.fixture
def options(tmp_path):
    return argparse.Namespace(
        scene=["scene0", "mandelbulb"], full=False, part=None, results=tmp_path, seconds=10.0
    )


@pytest.mark.parametrize("name", run_study.PARTS)
@pytest.mark.parametrize("status", [cli.OK, cli.FAILED])
def test_every_part_calls_its_scripts_rightly(name, status, options, monkeypatch):
    """With the script's own signature: a wrong keyword is found here, not after six minutes of study."""
    called = []

    def fake(script, *arguments, capture=False, accepted=(cli.OK,)):
        called.append(script)
        return subprocess.CompletedProcess([], status if status in accepted else cli.OK, stdout="{}")

    monkeypatch.setattr(run_study, "script", create_autospec(run_study.script, side_effect=fake))
    good = run_study.PARTS[name][1](FIXTURE, options, 90)
    assert called and all((run_study.SCRIPTS / f"{script}.py").is_file() for script in called)
    judging = name not in ("roofline", "hotspots")
    assert good is (status == cli.OK or not judging)


def test_a_traceback_is_no_failed_check(monkeypatch):
    done = subprocess.CompletedProcess([], cli.FAILED)
    monkeypatch.setattr(run_study.subprocess, "run", lambda *_, **__: done)
    with pytest.raises(cli.StudyError, match=r"tables\.py ended with status 1"):
        run_study.script("tables")
    assert run_study.script("verify", accepted=run_study.CHECKED) is done


def test_the_newest_run_is_taken_and_none_is_none(options, tmp_path):
    assert run_study.newest(options) == (None, 0)
    folder = tmp_path / "machine" / "20260101-000000-abc"
    folder.parent.mkdir()
    folder.symlink_to(FIXTURE)
    options.scene = ["scene0"]
    path, height = run_study.newest(options)
    assert path == folder and height > 0
    options.scene = ["trio"]
    assert run_study.newest(options) == (None, 0)
