"""Pictures of phases by width and scenes made for tiles, and what of two pictures must be the same."""

from __future__ import annotations

import copy
from pathlib import Path

import numpy as np
import phase_pictures
import pytest
from programs import TRUE

from conformance.feature_scenes import FEATURES, SIZES
from study.core import registry

SMALL = (48, 27)
WIDTHS = ({"16 lanes": {}} if TRUE else {}) | {"8 lanes": {"STEPWISE_ISA_LIMIT": "avx2"}}
LACKING = pytest.mark.skipif(not TRUE, reason="the CPU lacks AVX-512; test_emulated holds 16 lanes against 8")
EACH_WIDTH = [pytest.param("16 lanes", marks=LACKING), "8 lanes"]


def picture(phase: str, scene: str | Path | dict, folder: Path, size=SMALL, *arguments: object, **env: str):
    """Every plane of the scene's picture."""
    return phase_pictures.picture(phase, scene, folder, *arguments, size=size, **env)


def check_starts(phase: str, scene: str | dict, folder: Path, where: str) -> tuple[float, float]:
    """No start of the phase is past the true hit, by any width.

    Shares of the pixels: those that start beyond the camera or not at all, and of them those that hit.
    """
    true = picture("truth", scene, folder)
    known = true["status"] > 0
    late, late_hits = [], []
    for width, env in WIDTHS.items():
        start = picture(phase, scene, folder, **env)["start"]
        assert np.isfinite(start).all() and ((start >= 0) | (start == -1)).all(), f"{where}, {width}"
        start = np.where(start < 0, np.inf, start)
        hit = np.maximum(true["Z"], 0)  # of a camera within a Mandelbulb a march steps back
        past = known & np.isfinite(hit) & ~(start <= hit)
        row, column = np.argwhere(past)[0] if past.any() else (0, 0)
        assert not past.any(), (
            f"{where}, {width}: {past.sum()} starts past the hit; in row {row}, column {column} "
            f"{start[row, column]!r} past {true['Z'][row, column]!r}"
        )
        late.append((start > 0).mean())
        late_hits.append((known & np.isfinite(hit) & (start > 0)).mean())
    return float(np.mean(late)), float(np.mean(late_hits))


def crowd(seed: int, count: int, shadows: str) -> dict:
    """Turned shapes of every kind in a box of ten, a floor, a few mirrors."""
    random = np.random.default_rng(seed)
    whole = copy.deepcopy(registry.scenes()["scene0"].data)
    whole["light"] |= {"shadows": shadows, "position": [6, 20, -8], "emission": [20, 20, 20]}
    whole["materials"]["plain"] = {"color": [0.5, 0.6, 0.4], "reflectivity": 0, "shininess": 15}
    kinds = ["sphere", "box", "torus", "cone", "octahedron"]
    shapes = [{"type": "plane", "normal": [0, 1, 0], "offset": -5, "material": "plain"}]
    for _ in range(count):
        kind = kinds[random.integers(len(kinds))]
        sizes = {
            key: (np.array(value) * random.uniform(0.2, 0.7)).tolist() for key, value in SIZES[kind].items()
        }
        place = random.uniform([-6, -4, 8], [6, 4, 18]).tolist()
        angles = random.uniform(-180, 180, 3).tolist()
        material = "mirror_red" if random.uniform() < 0.2 else "plain"
        placed = {"position": place, "rotation_degrees": angles, "material": material}
        shapes.append({"type": kind, **sizes, **placed})
    return whole | {"shapes": shapes}


def check_same(mine: dict, parents: dict, where: str) -> None:
    """The same shapes at the same distances in the same light, but for what a rounding may turn."""
    pixels = mine["Z"].size
    few = max(1, pixels // 1000)
    assert (mine["id"] != parents["id"]).sum() <= few, where
    both = np.isfinite(mine["Z"]) & np.isfinite(parents["Z"])
    apart = np.abs(mine["Z"][both] - parents["Z"][both])
    assert (~(apart <= 1e-5 * np.abs(parents["Z"][both]))).sum() <= few, where
    for channel in "RGB":
        off = ~(np.abs(mine[channel] - parents[channel]) <= 1e-3)
        assert off.sum() <= few, f"{where}: channel {channel}: {off.sum()} pixels"


def check_bits(mine: dict, parents: dict, here: np.ndarray | slice = np.s_[:]) -> None:
    """Hits, normals and step counts are the same to the bit, `here`."""
    for plane in ("id", "Z", "N.x", "N.y", "N.z", "evals"):
        ours, theirs = (image[plane][here].view(np.uint32) for image in (mine, parents))
        assert np.array_equal(ours, theirs), plane


def flat_scenes() -> dict[str, dict]:
    """A floor up to the horizon, alone or below a few solids: most rays take many steps to nothing but it."""
    scene = copy.deepcopy(FEATURES["everything"]) | {"fog": 0}
    floor = {"type": "plane", "normal": [0, 1, 0], "offset": -1, "material": "plain"}
    ball = {"type": "sphere", "radius": 0.7, "position": [0, 0.2, 6], "material": "plain"}
    scene["shapes"] = [floor]
    scene["camera"] |= {"position": [0, 0.5, -2], "look_at": [0, 0.2, 10], "vertical_fov_degrees": 50}
    balls = copy.deepcopy(scene)
    balls["shapes"] += [ball, ball | {"position": [2.5, -0.6, 9]}, ball | {"position": [-3, 1.5, 14]}]
    capped = copy.deepcopy(balls)
    capped["march"]["max_steps"] = 37
    near = copy.deepcopy(scene)
    near["march"]["bounds_radius"] = 9.5  # between two steps of some rays
    # The first step ends outside, and so does the ray; the fourth would not.
    outside = copy.deepcopy(scene)
    outside["march"]["bounds_radius"] = 9
    outside["camera"] |= {"position": [0, -0.4, -9.8], "look_at": [0, -0.5, 10]}
    slanted = copy.deepcopy(balls)
    slanted["shapes"][0] |= {"normal": [0.28, 0.96, 0]}
    wide = copy.deepcopy(balls)
    wide["march"]["hit_distance"] = 1e-2
    return {"floor": scene, "balls": balls, "few steps": capped, "near bounds": near} | {
        "beyond": outside,
        "slanted": slanted,
        "hits from afar": wide,
    }
