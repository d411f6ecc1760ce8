"""The exact oracle against others: roots that other programs find, distances and pictures of a phase."""

from __future__ import annotations

import json
import math
import subprocess

import enclosures
import mpmath
import numpy as np
import pytest
from exact_scenes import TORUS, one

from study.core import registry, run
from study.core.build import build
from study.pictures import images
from study.truth import exact


def quartic_roots(origin, direction, big, small):
    """Torus roots by mpmath's polyroots at 60 digits; the quartic through five of its values."""
    with mpmath.workdps(60):
        o, d = ([mpmath.mpf(x) for x in v] for v in (origin, direction))

        def value(s):
            x, y, z = (a + s * b for a, b in zip(o, d, strict=True))
            return (x * x + y * y + z * z + big**2 - small**2) ** 2 - 4 * big**2 * (x * x + z * z)

        points = [mpmath.mpf(k) for k in range(-2, 3)]
        matrix = mpmath.matrix([[p**k for k in range(4, -1, -1)] for p in points])
        solved = mpmath.lu_solve(matrix, mpmath.matrix([value(p) for p in points]))
        roots = mpmath.polyroots(list(solved)[::-1], maxsteps=500, extraprec=400, asc=True)
        return sorted(r.real for r in roots if abs(r.imag) < mpmath.mpf(10) ** -40 and r.real > 0)


def test_two_near_roots_are_told_apart():
    """Through the torus's skin: entry and exit are 1.8·10⁻⁸ apart, and the entry is known to 10⁻¹⁵."""
    ray = (-1.0496531097197872, 0.8889713575288001, 1.6379704873204435)
    along = (0.836911710082458, -0.4792514382918935, -0.2643801210794927)
    found = exact.first_hit(one(**TORUS), ray, along)
    (root, *_) = quartic_roots(ray, along, 1, mpmath.mpf(0.25))
    assert found.status == "hit" and float(found.low) == pytest.approx(float(root), rel=1e-14)


def test_torus_against_polyroots():
    rng = np.random.default_rng(5)
    torus, hits = one(**TORUS), 0
    for _ in range(150):
        o = rng.normal(size=3) * 2
        d = rng.normal(size=3) - 0.8 * o
        found = exact.first_hit(torus, o.tolist(), d.tolist())
        roots = quartic_roots(o.tolist(), d.tolist(), 1, mpmath.mpf(0.25))
        assert (found.status == "hit") == bool(roots)
        if roots:
            hits += 1
            with mpmath.workdps(60):
                middle = mpmath.mpf(found.low.numerator) / found.low.denominator
                assert abs(middle - roots[0]) <= mpmath.mpf(10) ** -30 * (1 + roots[0])
    assert hits > 40


@pytest.mark.parametrize("kind", ["sphere", "cone"])
def test_quadratics_against_numpy(kind):
    """By numpy.roots of values sampled on the ray; what the other root and the caps allow is by hand."""
    rng = np.random.default_rng(6)
    size, shape = enclosures.SHAPES[kind], one(kind, **enclosures.SHAPES[kind])
    hits = 0
    for _ in range(300):
        o = rng.normal(size=3) * 3
        d = rng.normal(size=3) - 0.6 * o
        s = np.linspace(-1, 1, 3)
        x, y, z = (o[:, None] + d[:, None] * s).astype(np.float64)
        if kind == "sphere":
            values, allowed = x * x + y * y + z * z - size["radius"] ** 2, lambda y: True
            if o @ o < size["radius"] ** 2:
                continue
        else:
            h, r1, r2 = size["half_height"], size["bottom_radius"], size["top_radius"]
            radius = (r1 + r2) / 2 + (r2 - r1) * y / (2 * h)
            values, allowed = x * x + z * z - radius**2, lambda y, h=h: abs(y) <= h
            if abs(o[1]) < h:
                continue
        roots = np.roots(np.polyfit(s, values, 2))
        ends = [r.real for r in roots if abs(r.imag) < 1e-12 and allowed(o[1] + d[1] * r.real)]
        if kind == "cone":
            for side, r in ((h, r2), (-h, r1)):
                t = (side - o[1]) / d[1]
                ends += [t] if np.hypot(*(o + t * d)[[0, 2]]) <= r else []
        ends = sorted(t for t in ends if t >= 0)
        found = exact.first_hit(shape, o.tolist(), d.tolist())
        assert (found.status == "hit") == bool(ends)
        if ends:
            hits += 1
            assert float(found.low) == pytest.approx(ends[0], rel=1e-9, abs=1e-9)
    assert hits > 50


