"""Distances and rays from geometry, in NumPy: what phases are judged by, and nothing they share.

Written from the scene format's words, not from distance-function formulas: a box by projection on its
faces, a cone by its profile's segments, an octahedron by its eight triangles, a Mandelbulb by angles, a
Mandelbox by its reflections.
Points are float64 arrays (count, 3) in scene units, distances (count,).
"""

from __future__ import annotations

import itertools
import math

import numpy as np

from conformance import groups

Array = np.ndarray


def rotation(degrees: list[float]) -> Array:
    """3×3: about x, then y, then z, each (u, v) → (c·u − s·v, s·u + c·v) on (y,z), (x,z), (x,y)."""
    matrix = np.eye(3)
    for angle, (u, v) in zip(np.radians(degrees), [(1, 2), (0, 2), (0, 1)], strict=True):
        turn = np.eye(3)
        turn[u, u] = turn[v, v] = math.cos(angle)
        turn[u, v], turn[v, u] = -math.sin(angle), math.sin(angle)
        matrix = turn @ matrix
    return matrix


def to_shape_frame(points: Array, shape: dict) -> Array:
    """Translated, rotated, and moved by whole cells into the cell around the shape."""
    local = (points - shape.get("position", [0, 0, 0])) @ rotation(shape.get("rotation_degrees", [0, 0, 0])).T
    for axis, cell in enumerate(shape.get("repeat", [0, 0, 0])):
        if cell > 0:
            cells = np.rint(local[:, axis] / cell)
            local[:, axis] -= cells * cell
    return local


