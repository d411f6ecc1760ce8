"""What a test needs of the machine, else it is left out by name."""

from __future__ import annotations

from pathlib import Path

import pytest

from study.core import registry
from study.core.cli import StudyError
from study.core.host import sandbox as boxes
from study.experiments.original import measure as original


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
