"""The types of scripts/ hold: mypy, with its settings of pyproject.toml."""

from __future__ import annotations

import subprocess
import sys

from study.core.registry import ROOT


def test_types() -> None:
    done = subprocess.run([sys.executable, "-m", "mypy"], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout[-5000:] + done.stderr
