"""A broken file of a run: one line names the file and the key, with status 2."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import complete
import msgspec
import pytest

from study.core.cli import StudyError
from study.core.registry import ROOT
from study.core.schema import File

SCHEMAS = complete.schemas()
FIXTURE = ROOT / "tests" / "fixtures" / "run"


def needed(kind: type[File]) -> str | None:
    """A key that the file cannot be without."""
    return next((one.encode_name for one in msgspec.structs.fields(kind) if one.required), None)


def without(name: str, made: dict[str, Any]) -> str:
    key = needed(SCHEMAS[name])
    return json.dumps({k: v for k, v in made.items() if k != key})


BROKEN: dict[str, Callable[[str, dict[str, Any]], str]] = {
    "cut": lambda name, made: json.dumps(made)[:-1],
    "another type": lambda name, made: json.dumps(made | {needed(SCHEMAS[name]) or "schema": {"a": [1]}}),
    "a key missing": without,
}


@pytest.mark.parametrize("how", BROKEN)
@pytest.mark.parametrize("name", sorted(SCHEMAS))
def test_a_broken_file_is_named_with_its_key(name: str, how: str, tmp_path: Path) -> None:
    kind, path = SCHEMAS[name], tmp_path / name
    key = needed(kind)
    if how == "a key missing" and not key:
        pytest.skip("all of its keys may be missing")
    path.write_text(BROKEN[how](name, json.loads(complete.text(name, {}))))
    with pytest.raises(StudyError) as caught:
        kind.load(path)
    said = str(caught.value)
    assert said.startswith(str(path)) and kind.made_by in said and said.count("\n") == 0
    assert how == "cut" or "`" in said


@pytest.mark.parametrize("name", ["context.json", "plan.json", "verify.json", "frames.jsonl"])
def test_a_command_ends_with_status_2(name: str, tmp_path: Path, stepwise: Callable) -> None:
    run = tmp_path / "run"
    shutil.copytree(FIXTURE, run)
    (run / name).write_text('{"pairs": 1, "schema": 9, "configurations": 1}\n')
    done = stepwise("tables", run, "-o", tmp_path / "out")
    assert done.returncode == 2 and len(done.stderr.splitlines()) == 1, done.stderr
    assert str(run / name) in done.stderr
