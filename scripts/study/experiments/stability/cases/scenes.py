"""Scenes of hard cases, as dicts in the format of common/scenes/README.md, and the rays they are seen by."""

from collections.abc import Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np

from study.experiments.stability.cases.phase import Phase
from study.pictures.images import Picture, rgb

MATERIALS = {
    "plain": {"color": [0.6, 0.5, 0.4], "reflectivity": 0, "shininess": 15},
    "other": {"color": [0.1, 0.2, 0.7], "reflectivity": 0, "shininess": 15},
    "mirror": {"color": [0.05, 0.05, 0.05], "reflectivity": 1, "shininess": 15},
}


def shape(kind: str, **keys: Any) -> dict:
    """A shape with its sizes and, if wanted, position, rotation_degrees, repeat and material."""
    return {"type": kind, "material": "plain", **keys}


def ball(radius: float, *at: float, **more: Any) -> dict:
    return shape("sphere", radius=radius, **({"position": list(at)} if at else {}), **more)


def floor(y: float = 0, **more: Any) -> dict:
    return shape("plane", normal=[0, 1, 0], offset=y, **more)


def wall(z: float, **more: Any) -> dict:
    """A plane square to z that faces who looks along it."""
    return shape("plane", normal=[0, 0, -1], offset=-z, **more)


def eye(position: Sequence[float], look_at: Sequence[float], degrees: float = 30, **more: Any) -> dict:
    return {
        "position": list(position),
        "look_at": list(look_at),
        "up": [0, 1, 0],
        "vertical_fov_degrees": degrees,
        **more,
    }


AHEAD = eye([0, 0, 0], [0, 0, 1])


def scene(shapes: Sequence[dict], **changes: Any) -> dict:
    """A whole scene: camera at (0, 0, −5) looking along +z, no shadow, no fog, parameters of scene0's order.

    A dict among the changes (camera, light, march, materials) is merged into that section.
    """
    whole: dict[str, Any] = {
        "camera": eye([0, 0, -5], [0, 0, 0]),
        "light": {"position": [3, 6, -5], "emission": [5, 5, 5], "shadows": "none", "shadow_strength": 3},
        "background": [0, 0, 0],
        "fog": 0,
        "march": {
            "max_steps": 3000,
            "hit_distance": 1e-6,
            "bounds_radius": 100,
            "max_bounces": 3,
            "normal_step": 1e-4,
            "surface_offset": 1e-3,
        },
        "materials": MATERIALS,
        "shapes": list(shapes),
    }
    return changed(whole, changes)


def changed(whole: dict, changes: dict) -> dict:
    """The scene with other sections; a dict is merged into the section that is there."""
    merged = {key: whole[key] | value if isinstance(value, dict) else value for key, value in changes.items()}
    return whole | merged


def section(whole: dict, name: str) -> SimpleNamespace:
    """A section of the scene, with its keys as attributes."""
    return SimpleNamespace(**whole[name])


def _unit(vector: np.ndarray) -> np.ndarray:
    return vector / np.linalg.norm(vector, axis=-1, keepdims=True)


def camera_frame(whole: dict) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Position, right, up, forward of the camera, in double."""
    camera = section(whole, "camera")
    position, look_at, up = (np.array(v, float) for v in (camera.position, camera.look_at, camera.up))
    forward = _unit(look_at - position)
    right = _unit(np.cross(_unit(up), forward))
    return position, right, np.cross(forward, right), forward


def rays(whole: dict, size: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Origin (3) and unit directions (height, width, 3) through the middle of each pixel, in double.

    The one ray of a 1×1 picture is exactly the direction of view.
    """
    width, height = size
    position, right, up, forward = camera_frame(whole)
    half = np.tan(np.radians(section(whole, "camera").vertical_fov_degrees) / 2)
    x = (2 * np.arange(width) + 1 - width) / height * half
    y = (height - 1 - 2 * np.arange(height)) / height * half
    directions = forward + x[None, :, None] * right + y[:, None, None] * up
    return position, _unit(directions)


def ids(picture: Picture) -> np.ndarray:
    """Index of the shape that each pixel shows, (height, width), −1 for a miss."""
    return picture["id"]


def found(picture: Picture) -> np.ndarray:
    return ids(picture) >= 0


def depths(picture: Picture) -> np.ndarray:
    return picture["Z"].astype(float)


def colours(picture: Picture) -> np.ndarray:
    """Linear, (height, width, 3)."""
    return rgb(picture).astype(float)


def red(picture: Picture) -> np.ndarray:
    return picture["R"].astype(float)


def evals(picture: Picture) -> np.ndarray:
    return picture["evals"]


def normals(picture: Picture) -> np.ndarray:
    """(height, width, 3), double."""
    return np.stack([picture[name] for name in ("N.x", "N.y", "N.z")], axis=-1).astype(float)


@dataclass(frozen=True)
class Ray:
    """What the one ray of a 1×1 picture met: shape −1 and t = ∞ for a miss."""

    shape: int
    t: float
    evals: int
    normal: np.ndarray


def one_ray(phase: Phase, whole: dict) -> Ray:
    picture = phase.render(whole, (1, 1))
    shown, t, steps = (int(ids(picture)[0, 0]), float(depths(picture)[0, 0]), int(evals(picture)[0, 0]))
    return Ray(shown, t, steps, normals(picture)[0, 0])


def angle_degrees(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The angle between unit vectors along the last axis; 180 where one has no direction (zero, NaN).

    atan2 keeps its digits where acos of a product has none left.
    """
    across = np.linalg.norm(np.cross(a, b), axis=-1)
    unit = np.all([abs(np.linalg.norm(v, axis=-1) - 1) <= 1e-3 for v in np.broadcast_arrays(a, b)], axis=0)
    return np.where(unit, np.degrees(np.arctan2(across, (a * b).sum(-1))), 180.0)


def worst(values: np.ndarray) -> float:
    """The largest, 0 of none; NaN if any is."""
    return float(np.max(values)) if np.size(values) else 0.0
