"""scripts/stepwise: its commands are found by their files, and docs/commands.md is what they say."""

import os
import re

import pytest

from study.commands.upkeep import docs
from study.core import cli, commands
from study.core.registry import ROOT, animated
from study.experiments import experiment
from study.experiments.flight import measure as flight
from study.experiments.stability import command as stability


def test_the_list_names_every_command_and_what_it_does(stepwise) -> None:
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
def test_another_name_is_one_line_with_what_would_be_right(words: list[str], said: str, stepwise) -> None:
    done = stepwise(*words)
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (cli.BAD_INPUT, "", 1)
    assert said in done.stderr


def test_pages_made_from_the_code_are_what_it_says() -> None:
    """`scripts/stepwise docs` writes them again; helps and the keys of a run's files are not committed."""
    made = docs.pages()
    assert {"build/docs/keys/frames.jsonl.md", "build/docs/commands/sweep.md"} <= made.keys()
    rows = [line for line in made["docs/commands.md"].splitlines() if line.startswith("| `")]
    assert [row.split("`")[1] for row in rows] == list(commands.find_all())
    assert max(map(len, rows)) <= 100
    for name in ("docs/commands.md", "results/README.md", "phases/opt9_convex/MAP.md"):
        assert (ROOT / name).read_text(encoding="utf-8") == made[name], f"{name}: write it again"


def test_a_help_names_commands_that_there_are() -> None:
    """And that of animation one that takes animated scenes."""
    named = {
        name: re.findall(r"scripts/stepwise ([a-z-]+)", commands.parser_of(one).format_help())
        for name, one in commands.find_all().items()
    }
    assert {other for names in named.values() for other in names} <= commands.find_all().keys()
    assert named["animation"] == ["flight", "farm"]
    assert flight.scenes() and all(flight.find(name) == animated()[name] for name in flight.scenes())


def test_what_a_command_sets_in_the_environment_ends_with_it(monkeypatch) -> None:
    """A study calls all of its commands in one process."""

    def measure(args) -> cli.Outcome:
        os.environ["STEPWISE_CC"] = "none"
        os.environ.pop("STEPWISE_LEFT", None)
        return cli.Outcome({})

    monkeypatch.delenv("STEPWISE_CC", raising=False)
    monkeypatch.setenv("STEPWISE_LEFT", "1")
    monkeypatch.setattr(stability, "measure", measure)
    commands.called("stability", [])
    assert "STEPWISE_CC" not in os.environ and os.environ["STEPWISE_LEFT"] == "1"
