"""Scene files of the paper's program, converted to this project's format (common/scenes/README.md).

Such a file has camera, light, transforms, materials and shapes, which name a transform and a material by
their index. All else is compiled into the program: `COMPILED` has its master's values.
"""

import math
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta, Struct

from study.core import json_files
from study.core.cli import StudyError

MARCH = {"max_steps": 3000, "hit_distance": 1e-06, "bounds_radius": 100}
MARCH |= {"max_bounces": 3, "normal_step": 0.0001, "surface_offset": 0.001}
COMPILED = {"background": [0, 0, 0], "fog": 5e-06, "march": MARCH}  # config.h of the branch master
SHADOW_STRENGTH = 3
LEAST, MOST = 1e-9, 1e9  # of what our format takes as a length
# A shape's parameters by our names; a name that comes again is a vector's. Its program notices no more.
PARAMETERS = {
    "plane": ["normal", "normal", "normal", "offset"],
    "sphere": ["radius"],
    "box": ["half_size", "half_size", "half_size"],
    "cone": ["bottom_radius", "top_radius", "half_height"],
    "octahedron": ["radius"],
    "torus": ["major_radius", "minor_radius"],
    "mandelbulb": [],
}
BULB = {"power": 8, "iterations": 4, "bailout": 256}  # compiled in

Number = Annotated[float, Meta(ge=-MOST, le=MOST)]
Colour = Annotated[float, Meta(ge=0, le=MOST)]
Index = Annotated[int, Meta(ge=0)]


class Point(Struct, forbid_unknown_fields=True):
    x: Number
    y: Number
    z: Number


class Light3(Struct, forbid_unknown_fields=True):
    x: Colour
    y: Colour
    z: Colour


class Camera(Struct, forbid_unknown_fields=True):
    width: Annotated[int, Meta(ge=1)]
    height: Annotated[int, Meta(ge=1)]
    fov: Annotated[float, Meta(ge=1, le=170)]
    position: Point
    rotation: Point


class Light(Struct, forbid_unknown_fields=True):
    position: Point
    emission: Light3


class Transform(Struct, forbid_unknown_fields=True):
    position: Point
    rotation: Point


class Material(Struct, forbid_unknown_fields=True):
    reflection: Annotated[float, Meta(ge=0, le=1)]
    shininess: Annotated[float, Meta(gt=0, le=MOST)]
    surface: Light3


class Shape(Struct, forbid_unknown_fields=True):
    name: Literal["plane", "sphere", "box", "cone", "octahedron", "torus", "mandelbulb"]
    transform_idx: Index
    material_idx: Index
    params: list[Number]


class Theirs(Struct, forbid_unknown_fields=True):
    """A scene file of the paper's program."""

    camera: Camera
    pointlight: Light
    transforms: list[Transform]
    materials: list[Material]
    geometric_objects: Annotated[list[Shape], Meta(min_length=1, max_length=4096)]


def triple(v: Point | Light3) -> list[float]:
    return [v.x, v.y, v.z]


def read(path: Path) -> Theirs:
    """The file, checked. Raises StudyError: one line with the file, the line or key, and what is wrong."""
    data = json_files.read_json(path)
    try:
        return msgspec.convert(data, Theirs)
    except (msgspec.ValidationError, OverflowError) as error:
        said = " ".join(str(error).split()).replace("`", "'")
        raise StudyError(f"{path}: {said}") from None


def camera_of(camera: Camera, path: Path) -> dict[str, Any]:
    """Ours. Its program turns the view down by rotation.x and right by rotation.y, and leaves out z. It then
    takes the view's z for the focal length, so a turned camera sees a wider angle. Raises StudyError."""
    x, y = math.radians(camera.rotation.x), math.radians(camera.rotation.y)
    ahead = [math.cos(x) * math.sin(y), -math.sin(x), math.cos(x) * math.cos(y)]
    half = math.tan(math.radians(camera.fov / 2)) / ahead[2] if ahead[2] > 0 else math.nan
    degrees = camera.fov if ahead[2] == 1 else 2 * math.degrees(math.atan(half))
    if not 1 <= degrees <= 170:  # NaN: a mirrored picture
        raise StudyError(f"{path}: $.camera.rotation: our cameras see 1 to 170 degrees, not {degrees:.1f}")
    position = triple(camera.position)
    return {
        "position": position,
        "look_at": [p + a for p, a in zip(position, ahead, strict=True)],
        "up": [0, 1, 0],
        "vertical_fov_degrees": degrees,
    }


def shape_of(shape: Shape, number: int, theirs: Theirs, path: Path) -> dict[str, Any]:
    """Ours. Raises StudyError with the key."""
    at = f"{path}: $.geometric_objects[{number}]"
    for kind, index, many in (
        ("transform", shape.transform_idx, theirs.transforms),
        ("material", shape.material_idx, theirs.materials),
    ):
        if index >= len(many):
            raise StudyError(f"{at}.{kind}_idx: {index}, but there are {len(many)} {kind}s")
    p, names = shape.params, PARAMETERS[shape.name]
    if len(p) < len(names):
        raise StudyError(f"{at}.params: a {shape.name} needs {len(names)} numbers, not {len(p)}")
    if shape.name == "plane" and not any(abs(x) >= LEAST for x in p[:3]):
        raise StudyError(f"{at}.params: the plane's normal is zero")
    made: dict[str, Any] = dict(BULB) if shape.name == "mandelbulb" else {}
    for i, (name, size) in enumerate(zip(names, p, strict=False)):
        if shape.name != "plane" and size < LEAST:
            raise StudyError(f"{at}.params[{i}]: {size:g} is no size, which must be {LEAST:g} or more")
        made[name] = [*made.get(name, []), size] if names.count(name) > 1 else size
    placed = theirs.transforms[shape.transform_idx]
    where = {"position": triple(placed.position), "rotation_degrees": triple(placed.rotation)}
    where = {key: value for key, value in where.items() if any(value)}
    return {"type": shape.name, **made, **where, "material": f"material{shape.material_idx}"}


def converted(theirs: Theirs, path: Path) -> dict[str, Any]:
    """The scene in our format, `path` its file. Its program casts no shadow in a scene of one shape. Raises
    StudyError: the file, the key, and what our format lacks."""
    shapes = [shape_of(one, i, theirs, path) for i, one in enumerate(theirs.geometric_objects)]
    used = {one.material_idx for one in theirs.geometric_objects}
    materials = {
        f"material{i}": {"color": triple(m.surface), "reflectivity": m.reflection, "shininess": m.shininess}
        for i, m in enumerate(theirs.materials)
        if i in used
    }
    lamp = theirs.pointlight
    light: dict[str, Any] = {"position": triple(lamp.position), "emission": triple(lamp.emission)}
    light |= {"shadows": "soft" if len(shapes) > 1 else "none", "shadow_strength": SHADOW_STRENGTH}
    camera = camera_of(theirs.camera, path)
    return {"camera": camera, "light": light, **COMPILED, "materials": materials, "shapes": shapes}
