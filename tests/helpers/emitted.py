"""What a command prints with --json: one object of one shape, whatever the command."""

import json
from typing import Any


def whole(text: str) -> dict[str, Any]:
    """The object, its outer shape checked."""
    said = json.loads(text)
    assert list(said) == ["command", "status", "run", "result"], said.keys()
    assert said["status"] in ("ok", "failed") and isinstance(said["run"], str | None)
    return said


def result(text: str) -> Any:
    return whole(text)["result"]
