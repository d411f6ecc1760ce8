"""Writes small scenes to a folder, a file each, without spaces: cut from the project's own.

python3 tests/fuzz/seeds.py FOLDER. Of each scene its first three shapes together, and one shape of each kind
(its type, its path's and its keys) alone, with the materials that they use. Short inputs load faster, and
what is wrong with one is found by eye.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

SCENES = Path(__file__).parents[2] / "common" / "scenes"


def cut(shape: dict) -> dict:
    """A group with its first three members."""
    return shape | {"shapes": [*map(cut, shape["shapes"][:3])]} if "shapes" in shape else shape


def materials_of(shape: dict) -> set[str]:
    return {shape["material"]} if "material" in shape else set().union(*map(materials_of, shape["shapes"]))


def write(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for path in sorted(SCENES.rglob("*.json")):
        scene = json.loads(path.read_text())
        scene["shapes"] = [*map(cut, scene["shapes"])]
        kinds = {
            (shape["type"], shape.get("path", {}).get("type"), *sorted(shape)): shape
            for shape in scene["shapes"]
        }
        for i, shapes in enumerate([scene["shapes"][:3], *([shape] for shape in kinds.values())]):
            used = sorted(set().union(*map(materials_of, shapes)))
            materials = {name: scene["materials"][name] for name in used}
            small = scene | {"materials": materials, "shapes": shapes}
            (folder / f"{path.stem}{i}.json").write_text(json.dumps(small, separators=(",", ":")))


if __name__ == "__main__":
    write(Path(sys.argv[1]))
