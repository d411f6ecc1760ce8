"""Hard cases of rays and cameras: their known answers, computed in another way."""

import math
from decimal import Decimal
from fractions import Fraction

import mpmath
import numpy as np
import pytest
from mpmath import mpf

from conformance import geometry
from hard.known import first_hit_holds, of, strengths
from study.core import registry
from study.experiments.stability.cases import Phase, arithmetic, builds, fields, marches
from study.experiments.stability.cases.scenes import rays


def to_plane(scene: dict, plane: dict) -> mpf:
    """Exact t of the ray of a 1×1 picture to a plane; the ray is from the numbers of the file."""
    camera = scene["camera"]
    origin, target = ([mpf(x) for x in camera[key]] for key in ("position", "look_at"))
    way = [b - a for a, b in zip(origin, target, strict=True)]
    length = mpmath.sqrt(sum(x * x for x in way))
    normal, offset = [mpf(x) for x in plane["normal"]], mpf(plane["offset"])
    across = sum(n * x for n, x in zip(normal, way, strict=True)) / length
    return (offset - sum(n * x for n, x in zip(normal, origin, strict=True))) / across


def numbers(value: object) -> list[float]:
    """All numbers of a JSON value, in order."""
    if isinstance(value, dict):
        return [x for key in sorted(value) for x in numbers(value[key])]
    return [x for item in value for x in numbers(item)] if isinstance(value, list) else [value]


@strengths("degrees", 1)
def test_grazing_plane(degrees: float) -> None:
    scene = marches.grazing(degrees)
    t, steps = marches.grazing_answer(degrees)
    assert abs(to_plane(scene, scene["shapes"][0]) / mpf(t) - 1) < 1e-14
    height, evals = Decimal(1), 1  # of 28 digits, and twenty times as fast as mpf
    step = Decimal(str(mpmath.sin(mpf(degrees) * mpmath.pi / 180)))
    while not height < Decimal(marches.HIT_DISTANCE):
        height, evals = height * (1 - step), evals + 1
    assert evals == steps < scene["march"]["max_steps"]


@pytest.mark.parametrize("share", marches.HEIGHTS)
@pytest.mark.parametrize(
    "width",
    [pytest.param(w, marks=[pytest.mark.slow] * (w < 0.04)) for w in of(4).strengths if w >= 0.02],
)
def test_step_cap(width: float, share: float) -> None:
    """A march with the geometry's distances: at the wall, after that number of evaluations."""
    scene = marches.gap(width, share)
    origin = np.array(scene["camera"]["position"], float)
    forward = np.array([0, 0, 1.0])
    t, evals = 0.0, 0
    while evals < 20000:
        distance, evals = float(geometry.scene_distance((origin + t * forward)[None], scene)[0]), evals + 1
        if distance < 1e-6:
            break
        t += distance
    assert abs(t - marches.LENGTH) < 1e-5
    # Close to the wall the last step is the way to the wall, so one or two fewer or more.
    assert abs(evals - marches.steps_needed(width, share)) <= 2


@strengths("k", 7)
def test_camera_shift(k: int) -> None:
    """Every place is moved by 2ᵏ without rounding, nothing else is, and all shapes stay inside the bounds."""
    home, away = arithmetic.shifted(None), arithmetic.shifted(k)

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


@strengths("k", 8)
@pytest.mark.parametrize("sign", [1, -1])
def test_scale(k: int, sign: int) -> None:
    """Distances, and what fog and light are worked out from, scale exactly; the file keeps its limits."""
    s = 2.0 ** (sign * k)
    home, away = arithmetic.scaled(0), arithmetic.scaled(sign * k)
    points = np.random.default_rng(8).uniform(-40, 100, (300, 3))
    assert np.array_equal(
        geometry.scene_distance(points * s, away), s * geometry.scene_distance(points, home)
    )
    assert Fraction(away["fog"]) * Fraction(s) ** 3 == Fraction(home["fog"])
    for a, b in zip(home["light"]["emission"], away["light"]["emission"], strict=True):
        assert Fraction(b) / Fraction(s) == a
    for key in ("hit_distance", "bounds_radius", "normal_step", "surface_offset"):
        assert Fraction(away["march"][key]) == Fraction(home["march"][key]) * Fraction(s)
    directions = [geometry.rays(scene, *arithmetic.SIZE)[1] for scene in (home, away)]
    assert np.array_equal(*directions)
    lengths = [abs(x) for x in numbers(away) if isinstance(x, float) and x]
    assert max(lengths) <= 1e9 and min(numbers(away["march"])) >= 1e-9


def test_first_hits_of_the_cases() -> None:
    """The closed forms of exact.py against distances from geometry, along the very rays of the cases."""
    first_hit_holds(fields.first_hits()[0], fields.LIPSCHITZ_SIZE, fields.first_hits()[3])
    for k in (0, 1):
        first_hit_holds(
            arithmetic.side_by_side(k), arithmetic.GRAIN_SIZE, arithmetic.sizes_truth(k)[0], 10.0**-k
        )


def test_sphere_against_rationals() -> None:
    """t of a giant sphere close by (case 22 at its hardest) in 60 digits."""
    whole = arithmetic.side_by_side(6)
    directions = rays(whole, arithmetic.GRAIN_SIZE)[1]
    t, shapes = arithmetic.sizes_truth(6)
    for row, column in [(0, 0), (7, 20), (16, 16), (31, 3)]:
        d = [mpf(float(x)) for x in directions[row, column]]
        found = []
        for ball in whole["shapes"]:
            away = [mpf(0) - mpf(float(x)) for x in ball["position"]]
            a, b = sum(x * x for x in d), sum(x * y for x, y in zip(d, away, strict=True))
            inside = b * b - a * (sum(x * x for x in away) - mpf(float(ball["radius"])) ** 2)
            found.append((-b - mpmath.sqrt(inside)) / a if inside >= 0 else mpmath.inf)
        assert shapes[row, column] == found.index(min(found))
        assert abs(mpf(float(t[row, column])) / min(found) - 1) < 1e-9


def test_centres_by_geometry() -> None:
    for kind, sizes in arithmetic.ROOTS.items():
        for k in (20, 40) if kind == "mandelbulb" else (2, 10, 40):
            points, known = arithmetic.at_centre(kind, 2.0**-k)
            assert np.abs(geometry.shape_distance(points, {"type": kind, **sizes}) - known).max() < 1e-15
    points, known = arithmetic.at_centre("sphere", 2.0**-1100)
    assert (points == 0).all() and (known == -1).all()


@pytest.mark.slow
def test_builds_differ() -> None:
    """The other builds of case 21 are other builds: their flags are in the programs' records."""
    built = builds.contracted(Phase("baseline"))
    if built:
        built.program()
        flags = (registry.ROOT / built.folder / built.name / "phase_info.h").read_text()
        assert "-ffp-contract=fast" in flags
