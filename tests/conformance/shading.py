"""A renderer in NumPy, from the words that define the pictures: march, normal, light, shadow, mirror, fog.

The paper's program as its facts are stated in phases/baseline/NOTES.md and common/scenes/README.md, on the
distances of geometry.py, for all rays at once: an opinion on the reference phase that shares nothing with it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from conformance import geometry, groups

Array = np.ndarray


@dataclass
class Hits:
    """Hits of many rays: whether, at which distance, where, of which shape, after how many evaluations."""

    found: Array
    t: Array
    point: Array
    shape: Array
    evals: Array


def nearest(points: Array, scene: dict) -> tuple[Array, Array]:
    """Distance to the scene and the index of the shape (the first of equals)."""
    every = np.array([geometry.shape_distance(points, shape) for shape in scene["shapes"]])
    return every.min(axis=0), every.argmin(axis=0)


def march(origin: Array, direction: Array, scene: dict) -> Hits:
    """Step by the distance, then test it: the hit lies behind the step that found it."""
    limits, count = scene["march"], len(origin)
    hits = Hits(
        np.zeros(count, bool), np.zeros(count), origin.copy(), np.full(count, -1), np.zeros(count, int)
    )
    active = np.arange(count)
    for _ in range(limits["max_steps"]):
        distance, shape = nearest(hits.point[active], scene)
        hits.evals[active] += 1
        hits.t[active] += distance
        hits.point[active] = origin[active] + hits.t[active, None] * direction[active]
        hit = distance < limits["hit_distance"]
        hits.found[active[hit]], hits.shape[active[hit]] = True, shape[hit]
        out = np.linalg.norm(hits.point[active], axis=1) > limits["bounds_radius"]
        active = active[~hit & ~out]
        if not len(active):
            break
    return hits


def normals(point: Array, direction: Array, scene: dict) -> Array:
    """Forward differences, turned towards where the ray comes from."""
    steps = np.eye(3) * scene["march"]["normal_step"]
    here = nearest(point, scene)[0]
    n = np.array([nearest(point + step, scene)[0] - here for step in steps]).T
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    return np.where((n * direction).sum(axis=1, keepdims=True) > 0, -n, n)


def lit(point: Array, to_light: Array, light_distance: Array, scene: dict) -> Array:
    """1: the light reaches the point, 0: it does not."""
    limits, light = scene["march"], scene["light"]
    share = np.ones(len(point))
    if light["shadows"] == "none":
        return share
    soft, previous = light["shadows"] == "soft", np.full(len(point), 1e20)
    t, active = np.full(len(point), float(limits["surface_offset"])), np.arange(len(point))
    for _ in range(limits["max_steps"]):
        if not soft:
            active = active[t[active] < light_distance[active]]
        h = nearest(point[active] + t[active, None] * to_light[active], scene)[0]
        hit = h < limits["hit_distance"]
        if not soft:
            share[active[hit]] = 0
        active, h = active[~hit], h[~hit]
        y = h * h / (2 * previous[active])
        if soft:
            usable = (h * h - y * y > 0) & (t[active] - y > 0)
            on, root, rest = active[usable], np.sqrt((h * h - y * y)[usable]), (t[active] - y)[usable]
            share[on] = np.minimum(share[on], light["shadow_strength"] * root / rest)
        previous[active] = h
        t[active] += h
        far = np.linalg.norm(point[active] + t[active, None] * to_light[active], axis=1)
        active = active[far <= limits["bounds_radius"]]
        if not len(active):
            break
    return np.clip(share, 0, 1)


def materials(point: Array, shape: Array, scene: dict) -> tuple[Array, Array, Array]:
    """Colour (count, 3), reflectivity and shininess (count,): a group's are mixed from its leaves'."""
    mixed = np.zeros((len(point), 5))
    for i in np.unique(shape):
        mine = shape == i
        for name, share in groups.shares(point[mine], scene["shapes"][i]):
            one = scene["materials"][name]
            mixed[mine] += share[:, None] * [*one["color"], one["reflectivity"], one["shininess"]]
    return mixed[:, :3], mixed[:, 3], mixed[:, 4]


def reflect(direction: Array, normal: Array) -> Array:
    return direction - 2 * (direction * normal).sum(axis=1, keepdims=True) * normal


def trace(origin: Array, direction: Array, scene: dict, bounce: int = 0) -> tuple[Array, Hits, Array]:
    """Linear colour (count, 3), hits, and normals (count, 3) of rays."""
    hits = march(origin, direction, scene)
    color = np.tile(np.array(scene["background"], float), (len(origin), 1))
    all_normals = np.zeros_like(color)
    on = np.flatnonzero(hits.found)
    if not len(on):
        return color, hits, all_normals
    p, d = hits.point[on], direction[on]
    n = all_normals[on] = normals(p, d, scene)
    base, reflectivity, shininess = materials(p, hits.shape[on], scene)
    to_light = scene["light"]["position"] - p
    distance = np.linalg.norm(to_light, axis=1)
    to_light /= distance[:, None]
    reach = (lit(p, to_light, distance, scene) / distance)[:, None]
    facing = (n * to_light).sum(axis=1)
    shine = np.maximum((reflect(-to_light, n) * -d).sum(axis=1), 0) ** shininess * (facing > 0)
    emission = np.array(scene["light"]["emission"], float)
    seen = 0.01 * base + emission * base * np.maximum(facing, 0)[:, None] * reach
    seen += emission * 0.2 * shine[:, None] * reach
    mirror = np.flatnonzero(reflectivity > 0)
    if bounce < scene["march"]["max_bounces"] and len(mirror):
        start = p[mirror] + scene["march"]["surface_offset"] * n[mirror]
        mirrored = trace(start, reflect(d[mirror], n[mirror]), scene, bounce + 1)[0]
        seen[mirror] += 0.1 * reflectivity[mirror, None] * mirrored
    color[on] = seen * np.exp(-scene["fog"] * np.linalg.norm(p, axis=1) ** 3)[:, None]
    return color, hits, all_normals


def render(scene: dict, width: int, height: int) -> dict[str, Array]:
    """Planes (height, width) as a phase writes them: R G B Z id N.x N.y N.z evals."""
    position, directions = geometry.rays(scene, width, height)
    rays = directions.reshape(-1, 3)
    color, hits, normal = trace(np.tile(position, (len(rays), 1)), rays, scene)
    planes = dict(zip("RGB", color.T, strict=True))
    planes |= {"Z": np.where(hits.found, hits.t, np.inf), "id": hits.shape, "evals": hits.evals}
    planes |= dict(zip(("N.x", "N.y", "N.z"), normal.T, strict=True))
    return {name: plane.reshape(height, width).astype(np.float32) for name, plane in planes.items()}
