"""Scenes made to order for stepwise scaling: any number of shapes, the same share of the picture covered.

Spheres, octahedra and cubes by turns, none turned. Where they are is drawn from a seed; how large they are
is worked out: every shape grows about its own centre by one common factor s, a ray hits shape i from the s on
that is the least gauge (Minkowski functional) of the shape along it, so the share of rays that hit at s is
the distribution of the least gauge over all shapes, and the s of a wanted share is one of its quantiles: no
search.

- scattered: centres even over the picture and in depth.
- clustered: centres normal (sigma CLUSTER_SIGMA) about eight places.
- overlapping: all centres in a ball that is smaller than the shapes.
- corridors, the worst case: columns of shapes one behind the other, each as large as it looks from the
  camera, so that a column is one outline and a ray that misses runs between columns to the end, close to many
  shapes.
- molecule: blended spheres along a random walk within a ball, one group.
- hall: two facing mirrors and three small spheres; nearly every ray is mirrored as often as it may be.
"""

import hashlib
import math
import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from study.core import store
from study.core.cli import StudyError
from study.core.registry import Scene

ARRANGEMENTS = ("scattered", "clustered", "overlapping", "corridors")
MOST_SHAPES = 4096  # SCENE_MAX_SHAPES of common/scene/scene.h
COVERAGE = 0.4  # share of the rays that hit
KINDS = ("sphere", "octahedron", "box")
SIZES = {"sphere": 1.0, "octahedron": 1.3, "box": 0.75}  # radius, radius, half edge of a shape of size 1
INSIDE = {"sphere": 1.0, "octahedron": 1.3 / math.sqrt(3), "box": 0.75}  # radius of the largest ball in it
AROUND = {"sphere": 1.0, "octahedron": 1.3, "box": 0.75 * math.sqrt(3)}  # and of the smallest about it
FOV = 30.0  # degrees, vertical
HALF = math.tan(math.radians(FOV) / 2)
NEAR, FAR, DEEP = 20.0, 40.0, 60.0  # scene units from the camera; DEEP: the last shape of a column
CLUSTERS, CLUSTER_SIGMA, BALL = 8, 1.5, 1.5
RAYS = 160, 90  # of the picture whose coverage is set
MIRRORS_APART = 4.0
BOND, NEIGHBOURS, GLOBE = 0.36, 0.42, 2.2  # scene units: between atoms of a molecule; its radius
TRIES = 24  # directions of a bond
ATOMS = {"carbon": (0.26, [0.25, 0.25, 0.27]), "nitrogen": (0.25, [0.08, 0.15, 0.75])}  # radius, colour
ATOMS |= {"oxygen": (0.24, [0.75, 0.06, 0.06]), "hydrogen": (0.2, [0.8, 0.8, 0.8])}
SHARES = (0.45, 0.57, 0.72, 1.0)  # of the atoms that are of an element or one before it
MARCH = {"max_steps": 3000, "hit_distance": 1e-6, "bounds_radius": 100}
MARCH |= {"max_bounces": 3, "normal_step": 1e-4, "surface_offset": 1e-3}
Place = tuple[float, float, float]
Placed = list[tuple[float, float, float, float, str]]  # x, y, z, size before scaling, kind


def rays(width: int, height: int) -> np.ndarray:
    """Unit directions of the camera's rays, shape (width·height, 3); it looks along z."""
    x = (2 * (np.arange(width) + 0.5) / width - 1) * (width / height) * HALF
    y = (1 - 2 * (np.arange(height) + 0.5) / height) * HALF
    found = np.stack([*np.meshgrid(x, y), np.ones((height, width))], axis=-1).reshape(-1, 3)
    return found / np.linalg.norm(found, axis=1, keepdims=True)


def _normal(dice: random.Random) -> float:
    """Draws with mean 0 and variance 1 (Box and Muller 1958): random() alone is promised to stay the same."""
    return math.sqrt(-2 * math.log(1 - dice.random())) * math.cos(2 * math.pi * dice.random())


def _spread(dice: random.Random, share: float) -> Place:
    """A place even over that share of the picture and between NEAR and FAR."""
    z = NEAR + (FAR - NEAR) * dice.random()
    half = HALF * z * share
    return (2 * dice.random() - 1) * half * 16 / 9, (2 * dice.random() - 1) * half, z


def _centres(arrangement: str, count: int, dice: random.Random) -> list[Place]:
    if arrangement == "scattered":
        return [_spread(dice, 0.9) for _ in range(count)]
    if arrangement == "clustered":
        about = [_spread(dice, 0.7) for _ in range(CLUSTERS)]
        moved = ([p + CLUSTER_SIGMA * _normal(dice) for p in about[i % CLUSTERS]] for i in range(count))
        return [(x, y, z) for x, y, z in moved]
    found: list[Place] = []
    while len(found) < count:
        x, y, z = (BALL * (2 * dice.random() - 1) for _ in range(3))
        if x * x + y * y + z * z <= BALL * BALL:
            found.append((x, y, z + (NEAR + FAR) / 2))
    return found


