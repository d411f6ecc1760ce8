"""The first hit of a ray with one shape, in rational numbers: what judges the claims of truth's program.

A ray may cross a surface where one of a few polynomials of its parameter s (of degree 1, 2 or 4) has a root,
and on which side of it a point lies is the sign of a rational number. Doubles are rational.
Sines, cosines and roots have 256 bits, so what is nearer than 2⁻¹⁵⁰ counts as equal.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator
from fractions import Fraction
from itertools import product
from typing import Any

from flint import arb, ctx, fmpq, fmpq_poly

BITS, NEAR = 256, fmpq(1, 2**150)
Number = Any  # fmpq or fmpq_poly


def _exact(x: float) -> fmpq:
    return fmpq(*x.as_integer_ratio())


def _middle(ball: arb) -> fmpq:
    mantissa, exponent = (int(part) for part in ball.mid().man_exp())
    return fmpq(mantissa) * fmpq(2) ** exponent


def _short(x: fmpq) -> fmpq:
    return fmpq((x * 2**BITS).floor(), 2**BITS)


@functools.cache
def _turn(degrees: float) -> tuple[fmpq, fmpq]:
    """Sine and cosine."""
    s, c = arb.sin_cos_pi_fmpq(_exact(degrees) / 180)
    return _middle(s), _middle(c)


def _sizes(shape: dict) -> dict[str, Any]:
    """Numbers of a shape as rationals; a plane's normal has length 1 in doubles, as in scene_shapes.c."""
    if shape["type"] == "plane":
        length = math.sqrt(sum(x * x for x in shape["normal"]))
        own = {"normal": [x / length for x in shape["normal"]], "offset": shape["offset"] / length}
        shape = shape | own
    found = {key: value for key, value in shape.items() if isinstance(value, (int, float, list))}
    return {
        key: [_exact(x) for x in value] if isinstance(value, list) else _exact(value)
        for key, value in found.items()
    }


def _torus(size: dict, x: Number, y: Number, z: Number) -> Number:
    """(ρ − R)² + y² ≤ r² without its root; of tori with a hole."""
    big, ring = size["major_radius"], x * x + z * z
    left = ring + y * y + big * big - size["minor_radius"] * size["minor_radius"]
    return left * left - 4 * big * big * ring


def _cone_side(size: dict, x: Number, y: Number, z: Number) -> Number:
    low, high, h = (size[name] for name in ("bottom_radius", "top_radius", "half_height"))
    wide = (low + high) * h + (high - low) * y
    return 4 * h * h * (x * x + z * z) - wide * wide


def _crossed(kind: str, size: dict, p: list[fmpq_poly]) -> list[fmpq_poly]:
    """Polynomials among whose roots are all crossings of the surface."""
    x, y, z = p
    match kind:
        case "sphere":
            return [x * x + y * y + z * z - size["radius"] * size["radius"]]
        case "plane":
            return [sum((n * v for n, v in zip(size["normal"], p, strict=True)), -size["offset"])]
        case "torus":
            return [_torus(size, x, y, z)]
        case "cone":
            return [y - size["half_height"], y + size["half_height"], _cone_side(size, x, y, z)]
        case "octahedron":
            return [a * x + b * y + c * z - size["radius"] for a, b, c in product((-1, 1), repeat=3)]
    radius = size.get("rounding", fmpq(0))
    out = []
    for signs in product((-1, 0, 1), repeat=3):  # the feature of the inner box that a part is round about
        off = [v - s * h for v, s, h in zip(p, signs, size["half_size"], strict=True) if s]
        out += [off[0] - radius, off[0] + radius] if len(off) == 1 else []
        out += [sum((v * v for v in off), -radius * radius)] if len(off) > 1 and radius else []
    return out


def _side(kind: str, size: dict, p: list[fmpq]) -> fmpq:
    """Negative inside, positive outside, 0 on the surface."""
    match kind:
        case "box":
            over = [abs(v) - h for v, h in zip(p, size["half_size"], strict=True)]
            if radius := size.get("rounding"):
                return sum((max(v, fmpq(0)) ** 2 for v in over), -radius * radius)
            return max(over)
        case "cone":
            return max(abs(p[1]) - size["half_height"], _cone_side(size, *p))
        case "octahedron":
            return sum(map(abs, p), -size["radius"])
    return _crossed(kind, size, p)[0]


