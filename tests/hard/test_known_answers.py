"""The answers that hard cases 1 to 11 call known, against exact rationals, mpmath with 60 digits, and
distances from geometry (conformance/geometry.py). No phase takes part."""

from __future__ import annotations

import math
from fractions import Fraction
from itertools import pairwise

import mpmath
import numpy as np
import pytest
from mpmath import mpf

from conformance import geometry
from study.experiments.stability.cases.rays import (
    c01_grazing_plane,
    c03_halo,
    c04_step_cap,
    c05_far_wall,
    c07_camera_shift,
    c08_scale,
)
from study.experiments.stability.cases.shapes import (
    c02_silhouette,
    c06_far_sphere,
    c09_repetition,
    c10_thin_plate,
    c11_edges,
    c36_thin_normal,
)

mpmath.mp.dps = 60


def to_plane(scene: dict, plane: dict) -> mpf:
    """Exact t of the ray of a 1×1 picture to a plane; the ray is from the numbers of the file."""
    camera = scene["camera"]
    origin, target = ([mpf(x) for x in camera[key]] for key in ("position", "look_at"))
    way = [b - a for a, b in zip(origin, target, strict=True)]
    length = mpmath.sqrt(sum(x * x for x in way))
    normal, offset = [mpf(x) for x in plane["normal"]], mpf(plane["offset"])
    across = sum(n * x for n, x in zip(normal, way, strict=True)) / length
    return (offset - sum(n * x for n, x in zip(normal, origin, strict=True))) / across


@pytest.mark.parametrize("degrees", c01_grazing_plane.CASE.strengths)
def test_grazing_plane(degrees: float) -> None:
    scene = c01_grazing_plane.grazing(degrees)
    t, steps = c01_grazing_plane.answer(degrees)
    assert abs(to_plane(scene, scene["shapes"][0]) / mpf(t) - 1) < 1e-14
    height, evals = mpf(1), 1
    step = mpmath.sin(mpf(degrees) * mpmath.pi / 180)
    while not height < mpf(c01_grazing_plane.HIT_DISTANCE):
        height, evals = height * (1 - step), evals + 1
    assert evals == steps < scene["march"]["max_steps"]


@pytest.mark.parametrize("delta", c02_silhouette.CASE.strengths)
def test_silhouette(delta: float) -> None:
    placed = c02_silhouette.starts(delta)
    assert len(placed) == 8
    for i, (x, y, meets) in enumerate(placed):
        impact = mpmath.hypot(mpf(x), mpf(y))
        assert meets == (impact < 1) == (i % 2 == 0)
        assert abs(abs(impact - 1) / mpf(delta) - 1) < 2**-52 / delta  # δ, but for the doubles' rounding
        camera = c02_silhouette.beside(x, y)["camera"]
        assert camera["position"][:2] == camera["look_at"][:2] == [x, y]


@pytest.mark.parametrize("clearance", c03_halo.CASE.strengths)
@pytest.mark.parametrize("distance", c03_halo.DISTANCES)
def test_halo(clearance: float, distance: float) -> None:
    scene = c03_halo.passing(clearance, distance)
    sphere, wall = scene["shapes"]
    nearest = Fraction(sphere["position"][0]) - Fraction(sphere["radius"])  # the ray is the z axis
    assert nearest > 0 and math.isclose(nearest, clearance, rel_tol=1e-8)
    assert to_plane(scene, wall) == c03_halo.BACKGROUND


@pytest.mark.parametrize("share", c04_step_cap.HEIGHTS)
@pytest.mark.parametrize("width", [w for w in c04_step_cap.CASE.strengths if w >= 0.02])
def test_step_cap(width: float, share: float) -> None:
    """A march with the geometry's distances: at the wall, after that number of evaluations."""
    scene = c04_step_cap.gap(width, share)
    origin = np.array(scene["camera"]["position"], float)
    forward = np.array([0, 0, 1.0])
    t, evals = 0.0, 0
    while evals < 20000:
        distance, evals = float(geometry.scene_distance((origin + t * forward)[None], scene)[0]), evals + 1
        if distance < 1e-6:
            break
        t += distance
    assert abs(t - c04_step_cap.LENGTH) < 1e-5
    # Close to the wall the last step is the way to the wall, so one or two fewer or more.
    assert abs(evals - c04_step_cap.steps_needed(width, share)) <= 2


