"""Groups that look like plain shapes do, by every phase that draws them, and whose materials they show."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from phase_pictures import needs, picture

from conformance.feature_scenes import scene, shape
from study.core import registry
from study.pictures import images

DRAWING = [name for name, phase in registry.phases().items() if phase.groups]
each = pytest.mark.parametrize("phase", [pytest.param(name, marks=needs(name)) for name in DRAWING])
DEEPEST = 32
BALL, WALL = {"radius": 0.5}, {"half_size": [0.5, 0.3, 0.4]}


def group(operation: str, *shapes: dict, **keys: Any) -> dict:
    return {"type": "group", "operation": operation, "shapes": list(shapes), **keys}


def sphere(**keys: Any) -> dict:
    return shape("sphere", **(BALL | keys))


def box(**keys: Any) -> dict:
    return shape("box", **(WALL | keys))


def capsule(**keys: Any) -> dict:
    return shape("capsule", half_height=0.2, **keys)


def nested(inner: dict, depth: int) -> dict:
    """In `depth` groups, which together move it by (0.2, 0, 0)."""
    for _ in range(depth):
        inner = group("union", inner, position=[0.2 / depth, 0, 0])
    return inner


# What a group draws, and the plain shapes that it should look like.
EQUAL: dict[str, tuple[dict, list[dict]]] = {
    "union": (
        group("union", sphere(material="blue"), box(position=[0.4, 0.2, 0])),
        [sphere(material="blue"), box(position=[0.4, 0.2, 0])],
    ),
    "deep": (
        nested(box(rotation_degrees=[10, 20, 30]), DEEPEST),
        [box(rotation_degrees=[10, 20, 30], position=[0.2, 0, 0])],
    ),
    "intersection": (group("intersection", sphere(), box(half_size=[2, 2, 2], material="blue")), [sphere()]),
    "difference": (
        group("difference", sphere(), box(position=[9, 0, 0]), sphere(position=[0, 9, 0])),
        [sphere()],
    ),
    # n equal children sink by k/2·(1 − 1/n)
    "blend": (group("union", sphere(), sphere(), sphere(), sphere(), blend=0.4), [sphere(radius=0.65)]),
    "far blend": (
        group("union", sphere(), sphere(position=[0, 9, 0], material="blue"), blend=0.4),
        [sphere()],
    ),
    "mirror": (sphere(position=[0.1, 0, 0], mirror="x"), [sphere(position=[0.1, 0, 0])]),
    "mirrored": (
        group("union", sphere(radius=0.3, position=[0.4, 0.1, 0]), mirror="xy"),
        [sphere(radius=0.3, position=[0.4 * x, 0.1 * y, 0]) for x in (1, -1) for y in (1, -1)],
    ),
    "offset": (sphere(offset=0.15), [sphere(radius=0.65)]),
    "shell": (sphere(shell=0.15), [sphere(radius=0.65)]),
    "twist": (group("union", sphere(), twist=1.5), [sphere()]),
    # outside of the twist's cylinder nothing stands
    "twisted shell": (capsule(radius=0.3, shell=0.2, twist=1.5), [capsule(radius=0.5)]),
    "ellipsoid": (
        {"type": "ellipsoid", "radius": [0.6, 0.6, 0.6], "material": "plain"},
        [sphere(radius=0.6)],
    ),
    "capsule": (
        {"type": "capsule", "radius": 0.3, "half_height": 1e-6, "material": "plain"},
        [sphere(radius=0.3)],
    ),
}


def moved(one: dict, at: list[float]) -> dict:
    return one | {"position": np.add(one.get("position", [0, 0, 0]), at).tolist()}


def room(column: int) -> dict:
    """All of one column of EQUAL, side by side before a wall that their hard shadows fall on."""
    shapes = [shape("plane", normal=[0, 0, -1], offset=-1)]
    for i, pair in enumerate(EQUAL.values()):
        at = [1.6 * (i % 5 - 2), 1.6 * (i // 5 - 1), 0]
        shapes += [moved(one, at) for one in ([pair[0]], pair[1])[column]]
    camera = {"position": [0, 0, -12], "look_at": [0, 0, 0], "vertical_fov_degrees": 25}
    light = {"position": [4, 6, -20], "shadows": "hard"}
    return scene(shapes, camera=camera, light=light)


def normals_apart(a: images.Picture, b: images.Picture) -> np.ndarray:
    """Lengths of their differences, where both show the same shape."""
    seen = (a["id"] >= 0) & (a["id"] == b["id"])
    return np.linalg.norm([a[axis] - b[axis] for axis in ("N.x", "N.y", "N.z")], axis=0)[seen]


@each
def test_groups_look_like_their_plain_shapes(phase, tmp_path):
    a, b = (picture(phase, room(column), tmp_path, size=(120, 72)) for column in (0, 1))
    seen = a["id"] > 0
    assert np.array_equal(seen, b["id"] > 0) and np.isfinite(b["Z"]).all()
    counts = {name: int((a["id"] == 1 + i).sum()) for i, name in enumerate(EQUAL)}
    assert min(counts.values()) > 20, counts
    off = {name: np.abs(a["Z"] - b["Z"])[a["id"] == 1 + i].max() for i, name in enumerate(EQUAL)}
    # a march ends within the hit distance, 1e-6, over the sine of the angle and the field's slope
    assert max(off.values()) < 1e-3, off
    differ = np.abs(images.rgb(a) - images.rgb(b)).max(axis=-1) > 1 / 255
    assert differ.sum() <= 8, {name: int(differ[a["id"] == 1 + i].sum()) for i, name in enumerate(EQUAL)}


@each
def test_materials_are_the_deciding_childs_or_mixed_by_the_weights(phase, tmp_path):
    """In no light but the ambient one, a hundredth of the colour."""
    dull, blue = np.array([0.5, 0.5, 0.5]), np.array([0.1, 0.2, 0.7])
    cutter = sphere(position=[0, 0, -0.3], material="blue")
    cases = [
        (group("union", sphere(material="dull"), cutter | {"position": [0, 0, 0]}), dull),
        (group("difference", sphere(material="dull"), cutter), blue),
        (
            group("union", *(sphere(material=m) for m in ("dull", "blue", "blue")), blend=0.1),
            (dull + 2 * blue) / 3,
        ),
    ]
    for shapes, colour in cases:
        dark = scene(
            [shapes], light={"emission": [0, 0, 0], "shadows": "none"}, camera={"look_at": [0, 0, 0]}
        )
        found = images.rgb(picture(phase, dark, tmp_path, size=(1, 1)))[0, 0]
        assert found == pytest.approx(0.01 * colour, rel=1e-5)


@each
def test_normals_away_from_a_solids_own_surface_are_baselines(phase, tmp_path):
    """Shells, blends and what grows have the gradients of points over edges, corners, rims and cylinders."""
    turned = {"rotation_degrees": [20, 30, 10]}
    solids = [
        shape("octahedron", radius=0.6),
        shape("cone", bottom_radius=0.5, top_radius=0.2, half_height=0.4),
        box(),
        shape("torus", major_radius=0.4, minor_radius=0.15),
    ]
    cut = group("difference", sphere(radius=0.7), shape("octahedron", radius=0.6, position=[0.2, 0, -0.6]))
    shapes = [moved(one | turned | {"shell": 0.1}, [1.6 * i - 3.2, 0, 0]) for i, one in enumerate(solids)]
    shapes.append(moved(cut | {"blend": 0.2}, [3.2, 0, 0]))
    shapes.append(moved(group("union", box(twist=1.6), offset=0.1), [0, 1.4, 0]))  # beyond its cylinder
    camera = {"position": [0, 0, -12], "look_at": [0, 0, 0], "vertical_fov_degrees": 20}
    whole = scene(shapes, camera=camera, light={"shadows": "none"})
    a, b = (picture(name, whole, tmp_path, size=(200, 90)) for name in ("baseline", phase))
    off = normals_apart(a, b)
    turned_away = (off > 0.02).sum()  # on a crease baseline's differences see both sides
    assert off.size > 2000 and turned_away <= 4, (off.size, turned_away, off.max())


@each
def test_normals_on_a_twists_cylinder_are_truths(phase, tmp_path):
    """The capsule touches it all around, the box along two edges."""
    shapes = [capsule(radius=0.5, twist=1.5), box(rounding=0.1, twist=1.5)]
    shapes = [moved(one, [1.3 * i - 0.65, 0, 0]) for i, one in enumerate(shapes)]
    camera = {"position": [0, 0, -6], "look_at": [0, 0, 0], "vertical_fov_degrees": 16}
    whole = scene(shapes, camera=camera, light={"shadows": "none"})
    off = normals_apart(*(picture(name, whole, tmp_path, size=(180, 110)) for name in ("truth", phase)))
    assert off.size > 6000 and off.max() < 0.02, (off.size, (off > 0.02).sum(), off.max())
