""".github/gate.sh as far as it goes without two builds, and what the workflow calls."""

import re
import subprocess
from pathlib import Path

import pytest

from study.core import commands
from study.core.registry import ROOT

GATE = ROOT / ".github" / "gate.sh"


def gate(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([GATE, *arguments], capture_output=True, text=True, timeout=60)


@pytest.mark.parametrize("arguments", [(), ("HEAD",), ("HEAD", "a", "b")])
def test_it_asks_for_a_commit_and_a_folder(arguments: tuple[str, ...]) -> None:
    done = gate(*arguments)
    assert done.returncode == 2 and done.stderr.count("\n") == 1 and "two arguments" in done.stderr


def test_an_unknown_commit_ends_it(tmp_path: Path) -> None:
    done = gate("no-such-commit", str(tmp_path / "out"))
    assert done.returncode not in (0, 1) and not (tmp_path / "out" / "base").exists()


def test_the_workflow_calls_what_is_there() -> None:
    """Its scripts and make's targets exist, and so do the commands of the gate."""
    text = (ROOT / ".github" / "workflows" / "gate.yml").read_text(encoding="utf-8")
    runs = re.findall(r"- run: (.*)", text)
    assert [line.split()[0] for line in runs] == ["make", ".github/gate.sh"]
    assert re.search(rf"^{runs[0].split()[1]}:", (ROOT / "Makefile").read_text(), re.MULTILINE)
    called = re.findall(r"scripts/stepwise\" (\w+)", GATE.read_text(encoding="utf-8"))
    assert set(called) == {"sweep", "verify", "compare"} and set(called) <= set(commands.find_all())