@pytest.mark.parametrize("distance", c05_far_wall.CASE.strengths)
def test_far_wall(distance: float) -> None:
    scene = c05_far_wall.wall(distance)
    plane, t = scene["shapes"][0], c05_far_wall.exact(distance)
    origin, directions = geometry.rays(scene, *c05_far_wall.SIZE)
    normal = [mpf(x) for x in plane["normal"]]
    for row, column in ((0, 0), (0, 15), (7, 8), (15, 0), (15, 15)):
        across = sum(n * mpf(x) for n, x in zip(normal, directions[row, column], strict=True))
        assert abs((mpf(plane["offset"]) - 0) / across / mpf(t[row, column]) - 1) < 1e-13
    assert not origin.any() and (t > 0).all() and (t < scene["march"]["bounds_radius"]).all()


@pytest.mark.parametrize("distance", c06_far_sphere.CASE.strengths)
def test_far_sphere(distance: float) -> None:
    for offset in c06_far_sphere.OFFSETS:
        inside = mpf(1) - mpf(offset) ** 2
        t = c06_far_sphere.exact(distance, offset)
        if inside < 0:
            assert t == math.inf
        else:
            assert abs((mpf(distance) - mpmath.sqrt(inside)) / mpf(t) - 1) < 1e-15


def numbers(value: object) -> list[float]:
    """All numbers of a JSON value, in order."""
    if isinstance(value, dict):
        return [x for key in sorted(value) for x in numbers(value[key])]
    return [x for item in value for x in numbers(item)] if isinstance(value, list) else [value]


@pytest.mark.parametrize("k", c07_camera_shift.CASE.strengths)
def test_camera_shift(k: int) -> None:
    """Every place is moved by 2ᵏ without rounding, nothing else is, and all shapes stay inside the bounds."""
    home, away = c07_camera_shift.shifted(None), c07_camera_shift.shifted(k)

    def places(scene: dict) -> list[list[float]]:
        camera = [scene["camera"]["position"], scene["camera"]["look_at"], scene["light"]["position"]]
        return camera + [one["position"] for one in scene["shapes"]]

    for a, b in zip(numbers(places(home)), numbers(places(away)), strict=True):
        assert Fraction(b) - Fraction(a) == 2**k
    same = [{key: v for key, v in one.items() if key != "position"} for one in home["shapes"]]
    assert same == [{key: v for key, v in one.items() if key != "position"} for one in away["shapes"]]
    corner = math.dist((0, 0, 0), [2.0**k] * 3) + 16
    assert corner < away["march"]["bounds_radius"] <= 1e9
    points = np.round(np.random.default_rng(7).uniform(-8, 8, (200, 3)) * 16) / 16
    there = geometry.scene_distance(points + 2.0**k, away)
    assert np.allclose(there, geometry.scene_distance(points, home), rtol=0, atol=1e-13)


@pytest.mark.parametrize("k", c08_scale.CASE.strengths)
@pytest.mark.parametrize("sign", [1, -1])
def test_scale(k: int, sign: int) -> None:
    """Distances, and what fog and light are worked out from, scale exactly; the file keeps its limits."""
    s = 2.0 ** (sign * k)
    home, away = c08_scale.scaled(0), c08_scale.scaled(sign * k)
    points = np.random.default_rng(8).uniform(-40, 100, (300, 3))
    assert np.array_equal(
        geometry.scene_distance(points * s, away), s * geometry.scene_distance(points, home)
    )
    assert Fraction(away["fog"]) * Fraction(s) ** 3 == Fraction(home["fog"])
    for a, b in zip(home["light"]["emission"], away["light"]["emission"], strict=True):
        assert Fraction(b) / Fraction(s) == a
    for key in ("hit_distance", "bounds_radius", "normal_step", "surface_offset"):
        assert Fraction(away["march"][key]) == Fraction(home["march"][key]) * Fraction(s)
    directions = [geometry.rays(scene, *c08_scale.SIZE)[1] for scene in (home, away)]
    assert np.array_equal(*directions)
    lengths = [abs(x) for x in numbers(away) if isinstance(x, float) and x]
    assert max(lengths) <= 1e9 and min(numbers(away["march"])) >= 1e-9


def test_scale_moves_all_lengths() -> None:
    """Whatever is not scaled is no length: by name, so that a forgotten one is seen."""
    home, away = c08_scale.scaled(0), c08_scale.scaled(3)
    for a, b in zip(home["shapes"], away["shapes"], strict=True):
        kept = {key for key in a if a[key] == b[key] and np.any(np.array(a[key]) != 0)}
        assert kept <= {"type", "material", "rotation_degrees", "normal"}


