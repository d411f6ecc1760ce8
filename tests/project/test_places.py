"""Places that a checkout is put in."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

import pytest

from study.core.registry import ROOT

ODD = 'a "b" it\'s käfig × %s $x'
SETUP = "scripts/setup.sh study"
PARTS = [
    "common",
    "phases",
    "systems",
    "truth",
    "scripts",
    "Makefile",
    "requirements.lock",
    "requirements.in",
]


def checkout(folder: Path) -> Path:
    """A copy of what builds, without .git, .venv and build."""
    folder.mkdir(parents=True)
    for name in PARTS:
        if (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(ROOT / name, folder)
    return folder


def run(folder: Path, script: str, prefix: Sequence[str] = (), **environment: str) -> tuple[int, str, str]:
    """Status and outputs of a shell's line in that folder."""
    kept = {key: value for key, value in os.environ.items() if "proxy" not in key.lower()}
    done = subprocess.run(
        [*prefix, "sh", "-c", script],
        cwd=folder,
        env=kept | environment,
        capture_output=True,
        text=True,
        timeout=500,
    )
    return done.returncode, done.stdout, done.stderr


@pytest.mark.slow
def test_in_any_path_with_no_home_and_nothing_for_others(tmp_path: Path) -> None:
    """A phase is built and draws where the path has quotes, blanks and other letters, under umask 077."""
    folder = checkout(tmp_path / ODD)
    made = "umask 077; unset HOME; make -s phase-opt1 && "
    made += "build/opt1/render common/scenes/scene0.json -n 4 -o 'a b.exr'"
    for environment in ({}, {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}):
        shutil.rmtree(folder / "build", ignore_errors=True)
        status, _, error = run(folder, made, **environment)
        assert (status, error) == (0, "") and (folder / "a b.exr").stat().st_size > 500
        assert (folder / "build").stat().st_mode & 0o77 == 0
