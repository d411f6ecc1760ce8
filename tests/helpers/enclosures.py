"""Rays that are hard for a shape, and claims about their first hits judged in rational numbers.

A set is an array of n × 6 doubles, origin and direction (not normalised), in the shape's own frame and in
scene units.
"""

from __future__ import annotations

import math
import subprocess
from collections import Counter
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import oracle

from study.core.cli import StudyError

SHAPES: dict[str, dict[str, Any]] = {
    "sphere": {"radius": 1.25},
    "plane": {"normal": [0.5, 2, -0.25], "offset": 0.75},
    "box": {"half_size": [1, 0.75, 0.5]},
    "cone": {"bottom_radius": 1.25, "top_radius": 0.5, "half_height": 0.75},
    "torus": {"major_radius": 1, "minor_radius": 0.25},
    "octahedron": {"radius": 1.25},
    "rounded box": {"half_size": [1, 0.75, 0.5], "rounding": 0.25},
}
ROTATION = [30, -77.5, 101.3]
POSITION = [0.1, -2, 3]
CELLS = {"roomy": [3.5, 4, 3], "tight": [2, 0, 1.5]}  # tight: shapes reach over or to their walls


def scene(kind: str, **frame: Any) -> dict[str, Any]:
    """A scene of one shape, as JSON has it."""
    return {
        "camera": {"position": [0, 0, -5], "look_at": [0, 0, 0], "up": [0, 1, 0], "vertical_fov_degrees": 30},
        "light": {"position": [0, 9, 0], "emission": [1, 1, 1], "shadows": "none", "shadow_strength": 1},
        "background": [0, 0, 0],
        "fog": 0,
        "march": {
            "max_steps": 100,
            "hit_distance": 1e-6,
            "bounds_radius": 40 if "repeat" in frame else 1e9,
            "max_bounces": 0,
            "normal_step": 1e-4,
            "surface_offset": 1e-3,
        },
        "materials": {"white": {"color": [1, 1, 1], "reflectivity": 0, "shininess": 10}},
        "shapes": [{"type": kind.split()[-1], "material": "white", **SHAPES[kind], **frame}],
    }


def _unit(rng: np.random.Generator, n: int) -> np.ndarray:
    v = rng.normal(size=(n, 3))
    return v / np.linalg.norm(v, axis=1, keepdims=True)


def _hairs(rng: np.random.Generator, n: int) -> np.ndarray:
    """±2⁻ᵏ for k of 1 to 52, a tenth of them 0: n × 1."""
    hair = np.ldexp(rng.choice([-1.0, 1.0], n), -rng.integers(1, 53, n))
    return np.where(rng.random(n) < 0.1, 0, hair)[:, None]


