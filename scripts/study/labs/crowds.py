"""Scenes of many shapes for labs, drawn by a student's number: kinds and places at random; a molecule."""

import random
from collections.abc import Sequence
from typing import Any

from study.core import generated_scenes, registry, store
from study.core.registry import Scene

MOLECULE = "molecule"  # of so many blended spheres, without shadows
LIKE = "crowd256"  # whose camera, light and materials they have
NEAR, FAR, WIDE, HIGH = 20.0, 60.0, 0.3, 0.17  # depth in scene units; slopes that the camera sees
SIZES, OF = (0.1, 0.3), 4096  # scene units, of so many shapes; fewer are larger, and fill as much room


def _shape(kind: str, scale: float, materials: Sequence[str], dice: random.Random) -> dict[str, Any]:
    z, size = dice.uniform(NEAR, FAR), scale * dice.uniform(*SIZES)
    place = [dice.uniform(-slope, slope) * z for slope in (WIDE, HIGH)]
    sizes: dict[str, dict[str, Any]] = {
        "box": {"half_size": [size] * 3},
        "torus": {"major_radius": size, "minor_radius": size / 3},
    }
    made = {"type": kind, "position": [*place, z], "material": dice.choice(materials)}
    return made | sizes.get(kind, {"radius": size})


def scene(kinds: Sequence[str], count: int, student: int) -> Scene:
    """Writes build/labs/scenes/KIND-COUNT-STUDENT.json and returns it. Raises StudyError."""
    like, dice = registry.find_scene(LIKE), random.Random(student)
    materials = sorted(like.data["materials"])
    if MOLECULE in kinds:
        data = generated_scenes.molecule(count, student)
        data["light"]["shadows"] = "none"
    else:
        size = (OF / count) ** (1 / 3)
        data = like.data | {
            "shapes": [_shape(dice.choice(kinds), size, materials, dice) for _ in range(count)]
        }
    name = kinds[0] if len(kinds) == 1 else "mixed"
    path = registry.ROOT / "build" / "labs" / "scenes" / f"{name}-{count}-{student}.json"
    path.parent.mkdir(parents=True, exist_ok=True)
    store.write_json(path, data)
    return registry.scene_at(path)
