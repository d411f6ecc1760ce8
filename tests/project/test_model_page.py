"""docs/model.md: its scenes, step by step, are drawn; and its refusal is what the driver says."""

from __future__ import annotations

import json
import re
import subprocess
from pathlib import Path

from study.core.build import build
from study.core.registry import ROOT

PAGE = (ROOT / "docs" / "model.md").read_text()


def drawn(scene: dict, folder: Path) -> subprocess.CompletedProcess[str]:
    (folder / "cup.json").write_text(json.dumps(scene))
    command = [build("baseline"), "cup.json", "-n", "6", "-o", "cup.png"]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True)


def test_every_step_of_the_page_is_drawn(tmp_path: Path) -> None:
    blocks = re.findall(r"```json\n(.*?)```", PAGE, re.DOTALL)
    whole = json.loads(blocks[0])
    floor, ball = whole["shapes"]
    cut, blended, modified = (json.loads(f"[{block}]") for block in blocks[1:])
    for shapes in ([floor, ball], [floor, ball, *cut], [floor, ball, *blended], [floor, *blended, *modified]):
        done = drawn(whole | {"shapes": shapes}, tmp_path)
        assert done.returncode == 0 and not done.stderr, done.stderr
    refused = drawn(whole | {"shapes": [floor, ball | {"radius": -1}]}, tmp_path)
    assert refused.returncode == 2 and f"    {refused.stderr}" in PAGE