def surface(kind: str, rng: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Points on the surface and their normals, as doubles have them."""
    size = SHAPES[kind]
    turn = rng.random(n) * 2 * math.pi
    if kind == "sphere":
        normal = _unit(rng, n)
        return normal * size["radius"], normal
    if kind == "plane":
        normal = np.array(size["normal"]) / np.linalg.norm(size["normal"])
        p = rng.normal(size=(n, 3)) * 3
        p -= (p @ normal - size["offset"] / np.linalg.norm(size["normal"]))[:, None] * normal
        return p, np.broadcast_to(normal, (n, 3))
    if kind == "box":
        half = np.array(size["half_size"])
        axis, side = rng.integers(0, 3, n), rng.choice([-1.0, 1.0], n)
        p, normal = rng.uniform(-1, 1, (n, 3)) * half, np.zeros((n, 3))
        p[np.arange(n), axis] = side * half[axis]
        normal[np.arange(n), axis] = side
        return p, normal
    if kind == "rounded box":  # out over one axis a face, over two an edge, over all a corner
        side, out = rng.choice([-1.0, 1.0], (n, 3)), rng.integers(1, 8, n)[:, None] >> np.arange(3) & 1 > 0
        half, normal = np.array(size["half_size"]), np.where(out, abs(_unit(rng, n)), 0) * side
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        inner = np.where(out, side, rng.uniform(-1, 1, (n, 3))) * half
        return inner + normal * size["rounding"], normal
    if kind == "octahedron":
        p, signs = rng.dirichlet((1, 1, 1), n) * size["radius"], rng.choice([-1.0, 1.0], (n, 3))
        return p * signs, signs / math.sqrt(3)
    around = np.stack([np.cos(turn), np.zeros(n), np.sin(turn)], -1)
    up = np.array([0.0, 1.0, 0.0])
    if kind == "torus":
        tilt = rng.random(n)[:, None] * 2 * math.pi
        normal = around * np.cos(tilt) + up * np.sin(tilt)
        return around * size["major_radius"] + normal * size["minor_radius"], normal
    low, high, h = size["bottom_radius"], size["top_radius"], size["half_height"]
    y = rng.uniform(-h, h, n)[:, None]
    normal = around * 2 * h + up * (low - high)
    radius = (low + high) / 2 + (high - low) * y / (2 * h)
    return around * radius + up * y, normal / np.linalg.norm(normal, axis=1, keepdims=True)


def _corners(kind: str, rng: np.random.Generator, n: int) -> np.ndarray:
    """Points of vertices, edges, rims and axes, most of them exact in doubles."""
    size, t = SHAPES[kind], rng.integers(-8, 9, n)[:, None] / 8
    signs = rng.choice([-1.0, 1.0], (n, 3))
    match kind:
        case "box":
            p = signs * np.array(size["half_size"])
            along = np.eye(3)[rng.integers(0, 3, n)]
            return np.where(rng.random(n)[:, None] < 0.5, p, p * (1 - along * (1 - t)))
        case "rounded box":  # seams of faces, edges and corners, and what is the inner box's
            over = rng.choice([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0.6, 0.8, 0], [0, 0, 0]], n)
            p = signs * (np.array(size["half_size"]) + size["rounding"] * over)
            return np.where(
                rng.random(n)[:, None] < 0.5, p, p * (1 - np.eye(3)[rng.integers(0, 3, n)] * (1 - t))
            )
        case "octahedron":
            i = rng.integers(0, 3, n)
            share = np.where(rng.random(n)[:, None] < 0.5, 1, abs(t))
            return signs * size["radius"] * (np.eye(3)[i] * share + np.eye(3)[(i + 1) % 3] * (1 - share))
        case "cone":
            upper = rng.random(n) < 0.5
            radius = np.where(upper, size["top_radius"], size["bottom_radius"])
            # 3, 4, 5 and 0, 1: points of a circle that doubles nearly have.
            spots = np.array([[0.6, 0.8], [0.8, -0.6], [1, 0], [0, 1], [-1, 0], [0, 0]])[
                rng.integers(0, 6, n)
            ]
            return np.stack(
                [spots[:, 0] * radius, np.where(upper, 1, -1) * size["half_height"], spots[:, 1] * radius], -1
            )
        case "torus":
            ring = rng.choice([0.75, 1, 1.25, 0], n)
            spots = np.array([[0.6, 0.8], [1, 0], [0, -1]])[rng.integers(0, 3, n)]
            y = rng.choice([0.25, -0.25, 0], n)
            return np.stack([spots[:, 0] * ring, y, spots[:, 1] * ring], -1)
        case _:
            return surface(kind, rng, n)[0]


def _lattice(rng: np.random.Generator, n: int) -> np.ndarray:
    return rng.integers(-40, 41, (n, 3)) / 8


def _random(kind: str, rng: np.random.Generator, n: int) -> np.ndarray:
    o = _unit(rng, n) * rng.uniform(1.5, 8, n)[:, None]
    return np.hstack([o, surface(kind, rng, n)[0] * rng.uniform(0, 1.3, n)[:, None] - o])


def _tangent(kind: str, rng: np.random.Generator, n: int) -> np.ndarray:
    p, normal = surface(kind, rng, n)
    u = np.cross(normal, _unit(rng, n))
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    return np.hstack([p + normal * _hairs(rng, n) - u * rng.uniform(0.1, 9, n)[:, None], u])


def _edges(kind: str, rng: np.random.Generator, n: int) -> np.ndarray:
    o = _lattice(rng, n)
    d = _corners(kind, rng, n) - o
    return np.hstack([o, d + _hairs(rng, n) * _unit(rng, n)])


def _axes(kind: str, rng: np.random.Generator, n: int) -> np.ndarray:
    axis = np.eye(3)[rng.integers(0, 3, n)] * rng.choice([-1.0, 1.0, 0.25], n)[:, None]
    hair = np.where(rng.random(n)[:, None] < 0.5, 0, _hairs(rng, n))
    start = np.where(rng.random(n)[:, None] < 0.5, _corners(kind, rng, n), _lattice(rng, n) / 2)
    return np.hstack([start * (1 + hair) - axis * rng.integers(0, 9, n)[:, None], axis])


def _far(kind: str, rng: np.random.Generator, n: int) -> np.ndarray:
    o = _unit(rng, n) * (10 ** rng.uniform(2, 8, n))[:, None]
    d = surface(kind, rng, n)[0] * rng.uniform(0.5, 1.05, n)[:, None] - o
    return np.hstack([o, np.ldexp(d, -rng.integers(-20, 40, n)[:, None])])


def _inside(kind: str, rng: np.random.Generator, n: int) -> np.ndarray:
    p, normal = surface(kind, rng, n)
    depth = np.where(rng.random(n) < 0.5, rng.uniform(0, 0.2, n), np.ldexp(1.0, -rng.integers(3, 50, n)))
    return np.hstack([p - normal * depth[:, None], _unit(rng, n)])


def _rims(kind: str, rng: np.random.Generator, n: int) -> np.ndarray:
    """Two nearly equal roots of a torus: rays in planes that touch it twice, along its top, past its hole."""
    if kind != "torus":
        return _tangent(kind, rng, n)
    big, small = SHAPES[kind]["major_radius"], SHAPES[kind]["minor_radius"]
    turn = rng.random(n) * 2 * math.pi
    x = np.stack([np.cos(turn), np.zeros(n), np.sin(turn)], -1)
    z = np.stack([-np.sin(turn), np.zeros(n), np.cos(turn)], -1)
    lean = math.asin(small / big) * rng.choice([-1.0, 1.0], n)[:, None]  # Villarceau's plane touches twice
    steep = x * np.cos(lean) + np.array([0.0, 1.0, 0.0]) * np.sin(lean)
    across = rng.uniform(-1.3, 1.3, n)[:, None]
    p, u = z * across, steep
    p, u = (
        np.where(rng.random(n)[:, None] < 0.5, np.hstack([p, u]), np.hstack([x * (big - small), z]))
        .reshape(n, 2, 3)
        .transpose(1, 0, 2)
    )
    flat = rng.random(n)[:, None] < 0.3
    p = np.where(flat, np.array([0.0, small, 0.0]) + x * across, p)
    u = np.where(flat, z, u)
    return np.hstack([p + _unit(rng, n) * _hairs(rng, n) - u * rng.uniform(1, 9, n)[:, None], u])


MAKERS = (_random, _tangent, _edges, _axes, _far, _inside, _rims)


def rays(kind: str, n: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """n rays in the shape's frame, and for each the number of its maker; a third of them random ones."""
    rng = np.random.default_rng(seed)
    which = np.where(rng.random(n) < 0.25, 0, rng.integers(0, len(MAKERS), n))
    out = np.empty((n, 6))
    for i, make in enumerate(MAKERS):
        out[which == i] = make(kind, rng, int((which == i).sum()))
    out[~out[:, 3:].any(axis=1), 3] = 1
    return out, which


def moved(local: np.ndarray) -> np.ndarray:
    """Rays of the shape's frame as the world sees them, to a rounding, for ROTATION and POSITION."""
    out = local.copy()
    for angle, (i, j) in reversed(list(zip(ROTATION, ((1, 2), (0, 2), (0, 1)), strict=True))):
        c, s = math.cos(math.radians(angle)), math.sin(math.radians(angle))
        for at in (0, 3):
            u, v = out[:, at + i].copy(), out[:, at + j].copy()
            out[:, at + i], out[:, at + j] = c * u + s * v, c * v - s * u
    out[:, :3] += POSITION
    return out


def claimed(program: Path, scene_path: Path, sextuples: np.ndarray, seconds: float = 60) -> np.ndarray:
    """What build/truth/rays says: n × 5, status, id, s_lo, s_hi, cost. StudyError if it fails or hangs."""
    given = np.ascontiguousarray(sextuples).tobytes()
    try:
        done = subprocess.run([program, scene_path], input=given, capture_output=True, timeout=seconds)
    except subprocess.TimeoutExpired:
        raise StudyError(f"{program} {scene_path}: {len(sextuples)} rays not done in {seconds} s") from None
    found = np.frombuffer(done.stdout)
    if done.returncode or found.size != 5 * len(sextuples):
        why = done.stderr.decode(errors="replace").strip() or f"exit status {done.returncode}"
        raise StudyError(f"{program} {scene_path}: {why}")
    return found.reshape(-1, 5)


def fault(data: dict, ray: list[float], status: float, index: float, low: float, high: float) -> str:
    """What is wrong with one claim, '' for nothing."""
    if status == 0:
        return ""
    s = oracle.first_hit(data, ray)
    if status != 2 or index != (-1 if s is None else 0):
        return "miss" if s is None else f"s = {float(s)!r}"
    if s is None:
        return ""
    if not 0 <= low <= high < math.inf:
        return "no enclosure"
    slack = (1 + s) / 2**140  # what the oracle's own roots may be off
    return "" if Fraction(low) - slack <= s <= Fraction(high) + slack else f"s = {float(s)!r}"


def judge(data: dict[str, Any], sextuples: np.ndarray, claims: np.ndarray) -> tuple[Counter[str], list[str]]:
    """Counts (hit, miss, undecided) and a line for each claim that does not hold."""
    counts, faults = Counter[str](), []
    for ray, (status, index, low, high, _) in zip(sextuples.tolist(), claims.tolist(), strict=True):
        counts["undecided" if status == 0 else "miss" if index < 0 else "hit"] += 1
        if wrong := fault(data, ray, status, index, low, high):
            shown = " ".join(x.hex() for x in ray)
            faults.append(f"{shown}: claimed {status:g} {index:g} [{low!r}, {high!r}]; exact {wrong}")
    return counts, faults
