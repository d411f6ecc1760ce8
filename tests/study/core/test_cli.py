"""Command line of the scripts: statuses, one-line errors, JSON, and the way into the venv."""

import json
import os
import shlex
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import started

from study.core import cli, commands
from study.core.registry import ROOT

STEPWISE = ROOT / "scripts" / "stepwise"
COMMANDS = list(commands.find_all())


def status_of(run) -> int:
    with pytest.raises(SystemExit) as end:
        cli.main(run)
    return end.value.code


def raising(error):
    def run():
        raise error

    return run


def test_a_signal_in_a_callback_of_fork_ends_the_script_in_one_line():
    """There Python prints and swallows what is raised."""
    code = (
        "import os, signal\nfrom study.core import cli\n"
        "def run():\n"
        "    end = lambda: (os.kill(os.getpid(), signal.SIGTERM), [i for i in range(1000)])\n"
        "    os.register_at_fork(after_in_parent=end)\n"
        "    if os.fork() == 0:\n        os._exit(0)\n"
        "    raise cli.StudyError('nothing more is started')\n"
        "cli.main(run)"
    )
    words = [sys.executable, "-c", code]
    done = subprocess.run(
        words, capture_output=True, text=True, env=os.environ | {"PYTHONPATH": "scripts"}, cwd=ROOT
    )
    assert (done.returncode, done.stderr) == (128 + 15, "-c: ended by SIGTERM\n")


def test_main_gives_the_status_of_the_function():
    assert status_of(lambda: 1) == 1
    assert status_of(lambda: None) == 0


@pytest.mark.parametrize(
    ("error", "status"),
    [
        (cli.StudyError("no such thing"), 2),
        (cli.StudyError("no such thing", cli.CANNOT_RUN), 3),
        (KeyboardInterrupt(), 130),
    ],
)
def test_errors_are_one_line_and_a_status(error, status, capsys):
    assert status_of(raising(error)) == status
    said = capsys.readouterr()
    assert said.out == ""
    assert len(said.err.splitlines()) == 1
    assert str(error) in said.err


