"""Command line of the scripts: statuses, one-line errors, JSON, and the way into the venv."""

import json
import os
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import copied
import numpy as np
import pytest

from study.core import cli, commands
from study.core.registry import ROOT

STEPWISE = ROOT / "scripts" / "stepwise"


def status_of(run) -> int:
    with pytest.raises(SystemExit) as end:
        cli.main(run)
    return end.value.code


@pytest.mark.parametrize(
    ("error", "status"),
    [
        (cli.StudyError("no such thing"), 2),
        (cli.StudyError("no such thing", cli.CANNOT_RUN), 3),
        (KeyboardInterrupt(), 130),
    ],
)
def test_errors_are_one_line_and_a_status(error, status, capsys):
    def run():
        raise error

    assert status_of(run) == status
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1) and str(error) in err


def test_a_bug_has_a_status_of_its_own_and_shows_its_traceback(capsys):
    assert status_of(lambda: 1 // 0) == cli.CRASHED
    said = capsys.readouterr().err
    assert said.startswith("Traceback") and "ZeroDivisionError" in said
    assert said.splitlines()[-1].endswith(": crashed: ZeroDivisionError")


def test_the_documented_statuses_are_those_of_the_scripts():
    text = (ROOT / "docs" / "exit-statuses.md").read_text()
    rows = [line.split("|")[1:3] for line in text.splitlines() if line.startswith("| ")]
    assert {int(status): meaning.strip() for status, meaning in rows[2:]} == cli.STATUSES


def test_an_outcome_is_one_object_of_what_json_knows(capsys, monkeypatch):
    @dataclass
    class Interval:
        value: float
        low: float

    result = {"nan": float("nan"), "array": np.array([1.5, np.inf]), "integer": np.int64(3), 1: (True, None)}
    result |= {"interval": Interval(np.float32(0.5), -np.inf), "path": Path("a/b")}
    plain = {"nan": None, "array": [1.5, None], "integer": 3, "1": [True, None]}
    plain |= {"interval": {"value": 0.5, "low": None}, "path": "a/b"}
    monkeypatch.setattr("sys.argv", ["stepwise some"])
    outcome = cli.Outcome(result, ["a line"], Path("results/run"), ["remark"], ["check"])
    assert outcome.tell(as_json=True) == cli.FAILED
    said = capsys.readouterr()
    assert said.err == "remark\nFAIL check\n"
    about = {"command": "some", "status": "failed", "run": "results/run"}
    assert json.loads(said.out) == about | {"result": plain}
    assert cli.Outcome(result, ["a line"]).tell(as_json=False) == cli.OK
    assert capsys.readouterr().out == "a line\n"


@pytest.mark.parametrize("command", commands.find_all().values(), ids=lambda command: command.name)
def test_an_option_is_written_the_same_way_everywhere(command):
    """And a positional run is RUN, or a RUN of several."""
    for action in commands.parser_of(command)._actions:
        shown = action.metavar or action.dest.upper()
        for name in action.option_strings:
            if name in commands.OPTIONS:
                placeholder = commands.OPTIONS[name][0]
                assert (action.nargs == 0) == (placeholder is None)
                assert placeholder in (None, shown), f"{command.name}: {name} {shown}"
        assert "--seconds" not in action.option_strings
        if not action.option_strings and "run" in action.dest:
            assert shown == "RUN"


def doors(folder: Path, venv: str = "") -> list[str | Path]:
    """The command in a tree of its own, started by a Python without packages."""
    (folder / "scripts").mkdir()
    shutil.copy(STEPWISE, folder / "scripts")
    copied.folders(folder, "scripts/study/core")
    if venv:
        (folder / ".venv" / "bin").mkdir(parents=True)
        (folder / ".venv" / "bin" / "python").write_text(venv)
        (folder / ".venv" / "bin" / "python").chmod(0o755)
    return [sys.executable, "-S", folder / "scripts" / "stepwise"]


def test_the_command_starts_in_the_venv(tmp_path):
    command = doors(tmp_path, '#!/bin/sh\necho "venv: $*"\n')
    done = subprocess.run([*command, "--phase", "a b"], capture_output=True, text=True)
    assert done.stdout.split() == ["venv:", "-I", str(command[-1]), "--phase", "a", "b"]


@pytest.mark.parametrize("way", [[], [sys.executable]], ids=["itself", "by Python"])
def test_packages_that_the_shell_exports_are_not_taken(tmp_path, way):
    """Nor a Python: PYTHONHOME of another one has no library."""
    (tmp_path / "numpy").mkdir()
    (tmp_path / "numpy" / "__init__.py").write_text("raise SystemError('the wrong numpy')\n")
    exported = {"PYTHONPATH": str(tmp_path)} | ({} if way else {"PYTHONHOME": str(tmp_path)})
    words = [*way, STEPWISE, "compare", "-h"]
    done = subprocess.run(words, env=os.environ | exported, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "") and "usage: stepwise compare" in done.stdout


def test_without_packages_it_ends_in_one_line(tmp_path):
    done = subprocess.run(doors(tmp_path), capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (cli.CANNOT_RUN, "")
    assert "make setup" in done.stderr and len(done.stderr.splitlines()) == 1


def test_a_reader_that_goes_away_is_no_error(tmp_path):
    path = tmp_path / "many.py"
    path.write_text("from study.core import cli\ncli.main(lambda: print('x' * 1_000_000))\n")
    environment = os.environ | {"PYTHONPATH": str(ROOT / "scripts")}
    child = subprocess.Popen(
        [sys.executable, path], stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=environment
    )
    child.stdout.read(10)
    child.stdout.close()
    assert (child.stderr.read(), child.wait()) == (b"", 0)
    child.stderr.close()


def test_a_full_disk_behind_standard_output_is_one_line(tmp_path):
    """Where it is buffered, Python flushes it again when it ends, and would have status 120."""
    path = tmp_path / "some.py"
    scripts = str(ROOT / "scripts")
    path.write_text(
        f"import sys; sys.path.insert(0, {scripts!r})\n"
        "from study.core import cli\ncli.main(lambda: print('x'))\n"
    )
    with open("/dev/full", "w") as full:
        command = [sys.executable, "-I", path]
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True)
    assert (done.returncode, done.stderr.count("\n")) == (cli.BAD_INPUT, 1), done.stderr


@pytest.mark.parametrize("command", commands.find_all().values(), ids=lambda command: command.name)
def test_every_command_names_its_exit_statuses_and_refuses_an_unknown_option(command, capsys):
    parser = commands.parser_of(command)
    assert "exit status:" in parser.format_help() and "--json" in parser.format_help()
    with pytest.raises(SystemExit) as end:
        parser.parse_args(["--no-such-option"])
    assert end.value.code == cli.BAD_INPUT and capsys.readouterr().out == ""


@pytest.mark.parametrize(
    ("lowest", "kind", "text", "value"),
    [
        *((1, int, text, None) for text in ("0", "1.5", "x", "nan")),
        *((0.5, float, text, None) for text in ("0.4", "x", "nan", "1e999")),
        *((1, int, "1", 1), (0.5, float, "0.5", 0.5), (0, float, "1e3", 1000.0)),
    ],
)
def test_a_number_that_is_too_small_or_none_is_said(lowest, kind, text, value, capsys):
    made = cli.parser("what it does")
    made.add_argument("-n", type=cli.at_least(lowest, kind))
    if value is not None:
        assert made.parse_args(["-n", text]).n == value
        return
    with pytest.raises(SystemExit) as end:
        made.parse_args([f"-n={text}"])
    said = capsys.readouterr().err.splitlines()[-1]
    assert end.value.code == 2 and f"-n: '{text}'" in said and said.endswith(f" {lowest}")