def _columns(count: int) -> Placed:
    """About count^(2/3) columns on a lattice of the picture, each of about count^(1/3) shapes."""
    deep = max(1, round(count ** (1 / 3)))
    columns = math.ceil(count / deep)
    down = max(1, round(math.sqrt(columns * 9 / 16)))
    across = math.ceil(columns / down)
    made: Placed = []
    for i in range(count):
        column, place = i % columns, i // columns
        z = NEAR * (DEEP / NEAR) ** (place / max(1, deep - 1))
        x = (2 * (column % across + 0.5) / across - 1) * HALF * 16 / 9
        y = (1 - 2 * (column // across + 0.5) / down) * HALF
        made.append((x * z, y * z, z, z, KINDS[column % len(KINDS)]))
    return made


def placed(arrangement: str, count: int, seed: int) -> Placed:
    """The shapes before they are scaled. Raises StudyError for what there is not."""
    if arrangement not in ARRANGEMENTS:
        raise StudyError(f"no arrangement '{arrangement}'; there are {', '.join(ARRANGEMENTS)}")
    if not 1 <= count <= MOST_SHAPES:
        raise StudyError(f"{count} shapes; a scene has 1 to {MOST_SHAPES}")
    if arrangement == "corridors":
        return _columns(count)
    centres = _centres(arrangement, count, random.Random(f"{arrangement} {seed}"))
    return [(*centre, 1.0, KINDS[i % len(KINDS)]) for i, centre in enumerate(centres)]


def _gauge(kind: str, origin: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Least gauge, along each line (both of shape (lines, 3)), of the shape of that kind and size 1 at 0. For
    octahedra and boxes, of a sum or a maximum of |linear|: least where a term is 0 or two are equal."""
    if kind == "sphere":
        nearest = origin - (origin * direction).sum(1, keepdims=True) * direction
        return np.linalg.norm(nearest, axis=1)
    if kind == "octahedron":
        pairs = [(origin[:, i], direction[:, i]) for i in range(3)]
    else:
        pairs = [
            (origin[:, i] + sign * origin[:, j], direction[:, i] + sign * direction[:, j])
            for i, j in ((0, 1), (0, 2), (1, 2))
            for sign in (1, -1)
        ]
    found = np.full(len(origin), np.inf)
    for a, b in pairs:
        t = np.divide(-a, b, out=np.zeros_like(a), where=b != 0)
        at = np.abs(origin + t[:, None] * direction)
        found = np.minimum(found, (at.sum(1) if kind == "octahedron" else at.max(1)) / SIZES[kind])
    return found


def least_gauge(shapes: Placed, directions: np.ndarray) -> np.ndarray:
    """Per ray from 0: the common factor from which on it hits a shape. Exact gauges are worked out only of
    shapes whose outer ball is not beyond another's inner ball."""
    centres = np.array([shape[:3] for shape in shapes])
    kinds = np.array([KINDS.index(shape[4]) for shape in shapes])
    size = np.array([shape[3] for shape in shapes])
    inside, around = (np.array([table[KINDS[kind]] for kind in kinds]) * size for table in (INSIDE, AROUND))
    squared = (centres**2).sum(1)
    found = np.full(len(directions), np.inf)
    for begin in range(0, len(directions), 512):  # 512 rays by 4096 shapes: 16 MB at a time
        some = slice(begin, begin + 512)
        apart = np.sqrt(np.maximum(squared - (directions[some] @ centres.T) ** 2, 0))
        ray, shape = np.nonzero(apart / around <= (apart / inside).min(1, keepdims=True) * (1 + 1e-9))
        for number, kind in enumerate(KINDS):
            mine = kinds[shape] == number
            lines, those = ray[mine] + begin, shape[mine]
            gauge = _gauge(kind, -centres[those], directions[lines]) / size[those]
            np.minimum.at(found, lines, gauge)
    return found


def quantile(values: np.ndarray, share: float) -> float:
    """A number with that share of the values below it, halfway between two that are not nearly equal: at a
    value itself an outline would go through a pixel's very centre."""
    ordered = np.sort(values)
    gaps = np.flatnonzero(np.diff(ordered) > 1e-6 * ordered[:-1])  # a value below each gap, another above
    nearest = gaps[np.abs(gaps + 1 - share * len(ordered)).argmin()]
    return float((ordered[nearest] + ordered[nearest + 1]) / 2)


def _materials() -> dict[str, Any]:
    colours = {"blue": [0, 0.1, 0.6], "green": [0, 0.6, 0.1], "yellow": [0.5, 0.5, 0]}
    return {name: {"color": c, "reflectivity": 0.0, "shininess": 15.0} for name, c in colours.items()}


def _scene(light: dict, materials: dict, shapes: list[dict], look_at: list[float], bounces: int = 3) -> dict:
    camera = {"position": [0, 0, 0], "look_at": look_at, "up": [0, 1, 0], "vertical_fov_degrees": FOV}
    return {
        "camera": camera,
        "light": {"emission": [100, 100, 100], "shadow_strength": 3, **light},
        "background": [0.1, 0.1, 0.1],
        "fog": 0,
        "march": {**MARCH, "max_bounces": bounces},
        "materials": materials,
        "shapes": shapes,
    }


def data(arrangement: str, count: int, seed: int) -> dict[str, Any]:
    """The scene as JSON has it: `count` shapes that cover COVERAGE of the picture."""
    shapes = placed(arrangement, count, seed)
    factor = quantile(least_gauge(shapes, rays(*RAYS)), COVERAGE)
    names, made = list(_materials()), []
    for i, (x, y, z, size, kind) in enumerate(shapes):
        length = SIZES[kind] * (factor * size)
        sizes = {"half_size": [length] * 3} if kind == "box" else {"radius": length}
        about = {"position": [x, y, z], "material": names[i % len(names)]}
        made.append({"type": kind, **sizes, **about})
    return _scene({"position": [30, 60, -20], "shadows": "soft"}, _materials(), made, [0, 0, 1])


def hall(bounces: int) -> dict[str, Any]:
    """Two facing mirrors, seen at 20° to their normal: the way between them is 4.3 units, the bounds are 100,
    so nearly every ray is mirrored `bounces` times while those are under 20. No shadows: a shadow ray runs on
    behind the light, where the other mirror is."""
    mirror = {"color": [0.3, 0.3, 0.3], "reflectivity": 0.9, "shininess": 15.0}
    shapes: list[dict] = [
        {"type": "plane", "normal": [side, 0, 0], "offset": -MIRRORS_APART / 2, "material": "mirror"}
        for side in (1, -1)
    ]
    places = ([1.2, -0.2, 0.6], [0.8, 0.5, 1.4], [-0.9, 0.1, 2.2])
    for place, name in zip(places, _materials(), strict=True):
        shapes.append({"type": "sphere", "radius": 0.15, "position": place, "material": name})
    light = {"position": [0, 3, 2], "shadows": "none", "emission": [3, 3, 3]}
    look_at = [math.cos(math.radians(20)), 0, math.sin(math.radians(20))]
    return _scene(light, {**_materials(), "mirror": mirror}, shapes, look_at, bounces)


def molecule(count: int, seed: int) -> dict[str, Any]:
    """`count` blended spheres in one group: each a bond from the one before it, in the direction, of TRIES,
    that leads least close to others and not out of the globe."""
    dice = random.Random(f"molecule {seed}")
    atoms, shapes = np.zeros((count, 3)), []
    for i in range(1, count):
        steps = np.array([[_normal(dice) for _ in range(3)] for _ in range(TRIES)])
        tried = atoms[i - 1] + BOND * steps / np.linalg.norm(steps, axis=1, keepdims=True)
        apart = np.linalg.norm(tried[:, None] - atoms[None, : i - 1], axis=2)
        crowd = np.where(apart < NEIGHBOURS, (apart + 0.1) ** -6, 0).sum(axis=1)
        outside = np.maximum(np.linalg.norm(tried / [1.25, 1, 1], axis=1) - GLOBE, 0)
        atoms[i] = tried[(crowd + 1e9 * outside).argmin()]
    for place in atoms:
        name = [*ATOMS][np.searchsorted(SHARES, dice.random(), "right")]
        sphere = {"type": "sphere", "radius": ATOMS[name][0], "material": name}
        shapes.append(sphere | {"position": [round(float(x), 4) for x in place]})
    materials = {name: {"color": c, "reflectivity": 0.0, "shininess": 30.0} for name, (_, c) in ATOMS.items()}
    group = {"type": "group", "operation": "union", "blend": 0.15, "position": [0, 0, 13], "shapes": shapes}
    light = {"position": [10, 24, -14], "shadows": "soft", "emission": [24, 24, 24]}
    return _scene(light, materials, [group], [0, 0, 1])


def _written(name: str, make: Callable[[], dict[str, Any]], folder: Path) -> Scene:
    """The scene of that name as a file below `folder`, in a folder named after this module's text."""
    path = folder / hashlib.sha256(Path(__file__).read_bytes()).hexdigest()[:8] / f"{name}.json"
    if not path.exists():
        store.write_json(path, make())
    return Scene(name, path, store.read_json(path), False)


def of_shapes(arrangement: str, count: int, seed: int, folder: Path) -> Scene:
    """`data` as a file below `folder`. Raises StudyError for what there is not."""
    placed(arrangement, count, seed)
    return _written(f"{arrangement}-{count}-seed{seed}", lambda: data(arrangement, count, seed), folder)


def of_mirrors(bounces: int, folder: Path) -> Scene:
    return _written(f"hall-{bounces}", lambda: hall(bounces), folder)
