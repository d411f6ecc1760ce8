"""scripts/stepwise: its commands are found by their files, and docs/commands.md is what they say."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
import started

from study.commands import docs
from study.core import cli, commands
from study.core.cli import StudyError
from study.core.registry import ROOT
from study.experiments import experiment

STEPWISE = ROOT / "scripts" / "stepwise"


def stepwise(*words: str) -> subprocess.CompletedProcess:
    return started.run([sys.executable, STEPWISE, *words])


def test_the_list_names_every_command_and_what_it_does() -> None:
    done = stepwise("list")
    assert done.returncode == 0
    lines = [line.split(maxsplit=1) for line in done.stdout.splitlines() if line.startswith("  ")]
    assert dict(lines) == {name: one.what for name, one in commands.find_all().items()}
    assert {"sweep", "try", "new-phase", "report", "study"} <= {name for name, _ in lines}


def test_every_experiment_that_measures_has_a_command_of_its_name() -> None:
    found = {name for name, one in commands.find_all().items() if one.experiment}
    assert found == {name for name, one in experiment.find_all().items() if one.command}


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["sweeep"], "sweep"),
        (["zzz"], "scripts/stepwise list"),
        ([], "scripts/stepwise list"),
    ],
)
def test_another_name_is_one_line_with_what_would_be_right(words: list[str], said: str) -> None:
    done = stepwise(*words)
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (cli.BAD_INPUT, "", 1)
    assert said in done.stderr


def test_a_module_that_does_not_say_what_it_does_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "command.py"
    path.write_text("import os\n")
    with pytest.raises(StudyError, match=r"command\.py: "):
        _ = commands.Command("x", path, True).what


def test_pages_made_from_the_code_are_what_it_says() -> None:
    """`scripts/stepwise docs` writes them again; of the keys of a run's files none is committed."""
    made = docs.pages()
    assert "build/docs/keys/frames.jsonl.md" in made
    for name in ("docs/commands.md", "results/README.md"):
        assert (ROOT / name).read_text(encoding="utf-8") == made[name], f"{name}: write it again"
