"""The planes of truth against closed forms and a second program in mpmath (50 digits)."""

from __future__ import annotations

import json

import mpmath
import numpy as np
import pytest

from study.core import registry
from study.core.build import build
from study.core.registry import Spec
from study.core.run import render
from study.pictures import images

WIDTH, HEIGHT = 16, 9
RADIUS, CENTRE = 1.0, (0.0, 0.5, 8.0)
FLOOR = -0.75
LIGHT = (2.0, 7.0, 11.0)


def scene(shadows: str) -> dict:
    """A sphere over a plane, seen from the origin along z."""
    whole = json.loads(registry.find_scene("scene0").path.read_text())
    whole["light"] |= {"position": LIGHT, "shadows": shadows, "shadow_strength": 3}
    whole["march"]["bounds_radius"] = 100
    whole["shapes"] = [
        {"type": "plane", "normal": [0, 1, 0], "offset": FLOOR, "material": "white"},
        {"type": "sphere", "radius": RADIUS, "position": CENTRE, "material": "blue"},
    ]
    return whole


@pytest.fixture(scope="module")
def pictures(tmp_path_factory) -> dict[str, dict[str, np.ndarray]]:
    """By kind of shadow, with every plane."""
    build(Spec("truth", "truth"))
    folder, found = tmp_path_factory.mktemp("truth"), {}
    for shadows in ("none", "hard", "soft"):
        path = folder / f"{shadows}.json"
        path.write_text(json.dumps(scene(shadows)))
        render("truth", path, HEIGHT, aov=True, out=folder / "out.exr")
        found[shadows] = images.read(folder / "out.exr")
    return found


def direction(column: int, row: int) -> list[mpmath.mpf]:
    """Of the pixel's middle, not normalised, with the driver's double of tan(fov/2)."""
    tangent = mpmath.mpf(float(np.tan(np.radians(15.0))))
    return [
        mpmath.mpf(2 * column + 1 - WIDTH) / HEIGHT * tangent,
        mpmath.mpf(HEIGHT - 2 * row - 1) / HEIGHT * tangent,
        mpmath.mpf(1),
    ]


def first_hit(d: list[mpmath.mpf]) -> tuple[int, mpmath.mpf]:
    """(shape, s): −1 and infinity on a miss."""
    found = (-1, mpmath.inf)
    if d[1] < 0:
        found = (0, mpmath.mpf(FLOOR) / d[1])
    a, b = sum(x * x for x in d), sum(x * c for x, c in zip(d, CENTRE, strict=True))
    disc = b * b - a * (sum(mpmath.mpf(c) ** 2 for c in CENTRE) - RADIUS**2)
    if disc > 0 and (s := (b - mpmath.sqrt(disc)) / a) < found[1]:
        found = (1, s)
    if mpmath.isfinite(found[1]) and found[1] * mpmath.sqrt(a) > 100:
        return (-1, mpmath.inf)
    return found


def distance(p: list[mpmath.mpf]) -> mpmath.mpf:
    to_centre = mpmath.sqrt(sum((x - c) ** 2 for x, c in zip(p, CENTRE, strict=True)))
    return min(p[1] - FLOOR, to_centre - RADIUS)


def towards(p: list[mpmath.mpf]) -> tuple[list[mpmath.mpf], mpmath.mpf]:
    to_light = [mpmath.mpf(x) - y for x, y in zip(LIGHT, p, strict=True)]
    length = mpmath.sqrt(sum(x * x for x in to_light))
    return [x / length for x in to_light], length


def estimator(p: list[mpmath.mpf]) -> float:
    """The soft shadow that every phase marches (phases/baseline/march.c), in 50 digits."""
    d, _ = towards(p)
    least, previous, t = mpmath.mpf(1), mpmath.mpf(10) ** 20, mpmath.mpf(0.001)
    for _ in range(3000):
        q = [x + t * y for x, y in zip(p, d, strict=True)]
        if sum(x * x for x in q) > 100**2:
            break
        h = distance(q)
        if h < mpmath.mpf(1e-6):
            break
        y = h * h / (2 * previous)
        if h * h - y * y > 0 and t - y > 0:
            least = min(least, 3 * mpmath.sqrt(h * h - y * y) / (t - y))
        previous = h
        t += h
    return float(max(least, 0))


