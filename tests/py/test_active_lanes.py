"""Useful lanes of the SIMD phases where they follow from the scene, whatever the picture is."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

from study.build import build

ROOT = Path(__file__).parents[2]


def test_a_gradient_works_for_all_that_hit_its_shape(tmp_path: Path) -> None:
    """Boxes with one front, which they share in the middle: there the whole scene's difference is taken, and
    the closed form after it again for all: where there are boxes only, as many as gradient_of was asked for.
    """
    scene = json.loads((ROOT / "common" / "scenes" / "trio.json").read_text())
    box = {"type": "box", "half_size": [1, 1, 1], "material": next(iter(scene["materials"]))}
    scene["shapes"] = [box | {"position": [x, 0, 12]} for x in (-0.5, 0.5)]
    path = tmp_path / "boxes.json"
    path.write_text(json.dumps(scene))
    command = [build("opt4", "render-count"), path, "-n", "64", "--json"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    made = json.loads(done.stdout)["by_function"]
    asked, closed = made["gradient_of"], made["box_gradient"]
    assert made["scene_difference"]["calls"] > 0  # or nothing here could go wrong
    assert made["scene_difference"]["lanes"] < 8 * made["scene_difference"]["calls"]
    assert (closed["calls"], closed["lanes"]) == (asked["calls"], asked["lanes"])
