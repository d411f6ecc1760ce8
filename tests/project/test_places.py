"""Places that a checkout is put in."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

from study.core.registry import ROOT

ODD = 'a "b" it\'s käfig × %s $x'
PARTS = ["common", "phases", "systems", "truth", "scripts"]


@pytest.mark.slow
def test_in_any_path_with_no_home_and_nothing_for_others(tmp_path: Path) -> None:
    """A phase is built and draws where the path has quotes, blanks and other letters, under umask 077."""
    folder = tmp_path / ODD
    for name in PARTS:
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "Makefile", folder)
    made = "umask 077; unset HOME; make -s phase-opt1 && "
    made += "build/opt1/render common/scenes/scene0.json -n 4 -o 'a b.exr'"
    for more in ({}, {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}):
        shutil.rmtree(folder / "build", ignore_errors=True)
        done = subprocess.run(["sh", "-c", made], cwd=folder, env=os.environ | more, capture_output=True)
        assert (done.returncode, done.stderr) == (0, b"") and (folder / "a b.exr").stat().st_size > 500
        assert (folder / "build").stat().st_mode & 0o77 == 0
