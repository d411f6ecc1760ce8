"""The answers that hard cases 12 and up call known, computed again in another way: exact rationals, 60-digit
roots, dense sampling, symmetry, or distances from geometry (conformance/geometry.py). No phase takes part,
but where the loader's refusals and the CPU's instructions are what is known."""

from __future__ import annotations

import itertools
import json
import math
import subprocess
from pathlib import Path
from types import SimpleNamespace

import mpmath
import numpy as np
import pytest
from mpmath import mpf

from conformance import geometry
from hard.first_hits import first_hit_holds, on_ray
from study.core import registry
from study.core.cli import StudyError
from study.experiments.stability.cases import Phase, builds, exact
from study.experiments.stability.cases.light import c16_penumbra as c16
from study.experiments.stability.cases.light import c18_mirrors_and_inside as c18
from study.experiments.stability.cases.rays import c19_tiny_numbers as c19
from study.experiments.stability.cases.rays import c20_reciprocal_roots as c20
from study.experiments.stability.cases.rays import c21_contraction as c21
from study.experiments.stability.cases.rays import c22_sizes as c22
from study.experiments.stability.cases.scenes import angle_degrees, rays
from study.experiments.stability.cases.shapes import c12_medial_axis as c12
from study.experiments.stability.cases.shapes import c13_no_lipschitz_bound as c13
from study.experiments.stability.cases.shapes import c14_mandelbulb_poles as c14
from study.experiments.stability.cases.shapes import c17_torus_rim as c17

pytestmark = pytest.mark.slow

mpmath.mp.dps = 60


def test_first_hits_of_the_cases() -> None:
    """The closed forms of exact.py against distances from geometry, along the very rays of the cases."""
    first_hit_holds(c13.truth()[0], c13.SIZE, c13.truth()[3])
    for k in (0, 1):
        first_hit_holds(c22.side_by_side(k), c22.SIZE, c22.truth(k)[0], 10.0**-k)


def test_sphere_against_rationals() -> None:
    """t of a giant sphere close by (case 22 at its hardest) in 60 digits."""
    whole = c22.side_by_side(6)
    directions = rays(whole, c22.SIZE)[1]
    t, shapes = c22.truth(6)
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