def test_a_bug_has_a_status_of_its_own_and_shows_its_traceback(capsys):
    assert status_of(lambda: 1 // 0) == cli.CRASHED
    said = capsys.readouterr().err
    assert said.startswith("Traceback") and "ZeroDivisionError" in said
    assert said.splitlines()[-1].endswith(": crashed: ZeroDivisionError")


@pytest.mark.parametrize("body", ["import study.no_such_module", "cli.main(lambda: 1 // 0)", "1 // 0"])
def test_a_bug_anywhere_in_a_script_has_that_status(body, tmp_path):
    path = script(tmp_path, f"from study.core import cli\n{body}\n")
    done = subprocess.run([sys.executable, path], capture_output=True, text=True, timeout=60)
    assert done.returncode == cli.CRASHED
    assert "Traceback" in done.stderr and done.stderr.splitlines()[-1].startswith("some.py: crashed: ")


def test_a_program_that_imports_the_study_keeps_its_own_statuses(tmp_path):
    script(tmp_path, "")
    path = tmp_path / "theirs.py"
    path.write_text("from study.core import cli\n1 // 0\n")
    environment = os.environ | {"PYTHONPATH": str(tmp_path / "scripts")}
    done = subprocess.run([sys.executable, path], capture_output=True, env=environment, timeout=60)
    assert done.returncode == 1


def test_the_documented_statuses_are_those_of_the_scripts():
    text = (ROOT / "docs" / "exit-statuses.md").read_text()
    rows = [line.split("|")[1:3] for line in text.splitlines() if line.startswith("| ")]
    assert {int(status): meaning.strip() for status, meaning in rows[2:]} == cli.STATUSES


def test_emit_writes_what_json_knows(capsys, monkeypatch):
    @dataclass
    class Interval:
        value: float
        low: float

    monkeypatch.setattr("sys.argv", ["stepwise some"])
    cli.emit(
        {
            "nan": float("nan"),
            "array": np.array([1.5, np.inf]),
            "integer": np.int64(3),
            "interval": Interval(np.float32(0.5), -np.inf),
            "path": Path("a/b"),
            1: (True, None),
        },
        Path("results/run"),
    )
    assert capsys.readouterr().out == "", "how it ends is not known yet"
    assert cli.finish(cli.FAILED) == cli.FAILED
    said = json.loads(capsys.readouterr().out)
    about = {"command": "some", "status": "failed", "run": "results/run"}
    assert said.items() >= about.items() and said.keys() == {*about, "result"}
    assert said["result"] == {
        "nan": None,
        "array": [1.5, None],
        "integer": 3,
        "interval": {"value": 0.5, "low": None},
        "path": "a/b",
        "1": [True, None],
    }


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
        assert "--seconds" not in action.option_strings, "the time for measuring is --budget"
        if not action.option_strings and "run" in action.dest:
            assert shown == "RUN"


def script(folder: Path, body: str) -> Path:
    """A script beside a copy of study/core/cli.py, in a tree of its own."""
    core = folder / "scripts" / "study" / "core"
    core.mkdir(parents=True)
    (core / "__init__.py").touch()
    shutil.copy(ROOT / "scripts" / "study" / "core" / "cli.py", core)
    shutil.copy(cli.DECLARED, folder)
    path = folder / "scripts" / "some.py"
    path.write_text(body)
    return path


def run_bare(path: Path, *arguments: str) -> subprocess.CompletedProcess:
    """Run without site-packages, as outside the venv."""
    environment = {key: value for key, value in os.environ.items() if not key.startswith("STEPWISE")}
    command = [sys.executable, "-S", str(path), *arguments]
    return subprocess.run(command, capture_output=True, text=True, env=environment, timeout=60)


def test_missing_package_goes_on_in_the_venv(tmp_path):
    path = script(tmp_path, "from study.core import cli\nprint('not reached')\n")
    python = tmp_path / ".venv" / "bin" / "python"
    python.parent.mkdir(parents=True)
    python.write_text('#!/bin/sh\necho "venv: $*"\n')
    python.chmod(0o755)
    done = run_bare(path, "--phase", "a b")
    assert done.stdout == f"venv: -S {path} --phase a b\n"
    assert done.returncode == 0


@pytest.mark.parametrize("venv", [True, False])
def test_missing_package_without_way_out_is_one_line(tmp_path, venv):
    path = script(tmp_path, "from study.core import cli\nprint('not reached')\n")
    if venv:  # a venv that lacks the package as well: no loop
        python = tmp_path / ".venv" / "bin" / "python"
        python.parent.mkdir(parents=True)
        python.write_text(f'#!/bin/sh\nexec {shlex.quote(sys.executable)} "$@"\n')
        python.chmod(0o755)
    done = run_bare(path)
    assert done.returncode == cli.CANNOT_RUN
    assert done.stdout == ""
    assert done.stderr.startswith("some.py: numpy, ")
    assert done.stderr.endswith("missing; run `make setup` first\n")


def test_a_reader_that_goes_away_is_no_error(tmp_path):
    path = tmp_path / "many.py"
    path.write_text("from study.core import cli\ncli.main(lambda: print('x' * 1_000_000))\n")
    environment = os.environ | {"PYTHONPATH": str(ROOT / "scripts")}
    child = subprocess.Popen(
        [sys.executable, path], stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=environment
    )
    child.stdout.read(10)
    child.stdout.close()
    assert child.stderr.read() == b""
    child.stderr.close()
    assert child.wait() == 0


@pytest.mark.slow
@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_names_its_exit_statuses(name):
    done = started.run([sys.executable, STEPWISE, name, "-h"])
    assert done.returncode == 0, done.stderr
    assert "exit status:" in done.stdout
    assert "--json" in done.stdout


@pytest.mark.slow
@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_refuses_an_unknown_option(name):
    done = started.run([sys.executable, STEPWISE, name, "--no-such-option"])
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    assert done.stdout == ""


@pytest.mark.parametrize(
    ("lowest", "kind", "text", "value"),
    [
        *((1, int, text, None) for text in ("0", "-1", "1.5", "1e3", "x", "", "nan", "inf", "9" * 5000)),
        *((0.5, float, text, None) for text in ("0.4", "-1", "x", "", "nan", "inf", "-inf", "1e999")),
        *((1, int, "1", 1), (0, int, "0", 0), (0.5, float, "0.5", 0.5), (0, float, "1e3", 1000.0)),
    ],
)
def test_a_number_that_is_too_small_or_none_is_said_with_what_would_be_right(
    lowest, kind, text, value, capsys
):
    made = cli.parser("what it does")
    made.add_argument("-n", type=cli.at_least(lowest, kind))
    if value is not None:
        assert made.parse_args(["-n", text]).n == value
        return
    with pytest.raises(SystemExit) as end:
        made.parse_args([f"-n={text}"])
    what = "a whole number" if kind is int else "a number"
    said = capsys.readouterr().err.splitlines()[-1]
    assert end.value.code == 2 and said.endswith(
        f"argument -n: '{text}': must be {what} of at least {lowest}"
    )
