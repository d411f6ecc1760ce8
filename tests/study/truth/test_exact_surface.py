"""The Mandelbulb's exact surface: what truth's program proves, held against arb's balls along the whole ray.

The theorem is the same (truth/PROOFS.md, tried on points by tests/c/phases/test_ball.c), the program another.
"""

from __future__ import annotations

import json

import enclosures
import mpmath
import numpy as np
import pytest
from flint import arb, ctx
from mpmath import mpf

from study.core import registry
from study.core.build import build
from study.core.run import render
from study.pictures import images
from study.truth import judging

BULB = {"type": "mandelbulb", "power": 8, "iterations": 4, "bailout": 256, "material": "white"}
SPHERE = {"type": "sphere", "radius": 2, "material": "white"}
REACH = 4.0  # of the rays of this file, in units of their directions: then they are behind the bulb
NEAR = 1e-8  # before the hit, where halves are needed as small as the bracket


@pytest.fixture
def claims(tmp_path):
    """status, shape, bounds of s, evaluations of rays, by build/truth/rays."""

    def ask(shapes, rays, bounds=40):
        data = enclosures.scene("sphere") | {"shapes": shapes}
        data["march"]["bounds_radius"] = bounds
        path = tmp_path / "scene.json"
        path.write_text(json.dumps(data))
        return enclosures.claimed(build("truth", "rays"), path, np.array(rays, float))

    return ask


@pytest.fixture(autouse=True)
def bits():
    before, ctx.prec = ctx.prec, 160
    yield
    ctx.prec = before


def squared(a, b, times: int):
    """(a + ib) to the power of 2ⁿ."""
    for _ in range(times):
        a, b = (a - b) * (a + b), 2 * a * b
    return a, b


def power(w, c):
    """w⁸ + c, off the axis: the angle to the axis y and the azimuth times 8, the length to its power."""
    x, y, z = w
    rho = (x * x + z * z).sqrt()
    up, out = squared(y, rho, 3)
    re, im = squared(x / rho, z / rho, 3)
    return c[0] - out * im, c[1] + up, c[2] + out * re


def norm(w):
    return (w[0] * w[0] + w[1] * w[1] + w[2] * w[2]).sqrt()


def side(ray, a: float, b: float, iterations: int) -> int:
    """+1 if the ray is outside at every point from a to b, −1 inside, 0 undecided: |zₙ| at the middle, and
    the most by which the maps can part another point from it."""
    middle = (arb(a) + arb(b)) / 2
    c = w = tuple(o + d * middle for o, d in zip(ray[:3], ray[3:], strict=True))
    e = start = norm(tuple(map(arb, ray[3:]))) * (arb(b) - arb(a)) / 2
    for i in range(iterations):
        r = norm(w)
        if r - e > 2 and (i == 0 or r - e > norm(c) + start):
            return 1
        if not (r > 2 * e and w[0] * w[0] + w[2] * w[2] > 0):
            return 0
        polar = (w[1] / r).acos() + arb(0, (e / r).asin().upper())
        turning = abs(8 * polar.cos() * (2 * polar).cos() * (4 * polar).cos())  # sin 8θ / sin θ
        steepest = 8 * (r + e) ** 7 * max(arb(1), min(arb(8), turning.upper()))
        e, w = (steepest * e + start).upper(), power(w, c)
    return 1 if norm(w) - e > 1 else -1 if norm(w) + e < 1 else 0


def is_outside(ray, low: float, high: float, iterations: int) -> bool:
    """Whether arb proves it of every point from low to high."""
    stack = [(low, high)]
    for _ in range(5000):
        if not stack:
            return True
        a, b = stack.pop()
        if side(ray, a, b, iterations) != 1:
            stack += [((a + b) / 2, b), (a, (a + b) / 2)]
    return False


def sample(count: int, seed: int) -> list[list[float]]:
    """Rays from 1.75 away at points of the ball of radius 1.1, in multiples of 2⁻²⁰."""
    rng = np.random.default_rng(seed)
    v = rng.normal(size=(2, count, 3))
    v /= np.linalg.norm(v, axis=-1, keepdims=True)
    o, to = 1.75 * v[0], v[1] * rng.uniform(0, 1.1, count)[:, None]
    return (np.round(np.hstack([o, to - o]) * 2**20) / 2**20).tolist()


@pytest.mark.parametrize("iterations, count", [(1, 6), (4, 14), (7, 4)])
def test_what_is_proved_holds(claims, iterations, count):
    rays = sample(count, iterations)
    found = claims([BULB | {"iterations": iterations}], rays)
    assert (found[:, 0] == 2).all() and (found[:, 1] == 0).sum() > 0
    for ray, (_, shape, low, high, _) in zip(rays, found.tolist(), strict=True):
        if shape < 0:
            assert is_outside(ray, 0, REACH, iterations), ray
            continue
        assert 0 <= high - low < 1e-8
        assert is_outside(ray, 0, low - NEAR, iterations), ray
        assert [side(ray, s, s, iterations) for s in (low, high)] == [1, -1], ray


