"""The artifact appendix's table: its commands take those words, its chapters are the report's."""

import os
import subprocess

import pytest

from study.core import commands
from study.core.registry import ROOT
from study.numbers import analysis, ladder
from study.report import appendix, chapters


def called(command: str) -> list[list[str]]:
    """Words of each scripts/stepwise that the command runs."""
    lines = [command]
    if command.startswith("make "):
        environment = {key: text for key, text in os.environ.items() if not key.startswith("MAKE")}
        words = ["make", "-n", "-C", str(ROOT), *command.split()[1:]]
        done = subprocess.run(words, capture_output=True, text=True, env=environment)
        assert done.returncode == 0, done.stderr
        lines = done.stdout.splitlines()
    return [line.split("scripts/stepwise ")[1].split() for line in lines if "scripts/stepwise " in line]


@pytest.mark.parametrize("claim", appendix.CLAIMS, ids=lambda claim: claim.command)
def test_a_claims_command_is_there(claim: appendix.Claim) -> None:
    for name, *words in called(claim.command):
        commands.parser_of(commands.find_all()[name]).parse_args(words)


def test_what_was_found_is_a_runs() -> None:
    data = analysis.load(ROOT / "tests" / "fixtures" / "run")
    sections = [one for some in chapters.asked(data, ladder.rows(data)).values() for one in some]
    assert {one.chapter for one in appendix.CLAIMS} - {""} <= {one.id for one in sections}
    lines = appendix.block(data, sections).splitlines()
    found = {
        line.split(" | ")[1]: line.split(" | ")[3].removesuffix(" |") for line in lines if "`make" in line
    }
    assert len(found) > 5 and "baseline" in found["`make sweep`"] and found["`make pareto`"] == "–"
