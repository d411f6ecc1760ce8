"""Small scenes of groups, one for each thing that a tree may have, and random trees by seed."""

from __future__ import annotations

import random
from collections.abc import Sequence
from typing import Any

from conformance.feature_scenes import FLOOR, SIZES, TURNED, scene, shape

GROUP_SIZES: dict[str, dict[str, Any]] = {
    "capsule": {"radius": 0.4, "half_height": 1.1},
    "ellipsoid": {"radius": [1.4, 0.6, 0.9]},
    "gyroid": {"cell": 1.1, "thickness": 0.2},
}


def made(kind: str, **keys: Any) -> dict:
    return shape(kind, **GROUP_SIZES.get(kind, {}) | keys)


def group(operation: str, *shapes: dict, **keys: Any) -> dict:
    return {"type": "group", "operation": operation, "shapes": [*shapes]} | keys


def _nested(depth: int) -> dict:
    """A sphere with a notch on every level, each group in the one before it."""
    inner = made("sphere", radius=1.2)
    for i in range(depth):
        notch = made("sphere", radius=0.25, material="blue", position=[0.16 * (i % 8) - 0.6, 0.9, -0.9])
        inner = group(["difference", "union"][i % 2], inner, notch | {"radius": 0.25 - 0.005 * i})
    return inner


def _scenes() -> dict[str, dict]:
    box, ball = made("box"), made("sphere", material="blue")
    holes = [made("capsule", rotation_degrees=r, radius=0.3) for r in ([0, 0, 0], [90, 0, 0], [0, 0, 90])]
    csg = group("difference", group("intersection", box | {"half_size": [1, 1, 1]}, ball), *holes)
    balls = [
        made("sphere", radius=0.7, position=[0.8 * i, 0.3 * i * i, 0], material=m)
        for i, m in ((-1, "blue"), (0, "plain"), (1, "mirror"), (1, "plain"))  # two in one place
    ]
    blend = group("union", *balls, blend=0.6, position=[0, -0.3, 0])
    cut = group("difference", box, ball | {"position": [0.9, 0.7, -0.5], "radius": 0.8}, blend=0.3)
    lens = group("intersection", cut, made("ellipsoid", material="mirror", radius=[1.6, 0.9, 1]), blend=0.2)
    pair = group("union", made("sphere", radius=0.6, position=[0.7, 0, 0]), made("torus"), blend=0.4)
    beads = group("intersection", box, made("sphere", radius=0.25, repeat=[0.7, 0.7, 0.7], material="blue"))
    walls = [made("plane", normal=n, offset=0.6) for n in ([1, 1, 1], [-1, 1, 0], [0, -1, 0.3], [0, 0.2, -1])]
    waves = {"displace": {"amplitude": 0.1, "frequency": [5, 7, 6]}}
    soft = {"light": {"shadows": "soft"}}
    return {
        "group_csg": scene([FLOOR, csg | TURNED], **soft),
        "group_blend": scene([FLOOR, blend], light={"shadows": "hard"}),
        "group_blend_cut": scene([lens | TURNED, FLOOR], **soft),
        "group_displaced": scene([FLOOR, made("sphere", offset=-0.05, **waves)]),
        "group_twisted": scene([made("box", rounding=0.1, twist=1.1, shell=0.04, **TURNED), FLOOR]),
        "group_gyroid": scene([group("intersection", ball, made("gyroid"))]),
        "group_mirrored_repeated": scene([pair | {"mirror": "xyz", "repeat": [5, 4.2, 4]}]),
        "group_beads": scene([beads | TURNED]),
        "group_planes": scene([group("intersection", *walls, ball)], **soft),
        "group_mirrors": scene(
            [
                FLOOR | {"material": "mirror"},
                group("union", made("capsule", material="mirror"), made("ellipsoid"), blend=0.3),
            ],
            march={"max_bounces": 2},
            light={"emission": [60, 60, 50]},
        ),
        "group_hollow": scene([group("difference", made("sphere", radius=9, shell=0.2), ball), ball | waves]),
        "group_deep": scene([FLOOR, _nested(32)]),
        "group_plane_displaced": scene([made("plane", normal=[0, 1, 0], **waves), ball], **soft),
    }


GROUPS = _scenes()


def _modifiers(draw: random.Random) -> dict:
    found: dict[str, Any] = {}
    if draw.random() < 0.2:
        found["displace"] = {
            "amplitude": draw.uniform(0.01, 0.2),
            "frequency": [draw.uniform(0.5, 6) for _ in range(3)],
        }
    if draw.random() < 0.2:
        found["twist"] = draw.uniform(-2, 2)
    if draw.random() < 0.2:
        found["shell"] = draw.uniform(0.02, 0.3)
    if draw.random() < 0.2:
        found["mirror"] = draw.choice(["x", "y", "z", "xz", "xyz"])
    if draw.random() < 0.2:
        found["offset"] = draw.uniform(-0.2, 0.2)
    return found


MATERIALS = ("plain", "blue", "mirror")


def tree(
    draw: random.Random, depth: int = 3, bounded: bool = True, materials: Sequence[str] = MATERIALS
) -> dict:
    """A random tree of any operations, modifiers and shapes; `bounded`: one with a bounding sphere."""
    placed: dict[str, Any] = {"position": [draw.uniform(-1, 1) for _ in range(3)]}
    if draw.random() < 0.5:
        placed["rotation_degrees"] = [draw.uniform(-180, 180) for _ in range(3)]
    if depth == 0 or draw.random() < 0.3:
        solids = [kind for kind in [*SIZES, *GROUP_SIZES] if not kind.startswith("mandel")]
        kind = draw.choice([k for k in solids if not bounded or k not in ("plane", "gyroid")])
        made_of = made(kind, material=draw.choice(materials)) | placed
        changes = _modifiers(draw)
        if kind in ("plane", "gyroid"):
            changes = {key: changes[key] for key in changes.keys() - {"twist", "offset"}}
        return made_of | changes
    operation = draw.choice(["union", "intersection", "difference"])
    count = draw.choice([1, 2, 2, 3, 5])
    members = [
        tree(draw, depth - 1, bounded and (operation == "union" or i == 0), materials) for i in range(count)
    ]
    blend = {"blend": draw.uniform(0.05, 0.8)} if draw.random() < 0.5 else {}
    changes = _modifiers(draw)
    if not bounded:
        changes.pop("twist", None)
    return group(operation, *members) | placed | blend | changes
