"""Fields of groups in balls (arb), straight from a scene's JSON: what judges truth's claims of first hits.

A ball of s gives a ball that holds the field on all of it: where it is above 0, the ray meets nothing.
"""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
from flint import arb, ctx, fmpq

BITS = 200
Point = list[arb]
ZERO = arb(0)


def _least(values: list[arb], blend: float) -> arb:
    """The smooth minimum by its definition: least over weights of Σ w·d + (k/2)(Σ w² − 1)."""
    if not blend:
        return _min(*values)
    ends = []
    for values_at in ([v.lower() for v in values], [v.upper() for v in values]):  # it rises with each
        k, total, used, level = arb(blend), arb(blend), [], None
        for d in sorted(values_at):
            if level is not None and not d < level:
                break
            used.append(d)
            total += d
            level = total / len(used)
        weights = [(level - d) / k for d in used]
        ends.append(
            sum((w * d for w, d in zip(weights, used, strict=True)), ZERO)
            + k / 2 * (sum((w * w for w in weights), ZERO) - 1)
        )
    return ends[0].union(ends[1])


def _min(*values: arb) -> arb:
    least = values[0]
    for value in values[1:]:
        least = least.min(value)
    return least


def _max(*values: arb) -> arb:
    return -_min(*(-v for v in values))


def _norm(*values: arb) -> arb:
    square = sum((v * v for v in values), ZERO)
    low = square.lower()
    return (low if low > 0 else ZERO).sqrt().union(square.upper().sqrt())


def _shape(shape: dict[str, Any], p: Point) -> arb:
    x, y, z = p
    match shape["type"]:
        case "sphere":
            return _norm(x, y, z) - shape["radius"]
        case "plane":
            length = sum(n * n for n in shape["normal"]) ** 0.5  # as the reader has it, in doubles
            normal = [n / length for n in shape["normal"]]
            return sum((n * v for n, v in zip(normal, p, strict=True)), ZERO) - shape["offset"] / length
        case "box":
            q = [abs(v) - h for v, h in zip(p, shape["half_size"], strict=True)]
            outside = _norm(*(_max(v, ZERO) for v in q))
            return outside + _min(_max(*q), ZERO) - shape.get("rounding", 0)
        case "torus":
            return _norm(_norm(x, z) - shape["major_radius"], y) - shape["minor_radius"]
        case "capsule":
            h = shape["half_height"]
            return _norm(x, y - _max(_min(y, arb(h)), arb(-h)), z) - shape["radius"]
        case "ellipsoid":
            least = min(shape["radius"])
            return (_norm(*(v / r for v, r in zip(p, shape["radius"], strict=True))) - 1) * least
        case "gyroid":
            turn = 2 * arb.pi() / shape["cell"]
            s, c = zip(*((v * turn).sin_cos() for v in p), strict=True)
            wave = s[0] * c[1] + s[1] * c[2] + s[2] * c[0]
            return abs(wave) / (turn * arb(3).sqrt()) - shape["thickness"] / 2
    raise ValueError(shape["type"])


def field(shape: dict[str, Any], p: Point) -> arb:
    """The undivided field at a point of the parent's coordinates, within a twist's cylinder."""
    q = [v - c for v, c in zip(p, shape.get("position", [0] * 3), strict=True)]
    for angle, (i, j) in zip(shape.get("rotation_degrees", [0] * 3), ((1, 2), (0, 2), (0, 1)), strict=True):
        s, c = arb.sin_cos_pi_fmpq(fmpq(*float(angle).as_integer_ratio()) / 180)
        q[i], q[j] = c * q[i] - s * q[j], s * q[i] + c * q[j]
    q = [abs(v) if axis in shape.get("mirror", "") else v for v, axis in zip(q, "xyz", strict=True)]
    r = list(q)
    if twist := shape.get("twist"):
        s, c = (twist * r[1]).sin_cos()
        r[0], r[2] = c * r[0] - s * r[2], s * r[0] + c * r[2]
    if shape["type"] == "group":
        d, k = [field(child, r) for child in shape["shapes"]], shape.get("blend", 0)
        match shape["operation"]:
            case "union":
                f = _least(d, k)
            case "intersection":
                f = -_least([-v for v in d], k)
            case _:
                f = -_least([-d[0], *d[1:]], k)
    else:
        f = _shape(shape, r)
    if displace := shape.get("displace"):
        wave = arb(displace["amplitude"])
        for v, w in zip(q, displace["frequency"], strict=True):
            wave *= (w * v).sin()
        f += wave
    if "shell" in shape:
        f = abs(f) - shape["shell"]
    return f if shape["type"] == "plane" else f - shape.get("offset", 0)


def along(shape: dict[str, Any], ray: list[float], s: arb) -> arb:
    return field(shape, [arb(a) + s * arb(b) for a, b in zip(ray[:3], ray[3:], strict=True)])


def _clear(shape: dict[str, Any], ray: list[float], low: float, high: float) -> float:
    """The s up to which the field is certainly above 0, to 1e-7."""
    stack = [(low, high)]
    while stack:
        a, b = stack.pop()
        m, half = arb((a + b) / 2), (b - a) / 2 * (1 + 2.0**-50)
        if along(shape, ray, m + arb(0, half)) > 0:
            continue
        if b - a < 1e-7:
            return a
        stack += [((a + b) / 2, b), (a, (a + b) / 2)]
    return high


def _leaves(ray: list[float], radius: float) -> float:
    """Nearly the s at which a ray from within the bounds leaves them."""
    o, d = np.array(ray[:3]), np.array(ray[3:])
    b, square = o @ d / (d @ d), (radius**2 - o @ o) / (d @ d)
    return float(np.sqrt(b * b + square) - b) * (1 - 1e-9)


def fault(data: dict[str, Any], ray: list[float], claim: list[float]) -> str:
    """What is wrong with a claim (status, shape, bounds of s) that is not undecided; '' for nothing."""
    ctx.prec = BITS
    status, index, low, high = claim[:4]
    ends = low if index >= 0 else _leaves(ray, data["march"]["bounds_radius"])
    for i, shape in enumerate(data["shapes"]):
        if (reached := _clear(shape, ray, 0.0, ends)) < ends - 1e-4:
            return f"shape {i} may be met at {reached!r}"
        for k in range(1, 9):
            if index >= 0 and not along(shape, ray, arb(ends) - arb(10) ** -k / 1000) > 0:
                return f"shape {i} is met before {ends!r}"
    if index < 0:
        return ""
    hit, hair = data["shapes"][int(index)], arb(2) ** -60
    behind = along(hit, ray, arb(high) + hair)
    exact = Fraction(low) <= Fraction(high) and status == 2
    return "" if exact and along(hit, ray, arb(low) - hair) > 0 > behind else f"no entry: {behind}"
