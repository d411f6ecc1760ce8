"""For tests of the scripts: a command within this process, and intervals of fewer resamples."""

from __future__ import annotations

import subprocess
from collections.abc import Callable

import emitted
import pytest

from study.numbers import stats


@pytest.fixture
def stepwise() -> Callable[..., subprocess.CompletedProcess[str]]:
    """`scripts/stepwise` with these words, within this process: status and what it wrote."""
    return emitted.ran


@pytest.fixture
def few_resamples(monkeypatch: pytest.MonkeyPatch) -> None:
    """A twentieth of the bootstrap: for tests of what is made of intervals."""
    monkeypatch.setattr(stats, "RESAMPLES", 500)


@pytest.fixture
def rough_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Figures whose names and axes come only nearly to their places: for tests of what else there is."""
    monkeypatch.setattr("study.pictures.draw.PASSES", 1)
