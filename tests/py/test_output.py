"""What commands print where the terminal is narrow, of another encoding, closed, or none at all."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from study.core.registry import ROOT

GOALS = [sys.executable, str(ROOT / "scripts" / "stepwise"), "goals"]  # has ×, ≥, – and spaces of its own


def goals(how: str = "", **environment: str) -> subprocess.CompletedProcess[bytes]:
    command = ["sh", "-c", f'exec "$@" {how}', "sh", *GOALS]
    kept = {key: value for key, value in os.environ.items() if not key.startswith(("LC_", "LANG", "PYTHON"))}
    return subprocess.run(command, capture_output=True, env=kept | environment, timeout=120)


@pytest.mark.parametrize(
    "environment, encoding, product",
    [
        ({"PYTHONIOENCODING": "ascii"}, "ascii", "1280x720"),
        ({"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}, "ascii", "1280x720"),
        ({"PYTHONIOENCODING": "latin-1"}, "latin-1", "1280×720"),
        ({"PYTHONIOENCODING": "utf-8"}, "utf-8", "1280×720"),
    ],
)
def test_encodings(environment: dict[str, str], encoding: str, product: str) -> None:
    done = goals(**environment)
    assert (done.returncode, done.stderr) == (0, b"")
    text = done.stdout.decode(encoding)
    assert product in text and "\\u00" not in text
    assert (">= 150" if encoding != "utf-8" else "≥ 150") in text


@pytest.mark.parametrize("how", [">&-", "2>&-", "<&- >&- 2>&-", "| head -n 1", ">/dev/null"])
def test_closed(how: str) -> None:
    done = goals(how, COLUMNS="40", TERM="dumb")
    assert (done.returncode, done.stderr) == (0, b"")


def test_help_of_forty_columns() -> None:
    command = [*GOALS[:2], "sweep", "--help"]
    done = subprocess.run(command, capture_output=True, text=True, env=os.environ | {"COLUMNS": "40"})
    assert done.returncode == 0 and max(map(len, done.stdout.splitlines()[:20])) <= 78
