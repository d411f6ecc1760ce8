"""Fields of groups in NumPy, from the definitions of common/scenes/README.md: what phases are judged by.

Points are float64 arrays (count, 3). The smooth minimum's weights come from sorted distances (Held, Wolfe and
Crowder, Mathematical Programming 6, 1974), not from the phases' iteration.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from conformance import geometry

Array = np.ndarray
ONLY_IN_GROUPS = ("capsule", "ellipsoid", "gyroid", "group")
MODIFIERS = ("mirror", "displace", "shell", "twist", "offset")


def needs_tree(shape: dict) -> bool:
    own = [key for key in MODIFIERS if key in shape and (key, shape["type"]) != ("offset", "plane")]
    return bool(own) or shape["type"] in ONLY_IN_GROUPS


def capsule(p: Array, shape: dict) -> Array:
    end = np.array([0.0, shape["half_height"], 0.0])
    return geometry.to_segment(p, -end, end) - shape["radius"]


def ellipsoid(p: Array, shape: dict) -> Array:
    radius = np.array(shape["radius"], float)
    return (np.linalg.norm(p / radius, axis=1) - 1) * radius.min()


def gyroid(p: Array, shape: dict) -> Array:
    scale = 2 * math.pi / shape["cell"]
    sine, cosine = np.sin(scale * p), np.cos(scale * p)
    level = (sine * np.roll(cosine, -1, axis=1)).sum(axis=1)
    return np.abs(level) / (scale * math.sqrt(3)) - shape["thickness"] / 2


def smooth_minimum(d: Array, k: float) -> tuple[Array, Array]:
    """The smooth minimum (count,) of distances (children, count), and the weights, of d's shape."""
    ordered = np.sort(d, axis=0)
    ends = (k + np.cumsum(ordered, axis=0)) / np.arange(1, len(d) + 1)[:, None]
    last = (ordered < ends).sum(axis=0) - 1
    weights = np.maximum(np.take_along_axis(ends, last[None], 0) - d, 0) / k
    return (weights * d).sum(axis=0) + k / 2 * ((weights**2).sum(axis=0) - 1), weights


@dataclass(frozen=True)
class Bound:
    """Sphere about a node's solid, and the field's greatest slope, in its parent's coordinates.

    Outside the sphere the field is at least growth·(distance to the sphere)."""

    centre: Array
    radius: float
    growth: float
    slope: float
    twist_radius: float = 0.0
    twist_inner: float = 0.0


def _of_shape(shape: dict) -> tuple[float, float, float]:
    """Radius of the sphere about 0, radius of the cylinder about y, growth."""
    kind, get = shape["type"], shape.get
    if kind == "box":
        x, y, z = shape["half_size"]
        return math.hypot(x, y, z) + get("rounding", 0), math.hypot(x, z) + get("rounding", 0), 1
    if kind == "cone":
        wide = max(shape["bottom_radius"], shape["top_radius"])
        return math.hypot(wide, shape["half_height"]), wide, 1
    if kind == "torus":
        return (shape["major_radius"] + shape["minor_radius"],) * 2 + (1,)
    if kind == "capsule":
        return shape["radius"] + shape["half_height"], shape["radius"], 1
    if kind == "ellipsoid":
        x, y, z = shape["radius"]
        return max(x, y, z), max(x, z), min(x, y, z) / max(x, y, z)
    if kind in ("plane", "gyroid"):
        return math.inf, math.inf, 1
    return (shape["radius"],) * 2 + (1,)


def _of_members(group: dict) -> Bound:
    members = [bound(one) for one in group["shapes"]]
    slope = max(one.slope for one in members)
    if group["operation"] != "union":
        chosen = members[0]
        if group["operation"] == "intersection":
            for one in members:  # the first of the smallest, whatever rounding says
                chosen = one if one.radius < chosen.radius * (1 - 1e-9) else chosen
        return replace(chosen, slope=slope)
    centres = np.array([one.centre for one in members])
    middle = (centres.min(axis=0) + centres.max(axis=0)) / 2
    growth = min(one.growth for one in members)
    radius = max(np.linalg.norm(one.centre - middle) + one.radius for one in members)
    drop = group.get("blend", 0) / 2 * (1 - 1 / len(members))
    return Bound(middle, radius + drop / growth, growth, slope)


