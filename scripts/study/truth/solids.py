"""The scene's shapes as solids: where polynomials of a ray's parameter are ≤ 0.

Lines for planes, boxes and octahedra, quadratics for spheres and cones, a quartic for the torus (P. Hanrahan,
"Ray tracing algebraic surfaces", SIGGRAPH 1983).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise, product
from typing import Any

from flint import arb

from study.core.cli import StudyError
from study.core.registry import FRACTALS
from study.truth.algebra import Poly, Unsure, sign

Balls = list[arb]  # a vector


@dataclass(frozen=True)
class Shape:
    """One shape in doubles, as the scene's reader has it. Lists have three numbers."""

    kind: str
    position: list[float]
    rotation: list[float]  # degrees
    repeat: list[float]
    sizes: dict[str, Any]

    @property
    def turned(self) -> bool:
        """Whether its rotation has sines and cosines that are not −1, 0 or 1."""
        return any(angle % 90 for angle in self.rotation)


def _doubles(value: Any) -> list[float]:
    return [float(x) for x in value]


def shape_of(data: dict[str, Any]) -> Shape:
    """From the scene's JSON. A plane's normal is normalised as in scene_shapes.c, operation by operation."""
    kind = data["type"]
    if kind in FRACTALS:
        raise StudyError(f"a {kind} has no exact truth: its surface is not given by polynomials")
    frame = [_doubles(data.get(key, (0, 0, 0))) for key in ("position", "rotation_degrees", "repeat")]
    if kind == "plane":
        n = _doubles(data["normal"])
        length = math.sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2])
        sizes: dict[str, Any] = {"normal": [x / length for x in n], "offset": float(data["offset"]) / length}
    elif kind == "box":
        sizes = {"half_size": _doubles(data["half_size"])}
        if data.get("rounding"):
            kind, sizes["rounding"] = "rounded box", float(data["rounding"])
    else:
        names = {
            "torus": ("major_radius", "minor_radius"),
            "cone": ("bottom_radius", "top_radius", "half_height"),
        }
        sizes = {name: float(data[name]) for name in names.get(kind, ("radius",))}
    return Shape(kind, *frame, sizes)


def _dot(a: Balls, b: Balls) -> arb:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def square_of(a: Balls, b: Balls) -> Poly:
    """|a + s·b|²"""
    return [_dot(a, a), 2 * _dot(a, b), _dot(b, b)]


def _times(p: Poly, q: Poly) -> Poly:
    out = [arb(0)] * (len(p) + len(q) - 1)
    for i, x in enumerate(p):
        for j, y in enumerate(q):
            out[i + j] = out[i + j] + x * y
    return out


def _minus(p: Poly, q: Poly) -> Poly:
    return [x - (q[i] if i < len(q) else 0) for i, x in enumerate(p)]


def solids(shape: Shape, scale: int, a: Balls, b: Balls) -> list[list[Poly]]:
    """A shape cut by a + s·b in its own frame: a union of solids, each where all its polynomials are ≤ 0."""
    size = {key: arb(value) * scale for key, value in shape.sizes.items() if isinstance(value, float)}
    match shape.kind:
        case "sphere":
            square = square_of(a, b)
            return [[[square[0] - size["radius"] * size["radius"], *square[1:]]]]
        case "plane":
            n = [arb(x) for x in shape.sizes["normal"]]
            return [[[_dot(n, a) - size["offset"], _dot(n, b)]]]
        case "box":
            half = [arb(h) * scale for h in shape.sizes["half_size"]]
            return [[p for x, d, h in zip(a, b, half, strict=True) for p in ([x - h, d], [-x - h, -d])]]
        case "rounded box":
            return _rounded([arb(h) * scale for h in shape.sizes["half_size"]], size["rounding"], a, b)
        case "octahedron":
            sides = ([arb(s) for s in signs] for signs in product((-1, 1), repeat=3))
            return [[[_dot(n, a) - size["radius"], _dot(n, b)] for n in sides]]
        case "cone":
            return [_cone(size["bottom_radius"], size["top_radius"], size["half_height"], a, b)]
        case _:
            return _torus(size["major_radius"], size["minor_radius"], a, b)


def _rounded(half: Balls, radius: arb, a: Balls, b: Balls) -> list[list[Poly]]:
    """Three boxes, each wider along one axis, a cylinder about each edge and a ball about each corner."""

    def between(i: int, h: arb) -> list[Poly]:
        return [[a[i] - h, b[i]], [-a[i] - h, -b[i]]]

    def about(centre: Balls, axes: tuple[int, ...]) -> Poly:
        zero = arb(0)
        square = square_of(
            [a[i] - centre[i] if i in axes else zero for i in range(3)],
            [b[i] if i in axes else zero for i in range(3)],
        )
        return [square[0] - radius * radius, *square[1:]]

    corners = [[h * s for h, s in zip(half, signs, strict=True)] for signs in product((-1, 1), repeat=3)]
    found = [
        [p for i, h in enumerate(half) for p in between(i, h + radius if i == wide else h)]
        for wide in range(3)
    ]
    for along, axes in enumerate(((1, 2), (0, 2), (0, 1))):
        found += [[about(c, axes), *between(along, half[along])] for c in corners if c[along] > 0]
    return found + [[about(c, (0, 1, 2))] for c in corners]


