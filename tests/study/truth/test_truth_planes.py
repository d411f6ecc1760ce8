"""The planes of truth against closed forms and a second program in mpmath (50 digits)."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path

import mpmath
import numpy as np
import pytest
from mpmath import mpf

from study.core import registry
from study.core.run import render
from study.pictures import images

WIDTH, HEIGHT = 24, 14
FLOOR, START, STRENGTH, BOUNDS = -1.0, 0.001, 3, 100
PROVED_TO = 1e-4  # of the ideal where h/t is not convex (truth/shadow.c)
CELL, SMALL = 2.5, 0.4
BLEND = 0.75
CENTRE = (0.0, 0.5, 8.0)  # of the solid over the floor
Point = list[mpf]


@pytest.fixture(autouse=True)
def digits() -> None:
    mpmath.mp.dps = 50


def sphere(x, y, z, of=mpmath):
    return of.sqrt(x * x + (y - 0.5) * (y - 0.5) + (z - 8) * (z - 8)) - 1


def torus(x, y, z, of=mpmath):
    """Radii 1.5 and 0.3 about the axis y."""
    ring = of.sqrt(x * x + (z - 8) * (z - 8)) - 1.5
    return of.sqrt(ring * ring + (y - 0.5) * (y - 0.5)) - 0.3


def spheres(x, y, z, of=mpmath):
    """A sphere in each cell of a row along x."""
    return sphere(x - CELL * of.floor(x / CELL + 0.5), y, z, of) + 1 - SMALL


def box(x, y, z, of=mpmath):
    """A cube behind the light: h/t is least at the light's end of the way."""
    least = np.minimum if of is np else min
    most = np.maximum if of is np else max
    p = [abs(x - 4) - 0.05, abs(y - 7) - 0.05, abs(z - 8) - 0.05]
    outside = of.sqrt(sum(most(c, 0 * c) * most(c, 0 * c) for c in p))
    return outside + least(most(p[0], most(p[1], p[2])), 0 * p[0])


def blend(x, y, z, of=mpmath):
    """Two spheres by I. Quilez's quadratic smooth minimum, which scene.h's is for two."""
    a, b = sphere(x - 1, y, z, of) + 0.25, sphere(x + 1, y, z, of) + 0.25
    least, most = (np.minimum, np.maximum) if of is np else (min, max)
    drop = most(BLEND - abs(a - b), 0 * a)
    return least(a, b) - drop * drop / (4 * BLEND)


PEARL = {"type": "sphere", "radius": 0.75, "material": "blue"}
# Distance, shape, light. h/t has several minima beside a torus and repeated spheres.
SOLIDS: dict[str, tuple[Callable, dict, tuple]] = {
    "sphere": (sphere, {"type": "sphere", "radius": 1}, (2, 7, 11)),
    "torus": (torus, {"type": "torus", "major_radius": 1.5, "minor_radius": 0.3}, (0.5, 1.5, 9)),
    "spheres": (spheres, {"type": "sphere", "radius": SMALL, "repeat": [CELL, 0, 0]}, (5, 2, 9)),
    "blend": (
        blend,
        {
            "type": "group",
            "operation": "union",
            "blend": BLEND,
            "shapes": [{**PEARL, "position": [1, 0, 0]}, {**PEARL, "position": [-1, 0, 0]}],
        },
        (2, 7, 11),
    ),
    "box": (box, {"type": "box", "half_size": [0.05, 0.05, 0.05], "position": [4, 7, 8]}, (4, 6.5, 8)),
}


def drawn(name: str, shadows: str, folder: Path) -> dict[str, np.ndarray]:
    """Every plane of the solid over the floor."""
    _, solid, light = SOLIDS[name]
    whole = json.loads(registry.find_scene("scene0").path.read_text())
    whole["light"] |= {"position": light, "shadows": shadows, "shadow_strength": STRENGTH}
    whole["march"] |= {"bounds_radius": BOUNDS, "surface_offset": START}
    whole["camera"] |= {"position": [0, 1, 0], "look_at": [0, -0.2, 8], "vertical_fov_degrees": 30}
    ground = {"type": "plane", "normal": [0, 1, 0], "offset": FLOOR, "material": "white"}
    whole["shapes"] = [ground, {"position": CENTRE, "material": "blue"} | solid]
    if solid["type"] == "group":  # its shapes have materials
        del whole["shapes"][1]["material"]
    path = folder / "scene.json"
    path.write_text(json.dumps(whole))
    render("truth", path, HEIGHT, WIDTH, aov=True, out=folder / "out.exr")
    return images.read(folder / "out.exr")


