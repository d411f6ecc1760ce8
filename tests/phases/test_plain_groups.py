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
    "repeat": (
        group("union", sphere(radius=0.2, repeat=[0.6, 0, 0]), position=[0, 0.1, 0]),
        [sphere(radius=0.2, repeat=[0.6, 0, 0], position=[0, 0.1, 0])],
    ),
    "offset": (sphere(offset=0.15), [sphere(radius=0.65)]),
    "shell": (sphere(shell=0.15), [sphere(radius=0.65)]),
    "twist": (group("union", sphere(), twist=1.5), [sphere()]),
    "ellipsoid": (
        {"type": "ellipsoid", "radius": [0.6, 0.6, 0.6], "material": "plain"},
        [sphere(radius=0.6)],
    ),
    "capsule": (
        {"type": "capsule", "radius": 0.3, "half_height": 1e-6, "material": "plain"},
        [sphere(radius=0.3)],
    ),
}


def room(shapes: list[dict]) -> dict:
    floor = shape("plane", normal=[0, 1, 0], offset=-0.8)
    march = {"bounds_radius": 20}
    return scene(
        [floor, *shapes], light={"shadows": "hard"}, march=march, camera={"vertical_fov_degrees": 25}
    )


@each
@pytest.mark.parametrize("name", EQUAL)
def test_a_group_looks_like_its_plain_shapes(phase, name, tmp_path):
    grouped, plain = (room(shapes) for shapes in ([EQUAL[name][0]], EQUAL[name][1]))
    a, b = (picture(phase, whole, tmp_path, size=(24, 16)) for whole in (grouped, plain))
    hit = np.isfinite(b["Z"])
    assert (a["id"] == 1).sum() > 20 and np.array_equal(np.isfinite(a["Z"]), hit)
    # to the hit distance, 1e-6, over the sine of the angle at which the ray meets the surface
    assert np.median(np.abs(a["Z"] - b["Z"])[hit]) < 2e-5
    assert (np.abs(images.rgb(a) - images.rgb(b)).max(axis=-1) > 1 / 255).sum() <= 2


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