def _roots(poly: fmpq_poly) -> list[fmpq]:
    if poly.degree() == 1:
        return [-poly[0] / poly[1]]
    if poly.degree() == 2:
        c, b, a = poly.coeffs()
        square = b * b - 4 * a * c
        if square < 0:
            return []
        off = _middle(arb(square).sqrt())
        return [(-b - off) / (2 * a), (-b + off) / (2 * a)]
    found = poly.numer().complex_roots() if poly.degree() > 2 else []
    return [_middle(z.real) for z, _ in found if z.imag == 0]


def _cells(repeat: list[fmpq], o: list[fmpq], d: list[fmpq], end: fmpq) -> Iterator[tuple]:
    """From which s to which the ray is in a cell, and the cell's middle, up to s = end."""
    at = [(x / c + fmpq(1, 2)).floor() if c else 0 for x, c in zip(o, repeat, strict=True)]
    turn = [(b > 0) - (b < 0) if c else 0 for b, c in zip(d, repeat, strict=True)]
    enter = fmpq(0)
    while enter <= end:
        walls = {k: ((at[k] + fmpq(turn[k], 2)) * repeat[k] - o[k]) / d[k] for k in range(3) if turn[k]}
        leave = min([*walls.values(), end])
        yield enter, leave, [n * c for n, c in zip(at, repeat, strict=True)]
        if leave == end:
            return
        at = [n + turn[k] * (walls.get(k) == leave) for k, n in enumerate(at)]
        enter = leave


def first_hit(data: dict, ray: list[float]) -> Fraction | None:
    """s of the first hit with the scene's one shape; None: a miss. Inside, it is where the ray leaves it."""
    ctx.prec = BITS
    (shape,) = data["shapes"]
    size, bounds = _sizes(shape), _exact(float(data["march"]["bounds_radius"]))
    o, d = [_exact(x) for x in ray[:3]], [_exact(x) for x in ray[3:]]
    if sum(x * x for x in o) > bounds * bounds:
        raise ValueError("where its march's first step leads decides")
    reach = _exact((math.hypot(*ray[:3]) + data["march"]["bounds_radius"]) / math.hypot(*ray[3:]) * 1.001)
    start, way = (
        [x - _exact(float(c)) for x, c in zip(o, shape.get("position", [0] * 3), strict=True)],
        list(d),
    )
    for angle, (i, j) in zip(shape.get("rotation_degrees", [0] * 3), ((1, 2), (0, 2), (0, 1)), strict=True):
        s, c = _turn(float(angle))
        for v in (start, way):
            v[i], v[j] = _short(c * v[i] - s * v[j]), _short(s * v[i] + c * v[j])
    inside: bool | None = None
    for enter, leave, middle in _cells(size.get("repeat", [fmpq(0)] * 3), start, way, reach):
        home = [a - m for a, m in zip(start, middle, strict=True)]

        def side(s: fmpq, home: list[fmpq] = home) -> fmpq:
            return _side(shape["type"], size, [a + s * b for a, b in zip(home, way, strict=True)])

        inside = side(enter) < -NEAR if inside is None else inside
        polys = _crossed(shape["type"], size, [fmpq_poly([a, b]) for a, b in zip(home, way, strict=True)])
        roots = (root for poly in polys for root in _roots(poly))
        stops = sorted({enter, leave, *(root for root in roots if enter < root < leave)})
        for here, then in zip(stops, [*stops[1:], leave], strict=True):
            f = side(here)
            leaves = inside and (f >= -NEAR or (then - here > NEAR and side((here + then) / 2) > 0))
            if leaves or (not inside and f <= NEAR):
                p = [a + here * b for a, b in zip(o, d, strict=True)]
                hit = sum(x * x for x in p) <= bounds * bounds
                return Fraction(int(here.p), int(here.q)) if hit else None
    return None