@pytest.fixture(scope="module")
def pictures(tmp_path_factory) -> dict[str, dict[str, np.ndarray]]:
    """Truth's pictures of the sphere, by kind of shadow."""
    folder = tmp_path_factory.mktemp("truth")
    return {shadows: drawn("sphere", shadows, folder) for shadows in ("none", "hard", "soft")}


def dot(a: Point, b: Point) -> mpf:
    return mpmath.fsum(x * y for x, y in zip(a, b, strict=True))


def first_hit(d: Point) -> tuple[int, mpf]:
    """(shape, s) of a ray from the camera to floor or sphere: −1 and infinity on a miss."""
    found = (0, (FLOOR - 1) / d[1]) if d[1] < 0 else (-1, mpmath.inf)
    away = [mpf(0) - CENTRE[0], mpf(1) - CENTRE[1], mpf(0) - CENTRE[2]]
    a, b = dot(d, d), -dot(d, away)
    disc = b * b - a * (dot(away, away) - 1)
    if disc > 0 and (s := (b - mpmath.sqrt(disc)) / a) < found[1]:
        found = (1, s)
    beyond = found[0] >= 0 and dot(at := point(found[1], d), at) > BOUNDS**2
    return (-1, mpmath.inf) if beyond else found


def point(s: mpf, d: Point) -> Point:
    return [s * d[0], 1 + s * d[1], s * d[2]]


def rays() -> Iterator[tuple[int, int, Point]]:
    """Row, column and direction through the pixel's middle, with the driver's double of tan(fov/2)."""
    forward = [mpf(0), mpf(-0.2) - 1, mpf(8)]
    length = mpmath.sqrt(dot(forward, forward))
    forward = [c / length for c in forward]
    up, tangent = [mpf(0), forward[2], -forward[1]], mpf(float(np.tan(np.radians(15.0))))
    for row, column in np.ndindex(HEIGHT, WIDTH):
        a, b = mpf(2 * column + 1 - WIDTH) / HEIGHT * tangent, mpf(HEIGHT - 2 * row - 1) / HEIGHT * tangent
        yield row, column, [a + forward[0], forward[1] + b * up[1], forward[2] + b * up[2]]


def seen(picture: dict[str, np.ndarray]) -> list[tuple[tuple[int, int], Point]]:
    """(row, column) and point of every hit on the floor, and of the sphere where there is one."""
    found = []
    for row, column, d in rays():
        shape = picture["id"][row, column]
        s = (FLOOR - 1) / d[1] if shape == 0 else first_hit(d)[1]
        if shape >= 0:
            found.append(((row, column), point(s, d)))
    return found


def towards(p: Point, light: tuple) -> tuple[Point, mpf]:
    to_light = [mpf(x) - y for x, y in zip(light, p, strict=True)]
    length = mpmath.sqrt(dot(to_light, to_light))
    return [x / length for x in to_light], length


def estimator(solid: Callable, p: Point, light: tuple) -> float:
    """The soft shadow that every phase marches: the steps and terms of phases/baseline/march.c."""
    d, _ = towards(p, light)
    least, previous, t = mpf(1), mpf(10) ** 20, mpf(START)
    for _ in range(3000):
        q = [x + t * y for x, y in zip(p, d, strict=True)]
        if t > START and dot(q, q) > BOUNDS**2:
            break
        h = min(q[1] - FLOOR, solid(*q))
        if h < mpf(1e-6):
            break
        y = h * h / (2 * previous)
        if h * h - y * y > 0 and t - y > 0:
            least = min(least, STRENGTH * mpmath.sqrt(h * h - y * y) / (t - y))
        previous = h
        t += h
    return float(max(least, 0))


def ideal(solid: Callable, p: Point, light: tuple) -> float:
    """Clamp of the least strength·h(t)/t, of 200,001 samples, refined around the least."""
    d, length = towards(p, light)
    d, p = np.array(d, float), np.array(p, float)
    t = np.geomspace(START, float(length), 200001)
    for _ in range(3):
        at = p + t[:, None] * d
        h = np.minimum(at[:, 1] - FLOOR, solid(*at.T, of=np))
        i = int(np.argmin(h / t))
        least = h[i] / t[i]
        t = np.linspace(t[max(i - 1, 0)], t[min(i + 1, len(t) - 1)], 1001)
    return float(np.clip(STRENGTH * least, 0, 1))


