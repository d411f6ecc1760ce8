"""docs/tutorial.md: every command and every diff in it, in order, in a copy of the project."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import copied
import pytest

from study.core.registry import ROOT

pytestmark = pytest.mark.slow

TEXT = (ROOT / "docs" / "tutorial.md").read_text(encoding="utf-8")
BLOCK = re.compile(r"^```(sh|diff)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
# Behind a command of the text: less of the same work.
SMALLER = {
    "demo": "ARGS='--budget 2'",
    "try": "N=36 ARGS='--launches 2'",
    "verify": "N=18 ARGS='--antialias-n 18'",
}


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """The project without what was built but ground truth, with this one's packages."""
    return copied.built(copied.sources(tmp_path))


def run(command: str, folder: Path) -> str:
    done = subprocess.run(["sh", "-c", command], cwd=folder, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, f"{command}\n{done.stdout[-2000:]}\n{done.stderr[-2000:]}"
    return done.stdout


def test_every_command_works_as_the_text_says(copy: Path) -> None:
    said = {}
    for kind, text in BLOCK.findall(TEXT):
        if kind == "diff":
            done = subprocess.run(["patch", "-p0"], input=text, text=True, cwd=copy, capture_output=True)
            assert done.returncode == 0 and not re.search("fuzz|offset", done.stdout), (
                done.stdout + done.stderr
            )
            continue
        for command in text.splitlines():
            goal = re.match(r"make (\w+)", command)
            said[command] = run(f"{command} {SMALLER.get(goal[1], '') if goal else ''}", copy)
    assert len(said) == 8
    tried = said["make try NAME=mine"]
    picture, evaluations, flops = (
        re.search(rf"^{name} +(\S+) +(\S+?)(?:, by .*)?$", tried, re.MULTILINE).groups()
        for name in ("PSNR to baseline, dB", "evaluations of a camera ray", "declared FLOPs a pixel")
    )
    assert picture == ("identical", "identical") and evaluations[0] == evaluations[1]
    assert float(flops[1].replace(",", "")) < float(flops[0].replace(",", ""))
    assert (copy / "build" / "try" / "mine-scene0.png").is_file()
