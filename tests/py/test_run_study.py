"""The main job's parts: which scripts they call, and which ends they take for an end."""

import argparse
import json
import subprocess
from pathlib import Path
from unittest.mock import create_autospec

import pytest

from study.commands import study as run_study
from study.core import cli, commands

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
    assert called and set(called) <= set(commands.find_all())
    judging = name not in ("roofline", "hotspots")
    assert good is (status == cli.OK or not judging)


def ends(monkeypatch, status):
    done = subprocess.CompletedProcess([], status)
    monkeypatch.setattr(run_study.subprocess, "run", lambda *_, **__: done)
    return done


def test_a_failed_check_is_an_end_only_where_a_script_judges(monkeypatch):
    done = ends(monkeypatch, cli.FAILED)
    with pytest.raises(cli.StudyError, match=r"stepwise tables ended with status 1"):
        run_study.script("tables")
    assert run_study.script("verify", accepted=run_study.CHECKED) is done


@pytest.mark.parametrize(
    ("status", "sentence"),
    [
        (cli.CRASHED, "stepwise verify crashed; its traceback is above"),
        (-9, "stepwise verify was killed by SIGKILL"),
        (cli.FAILED, "a phase is outside its tolerance"),
    ],
)
def test_a_crash_of_verify_is_no_failed_check(status, sentence, options, monkeypatch):
    swept = {"run": str(FIXTURE), "height": 90, "failures": [], "rows": [{"spec": "opt1"}]}
    monkeypatch.setattr(run_study, "sweep", lambda _: swept)
    options.part = ["flops"]
    ends(monkeypatch, status)
    wrong = run_study.Wrong()
    assert run_study.ladder_run(options, lambda _: None, wrong) == (FIXTURE, 90)
    if status == cli.FAILED:
        assert (wrong.failed, wrong.crashed) == ([sentence], [])
        assert wrong.status() == cli.FAILED
    else:
        assert (wrong.failed, wrong.crashed) == ([], [sentence])
        assert wrong.status() == cli.CRASHED


def test_the_study_goes_on_after_a_part_that_crashed(options, monkeypatch, capsys, tmp_path):
    called = []

    def fake(script, *arguments, capture=False, accepted=(cli.OK,)):
        called.append(script)
        if script == "functions":
            raise run_study.Crashed("stepwise functions crashed; its traceback is above", cli.CRASHED)
        return subprocess.CompletedProcess([], cli.OK, stdout="{}")

    options.part, options.json = ["functions", "views"], True
    monkeypatch.setattr(run_study, "script", fake)
    monkeypatch.setattr(run_study, "arguments", lambda: options)
    monkeypatch.setattr(run_study, "build", lambda _: None)
    monkeypatch.setattr(run_study, "newest", lambda _: (FIXTURE, 90))
    assert run_study.main() == cli.CRASHED
    assert called[:3] == ["functions", "views", "tables"] and called[-1] == "report"
    said = capsys.readouterr()
    assert json.loads(said.out)["crashed"] == ["stepwise functions crashed; its traceback is above"]
    assert said.err.splitlines()[-1] == "study: stepwise functions crashed; its traceback is above"


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