def ideal(p: list[mpmath.mpf]) -> float:
    """Clamp of the least 3·h(t)/t, by sampling densely and refining around the least."""
    d, length = towards(p)
    d, p = np.array(d, float), np.array(p, float)
    low, high = 0.001, float(length)
    for _ in range(6):
        t = np.linspace(low, high, 20001)
        at = p + t[:, None] * d
        h = np.minimum(at[:, 1] - FLOOR, np.linalg.norm(at - CENTRE, axis=1) - RADIUS)
        i = int(np.argmin(h / t))
        low, high = t[max(i - 1, 0)], t[min(i + 1, len(t) - 1)]
    return float(np.clip(3 * h[i] / t[i], 0, 1))


def blocked(p: list[mpmath.mpf]) -> bool:
    d, length = towards(p)
    rest = [x - c for x, c in zip(p, CENTRE, strict=True)]
    b = sum(x * y for x, y in zip(rest, d, strict=True))
    disc = b * b - sum(x * x for x in rest) + RADIUS**2
    far = -b + mpmath.sqrt(disc) if disc > 0 else -mpmath.inf
    return bool(disc > 0 and far > 0.001 and -b - mpmath.sqrt(disc) < length)


def pixels(picture: dict[str, np.ndarray]) -> list[tuple[int, int, int, list[mpmath.mpf]]]:
    """(row, column, shape, point) of every hit, after checking shape and depth."""
    found = []
    for row in range(HEIGHT):
        for column in range(WIDTH):
            d = direction(column, row)
            shape, s = first_hit(d)
            assert picture["id"][row, column] == shape, f"pixel {column}, {row}"
            if shape < 0:
                assert picture["Z"][row, column] == np.inf
                continue
            t = float(s * mpmath.sqrt(sum(x * x for x in d)))
            assert abs(picture["Z"][row, column] - t) <= 2**-24 * t * 1.0001, f"pixel {column}, {row}: {t}"
            found.append((row, column, shape, [s * x for x in d]))
    return found


def test_hits_normals_and_status(pictures):
    mpmath.mp.dps = 50
    p = pictures["none"]
    hits = pixels(p)
    assert {shape for _, _, shape, _ in hits} == {0, 1} and len(hits) < WIDTH * HEIGHT
    assert (p["status"] == 2).all() and (p["status.all"] == 2).all()
    assert (p["width"][p["id"] < 0] == 0).all()
    assert (p["width"][p["id"] >= 0] > 0).any() and (p["width"] < 1e-20).all()
    for row, column, shape, at in hits:
        n = [p[f"N.{axis}"][row, column] for axis in "xyz"]
        known = [0, 1, 0] if shape == 0 else [float(x - c) for x, c in zip(at, CENTRE, strict=True)]
        assert np.abs(np.array(n) - known).max() <= 1e-7


def test_without_shadows_all_three_are_one(pictures):
    p = pictures["none"]
    for name in "RGB":
        assert np.array_equal(p[name], p[f"none.{name}"]) and np.array_equal(p[name], p[f"ideal.{name}"])
        for other in ("hard", "soft"):
            assert np.array_equal(p[name], pictures[other][f"none.{name}"])
            assert (pictures[other][name] <= p[name]).all()
            assert (pictures[other][name] < p[name]).any(), f"{other} shadows change nothing"
    assert (p["shadow"] == 1).all() and (p["shadow.ideal"] == 1).all()


def test_soft_shadow_is_the_estimator_and_ideal_the_least(pictures):
    mpmath.mp.dps = 50
    p, partial = pictures["soft"], 0
    for row, column, _, at in pixels(p):
        found = p["shadow"][row, column], p["shadow.ideal"][row, column]
        wanted = estimator(at), ideal(at)
        assert abs(found[0] - wanted[0]) <= 1e-6, f"pixel {column}, {row}: {found[0]}, not {wanted[0]}"
        assert abs(found[1] - wanted[1]) <= 1e-6, f"pixel {column}, {row}: {found[1]}, not {wanted[1]}"
        partial += 0.01 < wanted[1] < 0.99
    assert partial > 3
    assert (p["shadow"][p["id"] < 0] == 1).all()


def test_hard_shadow_is_blocked_or_not(pictures):
    mpmath.mp.dps = 50
    p, dark = pictures["hard"], 0
    for row, column, _, at in pixels(p):
        wanted = 0 if blocked(at) else 1
        assert p["shadow"][row, column] == wanted, f"pixel {column}, {row}"
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
