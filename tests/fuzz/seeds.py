"""Writes small scenes to a folder, a file each: the project's own, three shapes at most, without spaces.

python3 tests/fuzz/seeds.py FOLDER. Short inputs load faster, and what is wrong with one is found by eye.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

SCENES = Path(__file__).parents[2] / "common" / "scenes"


def write(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for path in sorted(SCENES.rglob("*.json")):
        scene = json.loads(path.read_text())
        scene["shapes"] = scene["shapes"][:3]
        (folder / path.name).write_text(json.dumps(scene, separators=(",", ":")))


if __name__ == "__main__":
    write(Path(sys.argv[1]))
