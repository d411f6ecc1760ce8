"""The viewer, built and run for tests. Left out by name where a library or a program is missing."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import programs
import pytest

from study.pictures import images

ROOT = Path(__file__).parents[2]
PROGRAM = ROOT / "build" / "viewer"


def has(package: str) -> bool:
    return subprocess.run(["pkg-config", "--exists", package]).returncode == 0


def build(*packages: str) -> Path:
    """build/viewer."""
    for package in packages:
        if not has(package):
            pytest.skip(f"{package} is missing: make view installs it")
    return programs.built("viewer")


def window_tools() -> None:
    for tool in ("Xvfb", "xdotool"):
        if not shutil.which(tool):
            pytest.skip(f"{tool} is missing: apt-get install xvfb xdotool")


def script(path: Path, lines: Iterable[dict[str, Any]]) -> Path:
    path.write_text("".join(json.dumps(line) + "\n" for line in lines))
    return path


def run(words: Sequence[str | Path], **environment: str) -> subprocess.CompletedProcess[str]:
    """One run of the viewer without a display, with one minute."""
    rest = {key: value for key, value in os.environ.items() if not key.endswith("DISPLAY")}
    return subprocess.run(
        [PROGRAM, *words], env=rest | environment, capture_output=True, text=True, timeout=60
    )


def headless(
    folder: Path, lines: Iterable[dict[str, Any]], size: str, scene: str | Path = "scene0"
) -> list[np.ndarray]:
    """The frames of a script: each height × width × 3 of uint8."""
    words = [scene, "--script", script(folder / "script.jsonl", lines), "--headless", "-o", folder / "out"]
    done = run([*words, "--size", size, "--threads", "1", "--phase", "opt4", "--reference", "opt2"])
    assert done.returncode == 0, done.stderr
    return [images.read_png(path) for path in sorted((folder / "out").glob("*.png"))]


def displayed(folder: Path, phase: str, scene: str | Path, height: int, *more: str) -> np.ndarray:
    """The picture that the phase's own driver displays: height × width × 3 of uint8."""
    out = folder / "driver.ppm"
    words = [programs.built(f"{phase}/render"), scene, "-n", str(height), "--display", "-o", out, *more]
    subprocess.run(words, check=True, capture_output=True)
    return images.read_ppm(out)
