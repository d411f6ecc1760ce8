"""For tests of the scripts: a command within this process, and intervals of fewer resamples."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable

import pytest

from study.core import cli, commands
from study.numbers import stats


@pytest.fixture
def stepwise(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Callable[..., subprocess.CompletedProcess[str]]:
    """`scripts/stepwise` with these words, within this process: status and what it wrote."""

    def call(*words: object) -> subprocess.CompletedProcess[str]:
        monkeypatch.setattr(sys, "argv", ["stepwise", *map(str, words)])
        monkeypatch.setattr(cli.signal, "signal", lambda *_: None)  # pytest keeps its own handlers
        capsys.readouterr()
        with pytest.raises(SystemExit) as ended:
            cli.main(commands.main)
        out, err = capsys.readouterr()
        return subprocess.CompletedProcess(sys.argv, ended.value.code, out, err)

    return call


@pytest.fixture
def few_resamples(monkeypatch: pytest.MonkeyPatch) -> None:
    """A twentieth of the bootstrap: for tests of what is made of intervals."""
    monkeypatch.setattr(stats, "RESAMPLES", 500)
