"""Virtual environments below build/ for programs that are no part of this project."""

import sys
from collections.abc import Sequence
from pathlib import Path

from study.core import cli
from study.core.cli import CANNOT_RUN, StudyError
from study.core.host import child


def has(python: Path, modules: str) -> bool:
    """Whether that Python can import `modules`, written as in an import statement."""
    try:
        done = child.run([python, "-I", "-c", f"import {modules}"], capture_output=True)
    except OSError:
        return False
    return done.returncode == 0


def python_of(home: Path) -> Path:
    """Where the Python of an environment in `home` is, or would be."""
    return home / "venv" / "bin" / "python"


def install(home: Path, packages: Sequence[str]) -> None:
    """A new environment in home/venv with packages from PyPI. Raises StudyError with pip's last line."""
    cli.say(f"installing {' '.join(packages)} into {home / 'venv'}")
    for command in (
        [sys.executable, "-I", "-m", "venv", "--clear", home / "venv"],
        [python_of(home), "-I", "-m", "pip", "install", "-q", "--disable-pip-version-check", *packages],
    ):
        done = child.run(command, capture_output=True, text=True)
        if done.returncode:
            said = (done.stderr or done.stdout).strip().splitlines()
            last = said[-1] if said else f"exit status {done.returncode}"
            raise StudyError(f"{packages[0]} cannot be installed ({last})", CANNOT_RUN)