FRAMES = {
    "plain": {},
    "rotated": {"rotation_degrees": enclosures.ROTATION, "position": enclosures.POSITION},
    "repeated": {"repeat": enclosures.CELLS["tight"], "position": enclosures.POSITION},
    "both": {"repeat": enclosures.CELLS["tight"], "rotation_degrees": enclosures.ROTATION},
}


@pytest.mark.parametrize("frame", FRAMES)
@pytest.mark.parametrize("kind", enclosures.SHAPES)
def test_against_the_distances_of_baseline(kind, frame, tmp_path):
    """No sign change of the naive phase's distance before the hit, and zero there (or a jump at a wall)."""
    data = enclosures.scene(kind, **FRAMES[frame])
    data["march"]["bounds_radius"] = 30
    path = tmp_path / "scene.json"
    path.write_text(json.dumps(data))
    local = enclosures.rays(kind, 60, 3)[0]
    local = local[np.linalg.norm(local[:, :3], axis=1) < 12]
    rays = enclosures.moved(local) if "rotation_degrees" in FRAMES[frame] else local
    reach = 30 / np.linalg.norm(rays[:, 3:], axis=1)
    found = [exact.first_hit(exact.Scene.of(data), r[:3], r[3:]) for r in rays.tolist()]
    ends = np.array([float(f.low) if f.status == "hit" else m for f, m in zip(found, reach, strict=True)])
    share = np.concatenate([np.linspace(0, 1, 400, endpoint=False), [1 - 1e-9, 1, 1 + 1e-9]])
    points = rays[:, None, :3] + (ends[:, None] * share)[..., None] * rays[:, None, 3:]
    inside = np.linalg.norm(points, axis=-1) < 30
    program = build("baseline", "probe")
    done = subprocess.run([program, path], input=points.tobytes(), capture_output=True, check=True)
    f = np.frombuffer(done.stdout).reshape(*points.shape[:2], 2)[..., 0]
    sides = np.where(f[:, :1] < 0, -1, 1) * f
    hit = np.array([item.status == "hit" for item in found])
    started = (np.abs(f[:, 0]) > 1e-9) & np.array([item.status != "undecided" for item in found])
    slack = 1e-12 * (1 + np.abs(points).max(axis=-1))
    assert started.sum() > 20 and hit[started].sum() > 10
    assert (sides > -slack)[:, :-2][started][inside[:, :-2][started]].all()
    jump = (sides[:, -3] > 0) & (sides[:, -1] < 0)
    zero = np.abs(f[:, -2]) < 1e-10 * (1 + np.abs(points[:, -2]).max(axis=-1))
    assert (zero | jump)[hit & started].all()


def test_camera_rays_are_the_phases(tmp_path):
    """t = s·|direction| against the naive phase's picture."""
    scene = registry.find_scene("scene0_plain")
    program = exact.Scene.of(scene.data)
    width, height = scene.size(9)
    run.render("baseline", scene.path, height, aov=True, out=tmp_path / "out.exr")
    picture = images.read(tmp_path / "out.exr")
    same = 0
    for row in range(height):
        for column in range(width):
            o, d = program.camera_ray(column, row, width, height)
            found = exact.first_hit(program, o, d)
            if found.shape == picture["id"][row, column] and found.status == "hit":
                t = float(found.low) * math.sqrt(sum(float(x) ** 2 for x in d))
                assert picture["Z"][row, column] == pytest.approx(t, rel=2e-4)
                same += 1
    assert same > 0.8 * (picture["id"] >= 0).sum() > 20