def blocked(p: Point, light: tuple) -> bool:
    d, length = towards(p, light)
    rest = [x - c for x, c in zip(p, CENTRE, strict=True)]
    b = dot(rest, d)
    disc = b * b - dot(rest, rest) + 1
    far = -b + mpmath.sqrt(disc) if disc > 0 else -mpmath.inf
    return bool(disc > 0 and far > START and -b - mpmath.sqrt(disc) < length)


def test_hits_normals_and_status(pictures):
    p, hits = pictures["none"], []
    for row, column, d in rays():
        shape, s = first_hit(d)
        hits.append(shape)
        assert p["id"][row, column] == shape, f"pixel {column}, {row}"
        if shape < 0:
            assert p["Z"][row, column] == np.inf
            continue
        t, at = float(s * mpmath.sqrt(dot(d, d))), point(s, d)
        assert abs(p["Z"][row, column] - t) <= 2**-24 * t * 1.0001, f"pixel {column}, {row}: {t}"
        n = [p[f"N.{axis}"][row, column] for axis in "xyz"]
        known = [0, 1, 0] if shape == 0 else [float(x - c) for x, c in zip(at, CENTRE, strict=True)]
        assert np.abs(np.array(n) - known).max() <= 1e-7
    assert set(hits) == {-1, 0, 1}
    assert (p["status"] == 2).all() and (p["status.all"] == 2).all()
    assert (p["width"][p["id"] < 0] == 0).all()
    assert (p["width"][p["id"] >= 0] > 0).any() and (p["width"] < 1e-20).all()


def test_without_shadows_all_three_are_one(pictures):
    p = pictures["none"]
    for name in "RGB":
        assert np.array_equal(p[name], p[f"none.{name}"]) and np.array_equal(p[name], p[f"ideal.{name}"])
        for other in ("hard", "soft"):
            assert np.array_equal(p[name], pictures[other][f"none.{name}"])
            assert (pictures[other][name] <= p[name]).all()
            assert (pictures[other][name] < p[name]).any(), f"{other} shadows change nothing"
    assert (p["shadow"] == 1).all() and (p["shadow.ideal"] == 1).all()


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=[pytest.mark.slow] * (n != "sphere")) for n in SOLIDS]
)
def test_soft_shadow_is_the_estimator_and_ideal_the_least(name, tmp_path):
    solid, _, light = SOLIDS[name]
    p, partial = drawn(name, "soft", tmp_path), set()
    points = [one for one in seen(p) if name == "sphere" or p["id"][one[0]] == 0]
    assert len(points) > 60  # of which only the torus needs all for its second minimum to be seen
    for spot, at in points[:: 1 if name == "torus" else 3]:
        found = p["shadow"][spot], p["shadow.ideal"][spot]
        wanted = estimator(solid, at, light), ideal(solid, at, light)
        assert abs(found[0] - wanted[0]) <= 1e-6, f"{spot}: {found}, not {wanted}"
        near = 1e-6 if name in ("sphere", "blend") else 1.2 * PROVED_TO
        assert abs(found[1] - wanted[1]) <= near, f"{spot}: {found}, not {wanted}"
        partial.add(round(wanted[1], 2))
    assert len(partial) > 3, f"hardly a penumbra: {partial}"
    assert (p["shadow"][p["id"] < 0] == 1).all()


def test_hard_shadow_is_blocked_or_not(pictures):
    p, dark = pictures["hard"], 0
    for spot, at in seen(p):
        wanted = 0 if blocked(at, SOLIDS["sphere"][2]) else 1
        assert p["shadow"][spot] == wanted, f"pixel {spot}"
        dark += wanted == 0
    assert dark > 3
    assert np.array_equal(p["shadow"], p["shadow.ideal"]) and (p["status.all"] == 2).all()


def test_threads_do_not_change_a_bit(tmp_path):
    """Tiles are dealt to threads as they come: every plane must be the same whoever has it."""
    path = registry.find_scene("trio").path
    planes = []
    for threads in (1, 2, 3):
        render("truth", path, 18, aov=True, out=tmp_path / f"{threads}.exr", threads=threads)
        planes.append(images.read(tmp_path / f"{threads}.exr"))
    for other in planes[1:]:
        assert all(np.array_equal(planes[0][name], other[name]) for name in planes[0])
