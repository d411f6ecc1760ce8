"""What a test needs of the machine, else it is left out by name; and copies of the project."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from study.core import registry
from study.core.cli import StudyError
from study.core.host import sandbox as boxes
from study.core.registry import ROOT
from study.experiments.original import measure as original

LEFT_OUT = (".git", ".venv", "build", "results/reference", "__pycache__")


def cpu_for(phase: str) -> None:
    """Leaves the test out where the CPU lacks what the phase needs."""
    if lacking := registry.missing_isa(registry.find_phase(phase)):
        pytest.skip(f"the CPU lacks {', '.join(lacking)}, which {phase} needs")


def sandbox(writable: Path) -> None:
    """Leaves the test out where bubblewrap does not work, which it names."""
    with boxes.entered(writable) as lacking:
        if lacking:
            pytest.skip(lacking)


def papers_program() -> Path:
    """The repository of the paper's program; leaves the test out where it cannot be had."""
    kept = original.folder_of(original.REPOSITORY)
    try:
        original.fetch(original.REPOSITORY, kept)
    except StudyError as error:
        pytest.skip(str(error))
    return kept


def copy(folder: Path) -> Path:
    """Without what was built but ground truth, with this one's packages."""
    names = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True)
    for name in names.stdout.splitlines():
        if not name.startswith(LEFT_OUT):
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, folder / name)
    built(folder)
    return folder


def built(folder: Path) -> None:
    """This project's packages, and what it has built of common/ and of ground truth."""
    (folder / ".venv").symlink_to((ROOT / ".venv").resolve())
    for name in ("common", "truth"):
        if (ROOT / "build" / name).is_dir():
            shutil.copytree(ROOT / "build" / name, folder / "build" / name)