def test_medial_axis_is_symmetric() -> None:
    """The scene is its own mirror image, and analytic normals have the symmetry that is asked for."""
    whole = c12.overlapping(1e-3)
    origin, directions = rays(whole, (c12.SIZE, c12.SIZE))
    assert np.allclose(directions[:, ::-1] * [-1, 1, 1], directions, atol=1e-16)
    t, shapes = exact.nearest(*(exact.sphere(origin, directions, s["position"], 1) for s in whole["shapes"]))
    assert (shapes[:, : c12.SIZE // 2] == 0).all() and (shapes[:, c12.SIZE // 2 :] == 1).all()
    centres = np.array([s["position"] for s in whole["shapes"]])[shapes]
    n = (origin + t[..., None] * directions - centres).astype(float)
    assert angle_degrees(n, n[:, ::-1] * [-1, 1, 1]).max() < 1e-9


def test_mandelbulb_against_geometry() -> None:
    """60 digits by angles against 80-bit floats by angles, where those have digits enough."""
    for k in (2, 6, 10):
        points, known = c14.truth(k)
        other = geometry.mandelbulb(points, c14.BULB)[0]
        assert np.abs(other - known).max() < 1e-11
    points, known = c14.truth(1000)
    assert (points[6:10] ** 2 == 0).all() and (np.abs(known[6:10]) < 1e-290).all()
    assert known[10:].max() < 1e-14, "the last points lie on the surface"


def test_mandelbulb_polynomial_on_the_axis() -> None:
    """On x = z = 0 the map is y → y⁸ + y (real), and the estimate follows by hand."""
    y = mpf("1.2")
    w, dz, m = y, mpf(1.5), y * y
    for _ in range(4):
        dz = 8 * abs(w) ** 7 * dz + 1
        w = w**8 + y
        m = w * w
        if m > 256:
            break
    assert abs(c14.estimate((0.0, 1.2, 0.0))[0] - mpmath.log(m) * mpmath.sqrt(m) / dz / 4) < 1e-14


@pytest.mark.parametrize("strength", [0.5, 8, 128])
def test_penumbra_by_sampling(strength: float) -> None:
    """The closed-form minimum against the least of 20,000 samples on the way to the light."""
    random = np.random.default_rng(1)
    points = np.column_stack([random.uniform(-2, 2, 300), np.zeros(300), random.uniform(-2, 2, 300)])
    known = c16.ideal(points, strength)
    to_light = np.array(c16.LIGHT) - points
    reach = np.linalg.norm(to_light, axis=1)
    least = np.full(300, np.inf)
    whole = c16.room(strength, "soft")
    for share in np.geomspace(1e-3 / reach.min(), 1, 20000):
        t = np.maximum(share * reach, 1e-3)
        p = points + (t / reach)[:, None] * to_light
        ball = np.linalg.norm(p - c16.CENTRE, axis=1) - c16.RADIUS
        least = np.minimum(least, strength * np.minimum(ball, p[:, 1]) / t)
    assert np.abs(np.clip(least, 0, 1) - known).max() < 2e-3
    assert known.min() < 0.01 and np.ptp(known) > 0.2
    assert whole["light"]["position"] == c16.LIGHT


@pytest.mark.parametrize("strength", c16.CASE.strengths)
def test_a_picture_without_its_penumbra_fails(strength: float) -> None:
    """The shadow's own steps from pixel to pixel, in closed form, are above the limit at every strength: what
    is lit evenly leaves all of them out."""
    seen, known = c16.truth(strength)
    pairs = seen[:, 1:] & seen[:, :-1]
    assert c16.CASE.failed(float(np.abs(np.diff(known, axis=1))[pairs].max()))
    even = SimpleNamespace(render=lambda scene, size: {"R": np.full(size[::-1], 0.3, np.float32)})
    assert c16.CASE.failed(c16.run(even, strength).error)


def test_torus_rim_by_distance() -> None:
    """Whether a ray meets the torus: the least of its distance along the ray, refined, in 60 digits."""
    for k, side in itertools.product((4, 19, 28), (-1, 1)):
        x = c17.MAJOR - c17.MINOR + side * 2.0**-k
        origin, directions = rays(c17.above(x), c17.SIZE)
        for row in range(c17.SIZE[1]):
            o, d = ([mpf(float(c)) for c in v] for v in (origin, directions[row, 0]))

            def distance(t: mpf, o=o, d=d) -> mpf:
                p = [a + t * b for a, b in zip(o, d, strict=True)]
                return mpmath.hypot(mpmath.hypot(p[0], p[2]) - c17.MAJOR, p[1]) - c17.MINOR

            low, high = mpf(2), mpf(4)  # one minimum, at the rim
            for _ in range(220):
                a, b = low + (high - low) / 3, high - (high - low) / 3
                low, high = (low, b) if distance(a) < distance(b) else (a, high)
            known = c17.truth(x)[row, 0]
            assert np.isfinite(known) == bool(distance(low) < 0), (k, side, row)
            if np.isfinite(known):
                assert abs(distance(mpf(float(known)))) < 1e-13


def test_mirrors_by_recursion() -> None:
    """The colour between the mirrors for the middle ray, which goes to and fro on one line: by hand."""
    whole = c18.between(3)
    known = c18.series(whole)[c18.SIZE[1] // 2, c18.SIZE[0] // 2]
    color, total = np.array(c18.MATERIALS["mirror"]["color"]), np.zeros(3)
    light = np.array(whole["light"]["position"])
    for bounce in range(4):
        wall = 2.0 if bounce % 2 == 0 else -2.0
        to_light = light - [0, 0, wall]
        distance = np.linalg.norm(to_light)
        facing = abs(to_light[2]) / distance  # mirrored at the wall and seen along z: the same cosine
        total += 0.1**bounce * (
            0.01 * color + 5 * color * facing / distance + 0.2 * 5 * facing**15 / distance
        )
    assert np.abs(known - total).max() < 1e-12


def test_how_deep_inside() -> None:
    """The depth at the camera by geometry; where the nearest surface is behind, the line meets it there."""
    for whole, depth in c18.enclosed(3):
        origin, directions = rays(whole, (1, 1))
        assert geometry.scene_distance(origin[None], whole) == -depth
        if whole["shapes"][0]["type"] == "sphere":
            there = geometry.scene_distance(on_ray(origin, directions, np.array([[-depth]])), whole)
            assert abs(there[0]) < 1e-15 and depth == 0.5


class Moved(Phase):
    """baseline with Z of one pixel of the picture of that number moved."""

    def render(self, *arguments, **keys):
        picture = super().render(*arguments, **keys)
        if self.renders == self.number + 1:
            picture["Z"][-1, 0] += self.by
        return picture


@pytest.mark.parametrize(
    "number, by", [(1, 0), (2, 3e-6), (3, -3e-6), (4, 3e-6), (3, math.nan), (4, math.inf)]
)
def test_depths_from_inside_are_judged(number: int, by: float) -> None:
    """Three hit distances off in one pixel, inside the box, the ball or on the mirror, are a failure."""
    phase = Moved("baseline")
    phase.number, phase.by = number, by
    outcome = c18.run(phase, 0)
    assert phase.renders == 5
    assert c18.CASE.failed(outcome.error) == bool(by)
    if math.isfinite(by) and by:
        assert outcome.error == pytest.approx(3, rel=0.1)


REFUSED = [
    ({"camera": {"look_at": [0, 0, 0]}}, "look_at"),
    ({"camera": {"up": [0, 0, 0]}}, "up"),
    ({"camera": {"up": [0, 1e-7, 1]}}, "up"),
    ({"fog": -1e-320}, "fog"),
    ({"background": [1e10, 0, 0]}, "beyond"),
    ({"light": {"shadow_strength": 1e-10}}, "shadow_strength"),
]


@pytest.mark.parametrize("changes, said", REFUSED)
def test_loader_refuses(changes: dict, said: str) -> None:
    """What case 19 says is refused: one line that names the key."""
    whole = c19.with_tiny(0)
    for key, value in changes.items():
        whole[key] = whole[key] | value if isinstance(value, dict) else value
    with pytest.raises(StudyError, match=said):
        Phase("baseline").render(whole, (4, 4))


@pytest.mark.parametrize("number", ["NaN", "Infinity", "1e999", "1e-10"])
def test_loader_refuses_numbers(number: str, tmp_path: Path) -> None:
    """Not a number, infinite, overflowing and too small a radius; none leaves a picture behind."""
    text = json.dumps(c19.with_tiny(0)).replace('"radius": 1,', f'"radius": {number},')
    assert f'"radius": {number},' in text
    scene, out = tmp_path / "scene.json", tmp_path / "out.exr"
    scene.write_text(text)
    done = Phase("baseline").execute([Phase("baseline").program(), scene, "-n", "4", "-o", out])
    assert done.returncode == 2 and done.stderr.count(b"\n") == 1 and not out.exists()


def test_tiny_numbers_change_nothing() -> None:
    """The additions of case 19 move no camera ray and are denormal at the last strength."""
    plain, tiny = c19.with_tiny(-math.inf), c19.with_tiny(-320)
    assert 0 <= tiny["fog"] < 2.3e-308 and tiny["shapes"][1]["position"][2] == 5
    for a, b in zip(rays(plain, (5, 3)), rays(tiny, (5, 3)), strict=True):
        assert np.abs(a - b).max() < 1e-15


def test_reciprocal_roots_of_this_cpu() -> None:
    """The manual's special values and bound; the three tables; the hash is one of 64 bits."""
    found = c20.table()
    assert isinstance(found, dict), found
    assert found["vendor"] in ("GenuineIntel", "AuthenticAMD") or len(found["vendor"]) == 12
    for name, bound in {"rsqrtss": 1.5 * 2**-12, "rsqrtps": 1.5 * 2**-12, "rsqrt14": 2**-14}.items():
        if (table := found[name]) is None:
            assert name == "rsqrt14" and "avx512f" not in Path("/proc/cpuinfo").read_text()
            continue
        assert (table["0"], table["-0"], table["inf"]) == ("inf", "-inf", 0)
        assert table["-1"] == table["nan"] == "nan" and table["worst_relative_error"] <= bound
        assert len(table["hash"]) == 16 and int(table["hash"], 16)
        assert table["smallest normal"] == pytest.approx(2.0**63, rel=bound)
    assert found["rsqrtss"]["hash"] == found["rsqrtps"]["hash"]
    # rsqrtps takes denormals for zero; rsqrt14 does not
    assert found["rsqrtps"]["smallest denormal"] == found["rsqrtps"]["largest denormal"] == "inf"
    if found["rsqrt14"]:
        assert found["rsqrt14"]["smallest denormal"] == pytest.approx(2.0**74.5, rel=2**-14)


def test_centres_by_geometry() -> None:
    for kind, sizes in c20.SHAPES.items():
        for k in (20, 40) if kind == "mandelbulb" else (2, 10, 40):
            points, known = c20.at_centre(kind, 2.0**-k)
            assert np.abs(geometry.shape_distance(points, {"type": kind, **sizes}) - known).max() < 1e-15
    points, known = c20.at_centre("sphere", 2.0**-1100)
    assert (points == 0).all() and (known == -1).all()


def test_twins_are_inside() -> None:
    """The inner of the twins is inside by 2^−k of its size, at any point of its surface."""
    whole = c21.twins(8)
    random = np.random.default_rng(2)
    p = random.uniform(-2, 2, (2000, 3))
    for inner, outer in ((0, 1), (2, 3)):
        a, b = (geometry.shape_distance(p, whole["shapes"][i]) for i in (inner, outer))
        assert (a - b >= 0.5 * 2.0**-8 * 0.5).all() and (a - b <= 2.0**-8 * 2).all()
    same = c21.twins(60)["shapes"]
    for inner, outer in ((0, 1), (2, 3)):
        a, b = (geometry.shape_distance(p, same[i]) for i in (inner, outer))
        assert np.abs(a - b).max() < 1e-14


def test_builds_differ() -> None:
    """The other builds of cases 19 and 21 are other builds: their flags are in the programs' records."""
    phase = Phase("baseline")
    flags = {}
    for title, built in {
        "ftz": builds.flushing(phase),
        "fast": builds.fast_math(phase),
        "fma": builds.contracted(phase),
    }.items():
        program = built.program(built.renderer)
        flags[title] = (registry.ROOT / built.folder / built.name / "phase_info.h").read_text()
        loads = subprocess.run(["nm", program], capture_output=True, text=True, check=True).stdout
        assert ("set_fast_math" in loads) == (title != "fma"), f"{title}: start-up code"
    assert "-ffast-math" in flags["fast"] and "-ffp-contract=fast" in flags["fma"]
    assert "-ffast-math" not in flags["ftz"]