def _cone(bottom: arb, top: arb, h: arb, a: Balls, b: Balls) -> list[Poly]:
    """|y| ≤ h, and the radius at y, (bottom + top)/2 + (top − bottom)·y/2h, is at least that of the point."""
    wide = [(bottom + top) * h + (top - bottom) * a[1], (top - bottom) * b[1]]
    ring = [a[0] * a[0] + a[2] * a[2], 2 * (a[0] * b[0] + a[2] * b[2]), b[0] * b[0] + b[2] * b[2]]
    side = _minus([4 * h * h * x for x in ring], _times(wide, wide))
    return [[a[1] - h, b[1]], [-a[1] - h, -b[1]], side]


def _torus(major: arb, minor: arb, a: Balls, b: Balls) -> list[list[Poly]]:
    """(ρ − R)² + y² ≤ r², that is |p|² + R² − r² ≤ 2Rρ: the left side ≤ 0, or its square ≤ 4R²ρ²."""
    square = square_of(a, b)
    left = [square[0] + major * major - minor * minor, *square[1:]]
    ring = [a[0] * a[0] + a[2] * a[2], 2 * (a[0] * b[0] + a[2] * b[2]), b[0] * b[0] + b[2] * b[2]]
    quartic = _minus(_times(left, left), [4 * major * major * x for x in ring])
    return [[quartic]] if minor <= major else [[quartic], [left]]


def radius_of(shape: Shape) -> float:
    """Of a sphere about the shape's own origin that holds it, a little too large."""
    s = shape.sizes
    match shape.kind:
        case "box":
            size = math.hypot(*s["half_size"])
        case "rounded box":
            size = math.hypot(*s["half_size"]) + s["rounding"]
        case "torus":
            size = s["major_radius"] + s["minor_radius"]
        case "cone":
            size = math.hypot(max(s["bottom_radius"], s["top_radius"]), s["half_height"])
        case "plane":
            size = math.inf
        case _:
            size = s["radius"]
    return size * (1 + 2**-20)


def distance(shape: Shape, scale: int, p: Balls) -> arb:
    """Signed distance of a point of the shape's own frame, as the scene's format defines it, in balls."""
    size = {key: arb(value) * scale for key, value in shape.sizes.items() if isinstance(value, float)}
    zero = arb(0)
    match shape.kind:
        case "sphere":
            return _length(p) - size["radius"]
        case "plane":
            return _dot([arb(x) for x in shape.sizes["normal"]], p) - size["offset"]
        case "box" | "rounded box":
            q = [abs(x) - arb(h) * scale for x, h in zip(p, shape.sizes["half_size"], strict=True)]
            box = _length([x.max(zero) for x in q]) + q[0].max(q[1]).max(q[2]).min(zero)
            return box - size.get("rounding", zero)
        case "torus":
            ring = _length([p[0], p[2]]) - size["major_radius"]
            return _length([ring, p[1]]) - size["minor_radius"]
        case "octahedron":
            return _to_octahedron(size["radius"], p)
        case _:
            return _to_cone(size["bottom_radius"], size["top_radius"], size["half_height"], p)


def _length(v: Balls) -> arb:
    return sum((x * x for x in v), arb(0)).sqrt()


def _segment(p: Balls, a: Balls, b: Balls) -> arb:
    """Distance of a point from a segment."""
    along = [y - x for x, y in zip(a, b, strict=True)]
    to = [y - x for x, y in zip(a, p, strict=True)]
    dot = sum((x * y for x, y in zip(along, to, strict=True)), arb(0))
    share = (dot / sum((x * x for x in along), arb(0))).max(arb(0)).min(arb(1))
    return _length([x - share * y for x, y in zip(to, along, strict=True)])


def _to_octahedron(radius: arb, p: Balls) -> arb:
    """In the first octant: to the face, or to the nearest of its edges where the foot falls outside of it."""
    q = [abs(x) for x in p]
    above = q[0] + q[1] + q[2] - radius
    if all(3 * x >= above for x in q):
        return above / arb(3).sqrt()
    if not any(3 * x < above for x in q):
        raise Unsure
    corners = [[radius if i == k else arb(0) for i in range(3)] for k in range(3)]
    edges = [_segment(q, corners[k], corners[k - 1]) for k in range(3)]
    return edges[0].min(edges[1]).min(edges[2])


def _to_cone(bottom: arb, top: arb, h: arb, p: Balls) -> arb:
    """In the half plane (ρ, y) of the axis: to the nearest of both discs' and the side's segments."""
    q = [_length([p[0], p[2]]), p[1]]
    corners = [[arb(0), -h], [bottom, -h], [top, h], [arb(0), h]]
    least = _segment(q, corners[0], corners[1])
    for a, b in pairwise(corners[1:]):
        least = least.min(_segment(q, a, b))
    beyond = abs(q[1]) - h, q[0] * 2 * h - (bottom + top) * h - (top - bottom) * q[1]
    return -least if all(sign(x) < 0 for x in beyond) else least
