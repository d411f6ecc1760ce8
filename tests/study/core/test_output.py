"""What commands print where the terminal is narrow, of another encoding, closed, or none at all."""

from __future__ import annotations

import contextlib
import fcntl
import os
import pty
import struct
import subprocess
import sys
import termios

import pytest

from study.core.registry import ROOT

LISTED = [sys.executable, str(ROOT / "scripts" / "stepwise"), "list"]  # has ×


def listed(how: str = "", **environment: str) -> subprocess.CompletedProcess[bytes]:
    command = ["sh", "-c", f'exec "$@" {how}', "sh", *LISTED]
    kept = {key: value for key, value in os.environ.items() if not key.startswith(("LC_", "LANG", "PYTHON"))}
    return subprocess.run(command, capture_output=True, env=kept | environment, timeout=120)


@pytest.mark.slow
@pytest.mark.parametrize(
    "environment, encoding, product",
    [
        ({"PYTHONIOENCODING": "ascii"}, "ascii", "phases x scenes"),
        ({"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}, "ascii", "phases x scenes"),
        ({"PYTHONIOENCODING": "latin-1"}, "latin-1", "phases × scenes"),
        ({"PYTHONIOENCODING": "utf-8"}, "utf-8", "phases × scenes"),
    ],
)
def test_encodings(environment: dict[str, str], encoding: str, product: str) -> None:
    done = listed(**environment)
    assert (done.returncode, done.stderr) == (0, b"")
    text = done.stdout.decode(encoding)
    assert product in text and "\\u00" not in text


@pytest.mark.slow
@pytest.mark.parametrize("how", [">&-", "2>&-", "<&- >&- 2>&-", "| head -n 1", ">/dev/null"])
def test_closed(how: str) -> None:
    done = listed(how, COLUMNS="40", TERM="dumb")
    assert (done.returncode, done.stderr) == (0, b"")


def test_help_of_forty_columns() -> None:
    """Options and their words fit; only a usage's or an option's own words can be longer."""
    command = [*LISTED[:2], "sweep", "--help"]
    done = subprocess.run(command, capture_output=True, text=True, env=os.environ | {"COLUMNS": "40"})
    options = done.stdout.partition("options:")[2].partition("exit status:")[0].splitlines()
    assert done.returncode == 0 and len(options) > 40
    assert [line for line in options if len(line) > 40 and not line.lstrip().startswith("-")] == []


BAR = """
import time
from study.core import cli, progress
cli.speak()
with progress.Progress("sweep\\x1b[2J", 20, share=True) as bar:
    for number in range(1, 21):
        time.sleep(0.06)
        bar.to(number, f"round 3: opt4 a scene of a long name, 1280x720 on 16 threads\\x1b]0;title\\x07")
cli.say("done\\x1b[2J")
"""


def shown(columns: int | None) -> str:
    """What a terminal of so many columns is sent as standard error, or a pipe."""
    environment = os.environ | {"PYTHONPATH": str(ROOT / "scripts"), "TERM": "xterm"}
    environment.pop("COLUMNS", None)
    command = [sys.executable, "-c", BAR]
    if columns is None:
        return subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stderr
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 24, columns, 0, 0))
    said = b""
    with subprocess.Popen(command, env=environment, stderr=theirs) as child:
        os.close(theirs)
        with contextlib.suppress(OSError):  # the terminal's end
            while data := os.read(ours, 4096):
                said += data
    os.close(ours)
    assert child.returncode == 0, said
    return said.decode().replace("\r\n", "\n")


@pytest.mark.parametrize("columns", [40, 80, 200])
def test_a_bar_stays_in_its_line(columns: int) -> None:
    said = shown(columns)
    lines = [line for part in said.split("\n") for line in part.split("\r")]
    assert len(lines) > 10 and max(map(len, lines)) <= columns
    assert any("%" in line for line in lines) and lines[-2] == "done\\x1b[2J"
    assert "\x1b]0;" not in said and "\x1b[2J" not in said and "\x07" not in said


def test_no_bar_without_a_terminal() -> None:
    said = shown(None)
    assert "\r" not in said and "\x1b" not in said
    assert [line.partition(", after")[0] for line in said.splitlines()] == [
        "sweep\\x1b[2J: 100 %",
        "done\\x1b[2J",
    ]
