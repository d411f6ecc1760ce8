"""C and Python stand in the house style: `make format` writes it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from study.core.registry import ROOT

TOOLS = Path(sys.executable).parent
C_FOLDERS = ("common", "phases", "systems", "truth", "web", "tests/c", "tests/calibration", "tests/emulate")
COMMANDS = {
    "clang-format": ["--dry-run", "-Werror", *(p for f in C_FOLDERS for p in (ROOT / f).rglob("*.[ch]"))],
    "ruff check": ["check", "."],
    "ruff format": ["format", "--check", "."],
}


@pytest.mark.parametrize("name", COMMANDS)
def test_format(name: str) -> None:
    tool = [TOOLS / name.split()[0]]
    if name == "clang-format":  # as in the Makefile: its script does not start in a path with quotes
        tool = [sys.executable, "-c", "import clang_format; clang_format.clang_format()"]
    done = subprocess.run([*tool, *COMMANDS[name]], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