@pytest.mark.parametrize("cell", c09_repetition.CASE.strengths)
def test_repetition(cell: float) -> None:
    """The geometry's distances in that cell are those of the centre cell, bit for bit."""
    p, far = c09_repetition.points(), np.array([cell * 4, cell * 4, 0])
    assert all(
        Fraction(x) == Fraction(a) + Fraction(b) for x, a, b in zip((p + far)[7], p[7], far, strict=True)
    )
    scene = c09_repetition.lattice(0)
    for one in scene["shapes"]:
        assert np.array_equal(geometry.shape_distance(p + far, one), geometry.shape_distance(p, one))
    home, away = c09_repetition.lattice(0), c09_repetition.lattice(cell)
    for a, b in pairwise((home["camera"]["position"], away["camera"]["position"])):
        assert [Fraction(y) - Fraction(x) for x, y in zip(a, b, strict=True)] == [4 * cell, 4 * cell, 0]
    reach = np.linalg.norm(np.add(away["camera"]["position"], [16, 16, 16]))
    assert reach < away["march"]["bounds_radius"]


def test_overstep() -> None:
    """Against the distances of 49 single cones: the wrapped one is too large by more than 1 somewhere."""
    cone = {k: v for k, v in c09_repetition.SHAPES[2].items() if k != "repeat"}
    p = c09_repetition.points()
    copies = [[4 * i, 4 * j, 10] for i in range(-3, 4) for j in range(-3, 4)]
    true = np.min([geometry.shape_distance(p, cone | {"position": at}) for at in copies], axis=0)
    wrapped = geometry.shape_distance(p, c09_repetition.SHAPES[2])
    over = float(np.max(np.where(wrapped > 0, wrapped - np.abs(true), 0)))
    assert math.isclose(over, c09_repetition.overstep(p, wrapped), abs_tol=1e-12) and over > 1


@pytest.mark.parametrize("thickness", c10_thin_plate.CASE.strengths)
def test_thin_plate(thickness: float) -> None:
    """At t the geometry's distance is 0, on the way before it is not, and behind it there is the plate."""
    scene, t = c10_thin_plate.plate(thickness), c10_thin_plate.exact(thickness)
    origin, directions = geometry.rays(scene, *c10_thin_plate.SIZE)
    assert (
        np.abs(geometry.scene_distance((origin + t[..., None] * directions).reshape(-1, 3), scene)).max()
        < 1e-14
    )
    for share in (0.1, 0.5, 0.9, 0.999):
        assert (
            geometry.scene_distance((origin + share * t[..., None] * directions).reshape(-1, 3), scene) > 0
        ).all()
    behind = (t + thickness / 2)[..., None]
    assert (geometry.scene_distance((origin + behind * directions).reshape(-1, 3), scene) < 1e-15).all()
    ring = c10_thin_plate.wire(thickness)
    top = np.array([[1, 5 - (5 - thickness / 2), 0]])
    assert abs(geometry.scene_distance(top, ring)[0]) < 1e-15
    assert geometry.scene_distance(top + np.array([0, 1e-3, 0]), ring)[0] == pytest.approx(1e-3, rel=1e-9)


@pytest.mark.parametrize("thickness", c36_thin_normal.CASE.strengths)
def test_thin_normal(thickness: float) -> None:
    """The geometry's gradient before the face, by central differences that stay before it."""
    scene, normal = c10_thin_plate.plate(thickness), c36_thin_normal.exact(thickness)
    origin, directions = geometry.rays(scene, *c10_thin_plate.SIZE)
    t = c10_thin_plate.exact(thickness)[..., None]
    points = (origin + t * directions).reshape(-1, 3) + 1e-3 * normal
    steps = 1e-4 * np.eye(3)
    ahead, behind = (
        np.array([geometry.scene_distance(points + sign * step, scene) for step in steps]) for sign in (1, -1)
    )
    assert np.abs((ahead - behind).T / 2e-4 - normal).max() < 1e-10
    assert ((directions @ normal) < 0).all()


@pytest.mark.parametrize("delta", c11_edges.CASE.strengths)
def test_edges(delta: float) -> None:
    """The spot is on the surface, flat for half of δ around with that normal, and no longer for three δ."""
    random = np.random.default_rng(11)
    for name, one, point, normal in c11_edges.spots(delta):
        assert abs(geometry.shape_distance(point[None], one)[0]) < 1e-15, name
        assert math.isclose(np.linalg.norm(normal), 1, rel_tol=1e-15), name
        around = random.normal(size=(400, 3))
        around /= np.linalg.norm(around, axis=1, keepdims=True)
        around -= np.outer(np.minimum(around @ normal, 0), 2 * normal)  # to the outer side
        curved = delta**2 if "rim" in name else 0  # the cone's side
        for reach, flat in ((0.5, True), (3.0, False)):
            off = geometry.shape_distance(point + reach * delta * around, one) - reach * delta * (
                around @ normal
            )
            assert (np.abs(off).max() < curved * reach**2 + 1e-15) == flat, (name, reach)
