"""Shadow planes of truth where h/t has several minima (a torus, repeated spheres) or its least at an
end of the way: against the estimator in 50 digits and against sampling."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import mpmath
import numpy as np
import pytest

from study.core import registry
from study.core.run import render
from study.pictures import images

WIDTH, HEIGHT = 24, 14
FLOOR, START, STRENGTH, BOUNDS = -1.0, 0.001, 3, 100
PROVED_TO = 1e-4  # of the ideal where h/t is not convex (truth/shadow.c)
CELL, RADIUS = 2.5, 0.4


def floor(y):
    return y - FLOOR


def torus(x, y, z, of=mpmath):
    """Radii 1.5 and 0.3 about the axis y, at (0, 0.5, 8)."""
    ring = of.sqrt(x * x + (z - 8) * (z - 8)) - 1.5
    return of.sqrt(ring * ring + (y - 0.5) * (y - 0.5)) - 0.3


def spheres(x, y, z, of=mpmath):
    """A sphere in each cell of a row along x, at height 0.5."""
    x = x - CELL * of.floor(x / CELL + 0.5)
    return of.sqrt(x * x + (y - 0.5) * (y - 0.5) + (z - 8) * (z - 8)) - RADIUS


def box(x, y, z, of=mpmath):
    """A cube behind the light: h/t is least at the light's end of the way."""
    least = np.minimum if of is np else min
    most = np.maximum if of is np else max
    p = [abs(x - 4) - 0.05, abs(y - 7) - 0.05, abs(z - 8) - 0.05]
    outside = of.sqrt(sum(most(c, 0 * c) * most(c, 0 * c) for c in p))
    return outside + least(most(p[0], most(p[1], p[2])), 0 * p[0])


SOLIDS: dict[str, tuple[Callable, dict, tuple]] = {
    "torus": (
        torus,
        {"type": "torus", "major_radius": 1.5, "minor_radius": 0.3, "position": [0, 0.5, 8]},
        (0.5, 1.5, 9),
    ),
    "spheres": (
        spheres,
        {"type": "sphere", "radius": RADIUS, "position": [0, 0.5, 8], "repeat": [CELL, 0, 0]},
        (5, 2, 9),
    ),
    "box": (box, {"type": "box", "half_size": [0.05, 0.05, 0.05], "position": [4, 7, 8]}, (4, 6.5, 8)),
}


def planes(name: str, folder: Path) -> dict[str, np.ndarray]:
    _, solid, light = SOLIDS[name]
    whole = json.loads(registry.find_scene("scene0").path.read_text())
    whole["light"] |= {"position": light, "shadows": "soft", "shadow_strength": STRENGTH}
    whole["march"] |= {"bounds_radius": BOUNDS, "surface_offset": START}
    whole["camera"] |= {"position": [0, 1, 0], "look_at": [0, -0.2, 8], "vertical_fov_degrees": 30}
    ground = {"type": "plane", "normal": [0, 1, 0], "offset": FLOOR, "material": "white"}
    whole["shapes"] = [ground, {**solid, "material": "blue"}]
    path = folder / "scene.json"
    path.write_text(json.dumps(whole))
    render("truth", path, HEIGHT, WIDTH, aov=True, out=folder / "out.exr")
    return images.read(folder / "out.exr")


def on_floor(picture: dict[str, np.ndarray]) -> list[tuple[int, int, list[mpmath.mpf]]]:
    """(row, column, point) where the floor is seen: by the ray of the camera, in 50 digits."""
    right, up, forward = [1, 0, 0], None, [mpmath.mpf(0), mpmath.mpf("-1.2"), mpmath.mpf(8)]
    forward[1] = mpmath.mpf(-0.2) - 1
    length = mpmath.sqrt(forward[1] ** 2 + forward[2] ** 2)
    forward = [c / length for c in forward]
    up = [mpmath.mpf(0), forward[2], -forward[1]]
    tangent = mpmath.mpf(float(np.tan(np.radians(15.0))))
    found = []
    for row, column in np.argwhere(picture["id"] == 0).tolist():
        a = mpmath.mpf(2 * column + 1 - WIDTH) / HEIGHT * tangent
        b = mpmath.mpf(HEIGHT - 2 * row - 1) / HEIGHT * tangent
        d = [f + a * r + b * u for f, r, u in zip(forward, right, up, strict=True)]
        s = (FLOOR - 1) / d[1]
        p = [s * d[0], 1 + s * d[1], s * d[2]]
        t = s * mpmath.sqrt(sum(c * c for c in d))
        assert abs(picture["Z"][row, column] - float(t)) < 1e-6 * t
        found.append((row, column, p))
    return found


def towards(p: list[mpmath.mpf], light: tuple) -> tuple[list[mpmath.mpf], mpmath.mpf]:
    to_light = [mpmath.mpf(x) - y for x, y in zip(light, p, strict=True)]
    length = mpmath.sqrt(sum(x * x for x in to_light))
    return [x / length for x in to_light], length


def estimator(solid: Callable, p: list[mpmath.mpf], light: tuple) -> float:
    """The steps and terms of phases/baseline/march.c."""
    d, _ = towards(p, light)
    least, previous, t = mpmath.mpf(1), mpmath.mpf(10) ** 20, mpmath.mpf(START)
    for _ in range(3000):
        q = [x + t * y for x, y in zip(p, d, strict=True)]
        if t > START and sum(x * x for x in q) > BOUNDS**2:
            break
        h = min(floor(q[1]), solid(*q))
        if h < mpmath.mpf(1e-6):
            break
        y = h * h / (2 * previous)
        if h * h - y * y > 0 and t - y > 0:
            least = min(least, STRENGTH * mpmath.sqrt(h * h - y * y) / (t - y))
        previous = h
        t += h
    return float(max(least, 0))


def ideal(solid: Callable, p: list[mpmath.mpf], light: tuple) -> float:
    """The least of 200,001 samples: h/t changes by less than 2·strength/t between two."""
    d, length = towards(p, light)
    d, p = np.array(d, float), np.array(p, float)
    t = np.geomspace(START, float(length), 200001)
    at = p + t[:, None] * d
    h = np.minimum(floor(at[:, 1]), solid(*at.T, of=np))
    return float(np.clip(STRENGTH * (h / t).min(), 0, 1))


@pytest.mark.slow
@pytest.mark.parametrize("name", SOLIDS)
def test_soft_shadows(name: str, tmp_path: Path) -> None:
    mpmath.mp.dps = 50
    solid, _, light = SOLIDS[name]
    picture, seen = planes(name, tmp_path), set()
    points = on_floor(picture)
    assert len(points) > 60  # of which only the torus needs all for its second minimum to be seen
    for row, column, p in points[:: 1 if name == "torus" else 3]:
        found = picture["shadow"][row, column], picture["shadow.ideal"][row, column]
        wanted = estimator(solid, p, light), ideal(solid, p, light)
        where = f"pixel {column}, {row}: {found}, not {wanted}"
        assert abs(found[0] - wanted[0]) <= 1e-6, where
        assert -1.2 * PROVED_TO <= found[1] - wanted[1] <= 1.2 * PROVED_TO, where
        seen.add(round(wanted[1], 2))
    assert len(seen) > 3, f"hardly a penumbra: {seen}"
