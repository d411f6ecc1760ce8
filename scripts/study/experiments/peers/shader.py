"""A scene as the text of a kernel in the words that GLSL and OpenCL C share; its camera and its turns."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

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


def distance(shape: dict[str, Any]) -> str:
    """An expression, of Python as well: the signed distance of the point p to the shape."""
    at = f"(p - {vec3(shape['position'])})" if any(shape.get("position", ())) else "p"
    if any(shape.get("rotation_degrees", ())):
        rows = turn(shape["rotation_degrees"])
        at = f"vec3({', '.join(f'dot({at}, {vec3(row)})' for row in rows)})"
    kind = shape["type"]
    if kind == "plane":
        length = float(np.linalg.norm(shape["normal"]))
        sizes = [vec3(np.divide(shape["normal"], length)), number(shape["offset"] / length)]
    elif kind == "box":
        sizes = [vec3(shape["half_size"]), number(shape.get("rounding", 0))]
    elif kind == "mandelbulb":
        sizes = [str(shape["iterations"]), number(shape["bailout"])]
    else:
        names = {
            "sphere": ["radius"],
            "octahedron": ["radius"],
            "torus": ["major_radius", "minor_radius"],
            "cone": ["bottom_radius", "top_radius", "half_height"],
        }[kind]
        sizes = [number(shape[name]) for name in names]
    return f"{kind}({', '.join([at, *sizes])})"


def camera(data: dict[str, Any], width: int, height: int) -> dict[str, list[float]]:
    """Position, and the axes by which a ray is ahead + x·right + y·up, with x and y from −1 to 1."""
    c = data["camera"]
    ahead = np.subtract(c["look_at"], c["position"], dtype=float)
    ahead /= np.linalg.norm(ahead)
    right = np.cross(c["up"], ahead)
    right /= np.linalg.norm(right)
    half = math.tan(math.radians(c["vertical_fov_degrees"]) / 2)
    axes = {"ahead": ahead, "right": right * half * width / height, "up": np.cross(ahead, right) * half}
    return {"position": c["position"]} | {name: axis.tolist() for name, axis in axes.items()}


def source(data: dict[str, Any], width: int, height: int) -> str:
    """`seen(origin, direction)` of the scene, with AHEAD, RIGHT and UP of its camera."""
    seen, march, light = camera(data, width, height), data["march"], data["light"]
    values = {
        "HIT": number(march["hit_distance"]),
        "BOUNDS": number(march["bounds_radius"]),
        "NORMAL_STEP": number(march["normal_step"]),
        "STEPS": str(march["max_steps"]),
        "FOG": number(data["fog"]),
        "LIGHT": vec3(light["position"]),
        "EMISSION": vec3(light["emission"]),
        "BACKGROUND": vec3(data["background"]),
        **{name.upper(): vec3(seen[name]) for name in ("ahead", "right", "up")},
        "WIDTH": number(width),
        "HEIGHT": number(height),
    }
    each = [distance(shape) for shape in data["shapes"]]
    of = [data["materials"][shape["material"]] for shape in data["shapes"]]
    lines = [f"#define {name} {value}" for name, value in values.items()]
    lines += ["float to_scene(vec3 p) {", "float least = 1e30;"]
    lines += [f"least = min(least, {one});" for one in each]
    lines += ["return least;", "}", "int nearest_to(vec3 p) {", "float least = 1e30, d;", "int i = 0;"]
    for i, one in enumerate(each):
        lines += [f"d = {one};", f"if (d < least) {{ least = d; i = {i}; }}"]
    lines += ["return i;", "}", "vec3 colour_of(int i) {"]
    lines += [f"if (i == {i}) return {vec3(one['color'])};" for i, one in enumerate(of)]
    lines += [f"return {vec3([0, 0, 0])};", "}", "float shininess_of(int i) {"]
    lines += [f"if (i == {i}) return {number(one['shininess'])};" for i, one in enumerate(of)]
    lines += ["return 1.0;", "}"]
    return TEXT.read_text(encoding="utf-8").replace("@SCENE", "\n".join(lines))
