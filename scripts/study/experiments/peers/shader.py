"""A scene as the text of a kernel in the words that GLSL and OpenCL C share; its camera, turns, colours."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from study.core.scene_json import Content, Shape

TEXT = Path(__file__).with_name("workers") / "march.h"


def number(x: float) -> str:
    """A float literal of both languages, and of Python."""
    return repr(float(x))


def vec3(v: Sequence[float]) -> str:
    return f"vec3({', '.join(map(number, v))})"


def turn(degrees: Sequence[float]) -> np.ndarray:
    """The matrix by which a shape turns a point into its own coordinates (common/scenes/README.md)."""
    made = np.eye(3)
    for angle, (u, v) in zip(degrees, ((1, 2), (0, 2), (0, 1)), strict=True):
        c, s = math.cos(math.radians(angle)), math.sin(math.radians(angle))
        one = np.eye(3)
        one[u, u], one[u, v], one[v, u], one[v, v] = c, -s, s, c
        made = one @ made
    return made


SIZES = {  # of a shape's type, as march.h's functions take them
    "sphere": ["radius"],
    "octahedron": ["radius"],
    "torus": ["major_radius", "minor_radius"],
    "cone": ["bottom_radius", "top_radius", "half_height"],
    "box": ["half_size", "rounding"],
    "mandelbulb": ["iterations", "bailout"],
}


def literal(x: float | Sequence[float]) -> str:
    return vec3(x) if isinstance(x, Sequence) else str(x) if isinstance(x, int) else number(x)


def distance(shape: Shape) -> str:
    """An expression, of Python as well: the signed distance of the point p to the shape."""
    at = f"(p - {vec3(shape.position)})" if any(shape.position) else "p"
    if any(shape.rotation_degrees):
        rows = turn(shape.rotation_degrees)
        at = f"vec3({', '.join(f'dot({at}, {vec3(row)})' for row in rows)})"
    if shape.type == "plane":
        length = float(np.linalg.norm(shape.normal))
        return f"plane({at}, {vec3(np.divide(shape.normal, length))}, {number(shape.offset / length)})"
    sizes = [literal(getattr(shape, name)) for name in SIZES[shape.type]]
    return f"{shape.type}({', '.join([at, *sizes])})"


@dataclass(frozen=True)
class View:
    """A ray through a picture is ahead + x·right + y·up, with x and y from −1 to 1."""

    position: Sequence[float]
    ahead: np.ndarray
    right: np.ndarray
    up: np.ndarray


def camera(scene: Content, width: int, height: int) -> View:
    c = scene.camera
    ahead = np.subtract(c.look_at, c.position, dtype=float)
    ahead /= np.linalg.norm(ahead)
    right = np.cross(c.up, ahead)
    right /= np.linalg.norm(right)
    half = math.tan(math.radians(c.vertical_fov_degrees) / 2)
    return View(c.position, ahead, right * half * width / height, np.cross(ahead, right) * half)


def source(scene: Content, width: int, height: int) -> str:
    """`seen(origin, direction)` of the scene, with AHEAD, RIGHT and UP of its camera."""
    seen, march = camera(scene, width, height), scene.march
    values = {
        "HIT": march.hit_distance,
        "BOUNDS": march.bounds_radius,
        "NORMAL_STEP": march.normal_step,
        "STEPS": march.max_steps,
        "FOG": scene.fog,
        "LIGHT": scene.light.position,
        "EMISSION": scene.light.emission,
        "BACKGROUND": scene.background,
        **{"AHEAD": seen.ahead.tolist(), "RIGHT": seen.right.tolist(), "UP": seen.up.tolist()},
        **{"WIDTH": float(width), "HEIGHT": float(height)},
    }
    each, of = [distance(shape) for shape in scene.shapes], scene.of_shapes
    lines = [f"#define {name} {literal(value)}" for name, value in values.items()]
    lines += ["float to_scene(vec3 p) {", "float least = 1e30;"]
    lines += [f"least = min(least, {one});" for one in each]
    lines += ["return least;", "}", "int nearest_to(vec3 p) {", "float least = 1e30, d;", "int i = 0;"]
    for i, one in enumerate(each):
        lines += [f"d = {one};", f"if (d < least) {{ least = d; i = {i}; }}"]
    lines += ["return i;", "}", "vec3 colour_of(int i) {"]
    lines += [f"if (i == {i}) return {vec3(one.color)};" for i, one in enumerate(of)]
    lines += [f"return {vec3([0, 0, 0])};", "}", "float shininess_of(int i) {"]
    lines += [f"if (i == {i}) return {number(one.shininess)};" for i, one in enumerate(of)]
    lines += ["return 1.0;", "}"]
    return TEXT.read_text(encoding="utf-8").replace("@SCENE", "\n".join(lines))


def colours(
    scene: Content, d: np.ndarray, met: np.ndarray, p: np.ndarray, n: np.ndarray, which: np.ndarray
) -> np.ndarray:
    """Linear colours of rays in the unit directions `d` (rays × 3), of which those of the mask `met` hit the
    leaves `which` at `p` with the unit normals `n`. As common/scenes/README.md has them."""
    d = d[met]
    n = np.where((n * d).sum(1, keepdims=True) > 0, -n, n)
    materials = [scene.materials[leaf.material] for shape in scene.shapes for leaf in shape.leaves]
    colour = np.array([m.color for m in materials])[which]
    shininess = np.array([m.shininess for m in materials])[which]
    to = np.subtract(scene.light.position, p)
    away = np.linalg.norm(to, axis=1, keepdims=True)
    to /= away
    facing = (n * to).sum(1, keepdims=True)
    emission = np.array(scene.light.emission) / away
    shine = np.maximum(-((2 * facing * n - to) * d).sum(1), 0) ** shininess
    made = colour * (0.01 + np.maximum(facing, 0) * emission)
    made += np.where(facing > 0, 0.2 * shine[:, None] * emission, 0)
    far = np.linalg.norm(p, axis=1, keepdims=True)
    made *= np.exp(-scene.fog * far**3)
    out = np.broadcast_to(np.array(scene.background), (len(met), 3)).copy()
    out[met] = np.where(far <= scene.march.bounds_radius, made, out[met])
    return out
