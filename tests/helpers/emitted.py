"""A command in the tests' own process, and what it prints with --json: one object of one shape."""

import json
import sys
from typing import Any
from unittest import mock

from study.core import commands


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