def bound(node: dict, root: bool = False) -> Bound:
    """Bound of a shape or group as the file has it; a root's transform is its shape's, not its field's."""
    if node["type"] == "group":
        made = _of_members(node)
        lateral = math.hypot(made.centre[0], made.centre[2]) + made.radius
    else:
        radius, lateral, growth = _of_shape(node)
        made = Bound(np.zeros(3), radius, growth, 1.0)
    displace = node.get("displace", {"amplitude": 0, "frequency": [0]})
    offset = node.get("offset", 0) if node["type"] != "plane" else 0
    added = displace["amplitude"] + node.get("shell", 0) + max(offset, 0)
    centre, radius, growth, slope, twist_radius = made.centre, made.radius, made.growth, made.slope, 0.0
    twist_inner = 0.0
    if node.get("twist"):
        twist_radius = (lateral + added / growth) * (1 + 2**-10)
        twist_inner = twist_radius - growth * (twist_radius - lateral)
        shear = abs(node["twist"]) * twist_radius
        slope *= (shear + math.sqrt(shear**2 + 4)) / 2
        radius += math.hypot(centre[0], centre[2])
        centre, growth = centre * [0, 1, 0], growth / 2
    slope += displace["amplitude"] * max(displace["frequency"])
    radius += added / growth
    mirrored = np.array([axis in node.get("mirror", "") for axis in "xyz"])
    radius += float(np.linalg.norm(centre[mirrored]))
    centre = np.where(mirrored, 0, centre)
    if not root:
        radius = math.inf if any(node.get("repeat", ())) else radius
        centre = centre @ geometry.rotation(node.get("rotation_degrees", [0, 0, 0]))
        centre = centre + node.get("position", [0, 0, 0])
    return Bound(centre, radius, growth, slope, twist_radius, twist_inner)


def _signs(group: dict) -> Array:
    """Signs of the children that make the operation a minimum, whose own sign is the first child's."""
    rest = -1 if group["operation"] == "intersection" else 1
    return np.array([1 if group["operation"] == "union" else -1] + [rest] * (len(group["shapes"]) - 1))


def _inside(local: Array, node: dict) -> tuple[Array, Array, Array]:
    """Points in the node's frame, before and after its twist; how far they are beyond twist_inner."""
    q = local.copy()
    for axis, name in enumerate("xyz"):
        if name in node.get("mirror", ""):
            q[:, axis] = np.abs(q[:, axis])
    twist = node.get("twist", 0)
    if not twist:
        return q, q, np.full(len(q), -np.inf)
    made = bound(node)
    radius, inner = made.twist_radius, made.twist_inner
    reach = np.hypot(q[:, 0], q[:, 2])
    turned = (q[:, 0] + 1j * q[:, 2]) * np.exp(1j * twist * q[:, 1])
    turned *= np.where(reach > radius, radius / np.where(reach > 0, reach, 1), 1)
    return q, np.array([turned.real, q[:, 1], turned.imag]).T, reach - inner


def _combined(r: Array, group: dict) -> tuple[Array, Array]:
    """The operation's field, and the children's shares of the material (children, count)."""
    signs = _signs(group)
    d = np.array([field(r, one) for one in group["shapes"]]) * signs[:, None]
    if group.get("blend", 0) > 0:
        least, weights = smooth_minimum(d, group["blend"])
    else:
        least, weights = d.min(axis=0), np.zeros_like(d)
        np.put_along_axis(weights, d.argmin(axis=0)[None], 1, axis=0)
    return least if group["operation"] == "union" else -least, weights


def _at(local: Array, node: dict) -> Array:
    q, r, beyond = _inside(local, node)
    if node["type"] == "group":
        f = _combined(r, node)[0]
    else:
        of = globals() if node["type"] in ONLY_IN_GROUPS else vars(geometry)
        f = of[node["type"]](r, node)
    f = np.maximum(f, beyond)
    if "displace" in node:
        waves = np.sin(q * node["displace"]["frequency"])
        f = f + node["displace"]["amplitude"] * waves.prod(axis=1)
    if node.get("shell", 0):
        f = np.abs(f) - node["shell"]
    return f - (node.get("offset", 0) if node["type"] != "plane" else 0)


def field(points: Array, node: dict) -> Array:
    """The field of a member: in its parent's coordinates, not divided by its slope."""
    return _at(geometry.to_shape_frame(points, node), node)


def distance(points: Array, shape: dict) -> Array:
    """The distance to a shape of the scene: its field divided by its slope, as every phase has it."""
    return field(points, shape) / bound(shape, root=True).slope


def shares(points: Array, node: dict) -> list[tuple[str, Array]]:
    """Materials of a shape's leaves, in the file's order, and the share (count,) of each at the points."""
    if node["type"] != "group":
        return [(node["material"], np.ones(len(points)))]
    r = _inside(geometry.to_shape_frame(points, node), node)[1]
    weights = _combined(r, node)[1]
    found = []
    for one, weight in zip(node["shapes"], weights, strict=True):
        found += [(name, weight * share) for name, share in shares(r, one)]
    return found