def to_segment(points: Array, a: Array, b: Array) -> Array:
    """Distance to the segment from a to b, in any number of dimensions."""
    along = np.clip((points - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
    return np.linalg.norm(points - a - along[:, None] * (b - a), axis=1)


def to_triangle(points: Array, corners: Array) -> Array:
    """Distance to a triangle (3 corners): to its plane where the foot lies inside, else to an edge."""
    a, b, c = corners
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal)
    height = (points - a) @ normal
    foot = points - height[:, None] * normal
    sides = [np.cross(q - p, foot - p) @ normal for p, q in [(a, b), (b, c), (c, a)]]
    inside = np.all([side >= 0 for side in sides], axis=0)
    edges = np.min([to_segment(points, p, q) for p, q in [(a, b), (b, c), (c, a)]], axis=0)
    return np.where(inside, np.abs(height), edges)


def sphere(p: Array, shape: dict) -> Array:
    return np.linalg.norm(p, axis=1) - shape["radius"]


def plane(p: Array, shape: dict) -> Array:
    normal = np.array(shape["normal"], float)
    return (p @ normal - shape["offset"]) / np.linalg.norm(normal)


def box(p: Array, shape: dict) -> Array:
    half = np.array(shape["half_size"], float)
    outside = np.linalg.norm(p - np.clip(p, -half, half), axis=1)
    return np.where(outside > 0, outside, -np.min(half - np.abs(p), axis=1)) - shape.get("rounding", 0)


def torus(p: Array, shape: dict) -> Array:
    ring = np.array([p[:, 0], np.zeros(len(p)), p[:, 2]]).T
    length = np.linalg.norm(ring, axis=1, keepdims=True)
    ring = np.where(length > 0, ring / np.where(length > 0, length, 1), [1.0, 0, 0]) * shape["major_radius"]
    return np.linalg.norm(p - ring, axis=1) - shape["minor_radius"]


def cone(p: Array, shape: dict) -> Array:
    r1, r2, h = shape["bottom_radius"], shape["top_radius"], shape["half_height"]
    q = np.array([np.hypot(p[:, 0], p[:, 2]), p[:, 1]]).T
    profile = np.array([[0, -h], [r1, -h], [r2, h], [0, h]], float)
    distance = np.min([to_segment(q, a, b) for a, b in itertools.pairwise(profile)], axis=0)
    radius_here = r1 + (r2 - r1) * (q[:, 1] + h) / (2 * h)
    inside = (np.abs(q[:, 1]) < h) & (q[:, 0] < radius_here)
    return np.where(inside, -distance, distance)


def octahedron(p: Array, shape: dict) -> Array:
    corners = [np.diag(signs) * shape["radius"] for signs in itertools.product([1.0, -1.0], repeat=3)]
    distance = np.min([to_triangle(p, c) for c in corners], axis=0)
    return np.where(np.abs(p).sum(axis=1) < shape["radius"], -distance, distance)


def mandelbulb(p: Array, shape: dict, noise: float = 0, seed: int = 0) -> tuple[Array, Array]:
    """Distance estimate by angles in 80-bit floats, and the least |m/bailout − 1| met on the way.

    `noise` moves the start and every iterate by as much relative to the lengths that were added up: what
    arithmetic of that unit roundoff does. Where the last is small, rounding decides on one more turn.
    """
    random = np.random.default_rng(seed)
    start = p.astype(np.longdouble)

    def moved(vector: Array, size: Array) -> Array:
        return vector + noise * size[:, None] * random.uniform(-1, 1, vector.shape)

    start = w = moved(start, np.sqrt((start**2).sum(axis=1)))
    m = (w**2).sum(axis=1)
    dz = np.full(len(p), np.longdouble(1.5))
    active, margin = np.ones(len(p), bool), np.full(len(p), np.inf)
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        for _ in range(shape["iterations"]):
            r = np.sqrt(m)
            b = 8 * np.arctan2(
                np.hypot(w[:, 0], w[:, 2]), w[:, 1]
            )  # acos(y/r), with its digits near the axis
            a = 8 * np.arctan2(w[:, 0], w[:, 2])
            step = np.array([np.sin(b) * np.sin(a), np.cos(b), np.sin(b) * np.cos(a)]).T
            dz = np.where(active, 8 * r**7 * dz + 1, dz)
            grown = moved(start + (r**8)[:, None] * step, r**8 + np.sqrt((start**2).sum(axis=1)))
            w = np.where(active[:, None], grown, w)
            m = (w**2).sum(axis=1)
            margin = np.where(active, np.minimum(margin, np.abs(m / shape["bailout"] - 1)), margin)
            active &= m <= shape["bailout"]
        estimate = np.where(m > 0, np.log(m) * np.sqrt(m) / dz / 4, 0)
    return estimate.astype(float), margin.astype(float)


def mandelbox(p: Array, shape: dict, noise: float = 0, seed: int = 0) -> Array:
    """Distance estimate by reflections and inversions, case by case, in 80-bit floats.

    T. Lowe's map with a running derivative (fractalforums.com, 2010). `noise` as in mandelbulb().
    """
    random = np.random.default_rng(seed)
    scale, limit = np.longdouble(shape["scale"]), np.longdouble(shape["fold_limit"])
    inner, outer = np.longdouble(shape["minimum_radius"]), np.longdouble(shape["fixed_radius"])

    def moved(vector: Array, size: Array) -> Array:
        return vector + noise * size[:, None] * random.uniform(-1, 1, vector.shape)

    start = p.astype(np.longdouble)
    reach = np.sqrt((start**2).sum(axis=1))
    start = w = moved(start, reach)
    stretch = np.ones(len(p), np.longdouble)
    for _ in range(shape["iterations"]):
        size = np.sqrt((w**2).sum(axis=1)) + limit
        w = np.where(w > limit, 2 * limit - w, np.where(w < -limit, -2 * limit - w, w))
        w = moved(w, size)
        r = np.sqrt((w**2).sum(axis=1))
        between = (outer / np.maximum(r, inner)) ** 2
        grown = np.where(r < inner, (outer / inner) ** 2, np.where(r < outer, between, 1))
        w = moved(scale * grown[:, None] * w + start, abs(scale) * grown * r + reach)
        stretch = 1 + abs(scale) * grown * stretch
    return (np.sqrt((w**2).sum(axis=1)) / stretch).astype(float)


def shape_distance(points: Array, shape: dict) -> Array:
    """Signed distance to one shape, placed, turned and repeated; of a group its field (groups.py)."""
    if groups.needs_tree(shape):
        return groups.distance(np.asarray(points, float), shape)
    local = to_shape_frame(np.asarray(points, float), shape)
    if shape["type"] == "mandelbulb":
        return mandelbulb(local, shape)[0]
    return globals()[shape["type"]](local, shape)


def scene_distance(points: Array, scene: dict) -> Array:
    return np.min([shape_distance(points, shape) for shape in scene["shapes"]], axis=0)


def unit(vector: Array) -> Array:
    return vector / np.linalg.norm(vector)


def rays(scene: dict, width: int, height: int) -> tuple[Array, Array]:
    """Origin (3,) and unit directions (height, width, 3) through the middle of each pixel."""
    camera = scene["camera"]
    position = np.array(camera["position"], float)
    forward = unit(camera["look_at"] - position)
    right = unit(np.cross(np.array(camera["up"], float), forward))
    up = np.cross(forward, right)
    tangent = math.tan(math.radians(camera["vertical_fov_degrees"]) / 2)
    x = (2 * (np.arange(width) + 0.5) / width - 1) * width / height * tangent
    y = (1 - 2 * (np.arange(height) + 0.5) / height) * tangent
    directions = forward + x[None, :, None] * right + y[:, None, None] * up
    return position, directions / np.linalg.norm(directions, axis=-1, keepdims=True)
