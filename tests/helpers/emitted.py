"""A command in the tests' own process, and what it prints with --json: one object of one shape."""

import io
import json
import subprocess
import sys
from contextlib import redirect_stderr, redirect_stdout
from typing import Any
from unittest import mock

import pytest

from study.core import cli, commands


def ran(*words: object) -> subprocess.CompletedProcess[str]:
    """`scripts/stepwise` with these words: status and what it wrote."""
    argv, out, err = ["stepwise", *map(str, words)], io.StringIO(), io.StringIO()
    with (
        mock.patch.object(sys, "argv", argv),
        mock.patch.object(cli.signal, "signal"),  # pytest keeps its own handlers
        redirect_stdout(out),
        redirect_stderr(err),
        pytest.raises(SystemExit) as ended,
    ):
        cli.main(commands.main)
    return subprocess.CompletedProcess(argv, ended.value.code, out.getvalue(), err.getvalue())


def told(name: str, *words: object) -> int:
    """Runs it and prints as scripts/stepwise does; its exit status. StudyError, SystemExit."""
    with mock.patch.object(sys, "argv", [f"stepwise {name}"]):
        outcome, as_json = commands.called(name, list(map(str, words)))
        return outcome.tell(as_json)


def whole(text: str) -> dict[str, Any]:
    """The object, its outer shape checked."""
    said = json.loads(text)
    assert list(said) == ["command", "status", "run", "result"], said.keys()
    assert said["status"] in ("ok", "failed") and isinstance(said["run"], str | None)
    return said


def result(text: str) -> Any:
    return whole(text)["result"]