def test_a_false_claim_is_noticed(claims):
    rays = sample(14, 4)
    found = [(r, c) for r, c in zip(rays, claims([BULB], rays).tolist(), strict=True) if c[1] == 0]
    for ray, (_, _, low, high, _) in found[:1]:
        assert not is_outside(ray, 0, high + 1e-6, 4)
        assert [side(ray, s, s, 4) for s in (low - 1e-7, high + 1e-7)] == [1, -1]


def polar(iterations: int) -> float:
    """The c > 0 for which n iterations of y⁸ + c reach 1: where the surface meets its polar axis."""
    low, high = mpf(0), mpf(1)
    for _ in range(120):
        c = y = (low + high) / 2
        for _ in range(iterations):
            y = y**8 + c
        low, high = (low, c) if y > 1 else (c, high)
    return float(low)


def test_along_the_polar_axis_and_from_inside(claims):
    mpmath.mp.dps = 40
    for n in (1, 3, 4):  # of more, too many balls: there the map is eight times as steep across as along
        c = polar(n)
        down, up = claims([BULB | {"iterations": n}], [[0, 3, 0, 0, -1, 0], [0, 0, 0, 0, 1, 0]])
        assert down[0] == 2 and down[2] - 1e-15 <= 3 - c <= down[3] + 1e-15
        assert up[0] == 2 and up[2] - 1e-16 <= c <= up[3] + 1e-16  # it leaves the solid there


def test_a_moved_bulb_is_hit_where_its_ray_is(claims):
    rays = sample(10, 9)
    known = claims([BULB], rays)[:, 1:4]
    at = [1.5, -2.25, 8]
    # (x, y) turned by 90° about z is (−y, x), of the bulb's frame; so the scene's ray is (y, −x).
    turned = [[o[1] + at[0], -o[0] + at[1], o[2] + at[2], o[4], -o[3], o[5]] for o in rays]
    shifted = [[o[0] - 8, o[1], o[2] + 4, *o[3:]] for o in rays]
    there = claims([BULB | {"position": at, "rotation_degrees": [0, 0, 90]}], turned)
    copy = claims([BULB | {"repeat": [4, 0, 4]}], shifted, bounds=11)
    for found in (there, copy):
        for (shape, low, high), (status, index, a, b, _) in zip(known, found, strict=True):
            if shape == 0:
                assert (status, index) == (2, 0) and a <= high and low <= b
    assert (there[:, 1] == known[:, 0]).all()


def test_with_solids_the_first_is_first_and_what_is_not_known_is_undecided(claims):
    before, behind = (
        {"type": "plane", "normal": [0, 1, 0], "offset": y, "material": "white"} for y in (2, -2)
    )
    ray = [[0, 3, 0, 0, -1, 0]]
    assert claims([behind, BULB], ray)[0, :2].tolist() == [2, 1]
    status, shape, low, high, _ = claims([before, BULB], ray)[0]
    assert (status, shape) == (2, 0) and low <= 1 <= high
    assert claims([SPHERE, BULB], [[0, 1.5, 0, 0, -1, 0]])[0, 0] == 0  # from inside of the sphere
    assert claims([BULB, BULB | {"position": [0, 0.25, 0]}], [[0, 0.1, 0, 0, 1, 0]])[0, 0] == 0
    assert claims([BULB, BULB | {"position": [0, 4, 0]}], [[0, 9, 0, 0, -1, 0]])[0, :2].tolist() == [2, 1]


@pytest.mark.parametrize("shadows", ["soft", "hard"])
def test_the_picture_of_the_exact_surface(tmp_path, shadows):
    data = json.loads(registry.find_scene("mandelbulb").path.read_text())
    data["light"]["shadows"] = shadows
    (tmp_path / "scene.json").write_text(json.dumps(data))
    render("truth", tmp_path / "scene.json", 14, 24, aov=True, out=tmp_path / "out.exr")
    made = images.read(tmp_path / "out.exr")
    bulb = made["surface.id"] == 1
    assert (made["surface.status"] == 2).all() and (made["status"] == 1).all()
    assert made["surface.width"].max() < 1e-8 and bulb.sum() > 40
    # A march ends before the surface or behind it, seldom far off.
    off = np.abs(made["surface.Z"][bulb] - made.Z[bulb])
    assert 0 < np.median(off) < 1e-4
    normals = np.stack([made[f"surface.N.{axis}"] for axis in "xyz"], -1)
    assert np.abs(np.linalg.norm(normals[bulb], axis=-1) - 1).max() < 1e-6
    errors = judging.surface(made, made)
    assert errors["proved_fraction"] == 1 and errors["lost_ppm"] < 5e4
    assert 15 < errors["psnr_db"] < 60 and errors["psnr_ideal_db"] < errors["psnr_db"] + 30


def test_where_there_is_no_mandelbulb_there_is_no_such_picture(tmp_path):
    for name in ("two_spheres", "mandelbox"):
        render("truth", registry.find_scene(name).path, 4, 6, aov=True, out=tmp_path / "out.exr")
        made = images.read(tmp_path / "out.exr")
        assert not made["surface.status"].any() and judging.surface(made, made) is None
