"""What lets soft shadow rays of opt9_convex go unmarched, or end: bounds on random scenes, and truth."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from opt9_pictures import PHASE, needs_opt9, picture
from soft_shadows import SHARP, SOFT, STRENGTH, bound, clamped, lit

from conformance.feature_scenes import FLOOR, scene, shape
from study.core import registry
from study.pictures import images

pytestmark = needs_opt9


def least_term(distance, start: float, end: float) -> float:
    """The paper's estimator without its clamp to 1: I. Quilez after S. Aaltonen (baseline/march.c)."""
    least, previous, t = math.inf, 1e20, start
    while t < end:
        h = distance(t)
        if h < 1e-9:
            return 0.0
        y = h * h / (2 * previous)
        if h * h - y * y > 0 and t - y > 0:
            least = min(least, STRENGTH * math.sqrt(h * h - y * y) / (t - y))
        previous, t = h, t + h
    return least


def test_no_term_below_the_bound() -> None:
    """Rays along z from the origin; spheres about, and at times a floor through the origin that it leaves."""
    random = np.random.default_rng(9)
    tried, nearest = 0, math.inf
    dense = np.geomspace(1e-3, 60, 6000)
    for _ in range(400):
        count = random.integers(1, 5)
        centres = random.uniform((-3, -3, -2), (3, 3, 12), (count, 3))
        radii = random.uniform(0.05, 2.0, count)
        slope = random.uniform(0.05, 0.98) if random.random() < 0.5 else math.inf

        def all_along(t, centres=centres, radii=radii, slope=slope):
            beside = centres[:, :1] ** 2 + centres[:, 1:2] ** 2
            to = np.sqrt(beside + (centres[:, 2:] - t) ** 2) - radii[:, None]
            return np.minimum(to.min(axis=0), slope * t if slope < math.inf else math.inf)

        def distance(t, along=all_along):
            return float(along(np.array([t]))[0])

        q = float((all_along(dense) / dense).min())
        if q <= 1e-3 or distance(0.0) < 0:
            continue
        tried += 1
        q = min(q, 0.999)
        term = least_term(distance, 1e-3, 60) / STRENGTH
        assert term >= bound(q) * (1 - 1e-3), (q, term)
        nearest = min(nearest, term / bound(q))
    assert tried > 100
    assert nearest < 1.02  # the bound is not idle: a march comes as near as that


@pytest.mark.parametrize("name", SHARP)
def test_shadows_at_edges_are_truths(name: str, tmp_path: Path) -> None:
    mine, exact = (picture(SHARP[name], tmp_path, phase=phase) for phase in (PHASE, "truth"))
    assert np.array_equal(mine["id"], exact["id"])
    assert np.abs(clamped(mine) - clamped(exact)).max() < 1e-4


# With a strength of 1 or less no term is above 1: no cone about a ray clears it.
ONE_BELOW = [
    shape("sphere", radius=3, position=[0, 0, 20]),
    shape("box", half_size=[1, 1, 1], position=[0, -6, 20]),
]

DOWN = {"position": [0, 0, 0], "look_at": [0, 0, 1], "vertical_fov_degrees": 30}
WIDTHS = ("opt8_streams", PHASE, "opt10_scene")


@pytest.mark.slow
@pytest.mark.parametrize("phase", WIDTHS)
@pytest.mark.parametrize("strength", [1e-9, 0.3, 1, 1.00001, 1.001])
def test_weak_shadows_are_truths(strength: float, phase: str, tmp_path: Path) -> None:
    """Told lit where nothing is ahead, 114 of 1,296 pixels of the two solids were off by up to 0.5."""
    light = {"shadows": "soft", "shadow_strength": strength, "position": [0, 100, 0], "emission": [200] * 3}
    scene0 = json.loads(registry.scenes()["scene0"].path.read_text())
    scene0["light"]["shadow_strength"] = strength
    for whole in (scene(ONE_BELOW, light=light, camera=DOWN), scene0):
        mine, exact = (picture(whole, tmp_path, phase=each) for each in (phase, "truth"))
        same = mine["id"] == exact["id"]
        assert np.count_nonzero(~same) <= 2
        assert np.abs(images.rgb(mine) - images.rgb(exact))[same].max() < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("phase", WIDTHS)
@pytest.mark.parametrize("height", [4, 60])
def test_a_ray_along_the_normal_says_nothing(height: float, phase: str, tmp_path: Path) -> None:
    """Its second term is 0/0: pixels below a light were NaN, or as dark as a shadow."""
    light = {"shadows": "soft", "shadow_strength": 0.9, "position": [0, height, 0], "emission": [20] * 3}
    below = {"position": [0, -1.9, 0], "look_at": [0, -2, 0], "up": [0, 0, 1], "vertical_fov_degrees": 2}
    whole = scene([shape("plane", normal=[0, 1, 0], offset=-2)], light=light, camera=below)
    mine, marched = (picture(whole, tmp_path, phase=each) for each in (phase, "opt6_wide"))
    assert np.abs(images.rgb(mine) - images.rgb(marched)).max() < 1e-4


@pytest.mark.slow
@pytest.mark.parametrize("phase", WIDTHS)
@pytest.mark.parametrize("count", [3, 48])
def test_what_is_outside_of_the_bounds_casts_no_shadow(count: int, phase: str, tmp_path: Path) -> None:
    """From a plane steps are leapt over up to where something else is near, no further than to the bounds.
    Pixels were as dark as if the spheres outside of them were inside.
    """
    beyond = [
        shape("sphere", radius=0.5, position=[12 + 0.2 * i, 3 + 0.9 * (i % 4), (i % 7 - 3) * 1.3])
        for i in range(count)
    ]
    light = {"shadows": "soft", "shadow_strength": 2, "position": [60, 16, 0], "emission": [90, 90, 90]}
    camera = {"position": [-3, 3, -4], "look_at": [1, 0, 0], "vertical_fov_degrees": 50}
    floor = shape("plane", normal=[0, 1, 0], offset=0)
    size = "-n", "27", "-w", "48"
    bright = []
    for bounds in (6, 100):
        whole = scene([floor, *beyond], light=light, camera=camera, march={"bounds_radius": bounds})
        mine, exact = (picture(whole, tmp_path, *size, phase=each) for each in (phase, "truth"))
        here = exact["id"] == 0
        assert here.sum() > 200
        assert np.abs(images.rgb(mine) - images.rgb(exact))[here].max() < 2e-3
        bright.append(exact["G"][here].mean())
    assert bright[0] > 1.01 * bright[1]


# What is told by a plane between ray and solid, and rays that end once they are past the one solid in their
# way, as they may not where there are two, or a torus, which a ray can pass twice. BRIGHT: a pixel's light.
BRIGHT = 2.5
ROW = range(-2, 3)
IN_THE_WAY = {
    "slim and flat solids": scene(
        [
            FLOOR,
            shape("box", half_size=[0.05, 1.2, 0.05], rotation_degrees=[0, 0, 60], position=[-1.6, 0.2, 0]),
            shape("cone", bottom_radius=0.05, top_radius=0.7, half_height=1, position=[0, 0.1, 1.5]),
            shape("octahedron", radius=0.9, position=[0.2, 0.2, -0.9]),
            shape("torus", major_radius=0.8, minor_radius=0.1, position=[1.9, 0, 0.3]),
        ],
        light=lit("soft", [0.4, 7, 0.2]),
    ),
    "one above the other": scene(
        [
            FLOOR,
            shape("sphere", radius=0.35, position=[-1.3, -0.8, 0]),
            shape("box", half_size=[0.5, 0.05, 0.6], position=[-1.1, 0.5, 0.2]),
            shape("sphere", radius=0.9, position=[0.6, 1.6, 0.5]),
            shape("octahedron", radius=0.5, position=[0.6, -0.7, -0.2]),
            shape(
                "torus",
                major_radius=0.7,
                minor_radius=0.2,
                rotation_degrees=[70, 0, 0],
                position=[1.9, -0.4, 0],
            ),
        ],
        light=lit("soft", [0.4, 7, 0.2]),
    ),
    # Past the near side of its ring, and through the other.
    "a ring that is passed twice": scene(
        [FLOOR, shape("torus", minor_radius=0.15, rotation_degrees=[90, 0, 0])],
        light=lit("soft", [7, 3.5, 0]),
    ),
    # A march goes on past the light, where a group's rays part: by the middle one alone, 72 pixels were off.
    "solids behind the light": scene(
        [FLOOR, *(shape("sphere", radius=2.8, position=[8 * x, 71, 8 * z]) for x in ROW for z in ROW)],
        light=lit("soft", [0.3, 3.7, 0]),
        camera={"position": [0, 3.6, -4.5], "look_at": [0, -1.5, -1.3]},
    ),
    # Rays through its position: what is left of the way beside it is rounding, and 744 pixels were lit.
    "a light in the middle of a solid": scene(
        [
            FLOOR,
            shape("octahedron", radius=0.25, position=[0.4, 1.7, 0.2]),
            shape("box", half_size=[0.5, 0.4, 0.5], position=[-1.3, -0.6, 0]),
        ],
        light=lit("soft", [0.4, 1.7, 0.2]),
    ),
    # A march begins behind these, or in them; told dark by where their rays enter, 29 pixels were.
    "solids before the first step": scene(
        [
            FLOOR,
            shape("sphere", radius=0.4, position=[-1, -0.4, 0]),
            shape("box", half_size=[0.3, 0.05, 0.3], position=[1, -0.7, 0]),
            shape("torus", major_radius=0.4, minor_radius=0.1, position=[0, -0.2, 1.5]),
        ],
        light=lit("soft", [2, 5, -2]),
        march={"surface_offset": 1},
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", IN_THE_WAY)
def test_what_is_not_marched_to_its_end_is_truths(name: str, tmp_path: Path) -> None:
    """Darker than 1e-4 is 0 (PROOFS.md, 4.): all else is as exact as float."""
    exact = picture(IN_THE_WAY[name], tmp_path, phase="truth")
    assert (clamped(exact).max(axis=-1) < 0.9).mean() > 0.2  # penumbras and shadows to be wrong in
    for phase in (PHASE, "opt10_scene"):
        mine = picture(IN_THE_WAY[name], tmp_path, phase=phase)
        assert np.array_equal(mine["id"], exact["id"]), phase
        off = np.abs(clamped(mine) - clamped(exact)).max(axis=-1)
        assert off.max() < 1.2e-4 * BRIGHT, phase
        assert np.quantile(off, 0.99) < 2e-5, phase


def test_a_ratio_that_has_risen_does_not_come_back() -> None:
    """The end of a march past one convex solid (PROOFS.md, 6.): no later term is less.

    A random box, seen by rays along z from a floor whose normal is near them; others are kept out of the cone
    in which a term can come below 1.
    """
    random = np.random.default_rng(10)
    cone = next(q for q in np.linspace(0.3, 0.4, 10001) if STRENGTH * bound(q) >= 1)
    ended, saved = 0, 0
    for _ in range(3000):
        centre, half = random.uniform((-1.5, -1.5, 0.5), (1.5, 1.5, 4)), random.uniform(0.05, 1, 3)
        turn, _ = np.linalg.qr(random.normal(size=(3, 3)))
        slope, other = random.uniform(cone, 1), random.uniform(cone, 3)

        def distance(t, centre=centre, half=half, turn=turn, slope=slope, other=other):
            out = np.abs(turn @ (np.array([0, 0, t]) - centre)) - half
            box = np.linalg.norm(np.maximum(out, 0)) + min(out.max(), 0)
            return min(box, slope * t, other * t + 0.3)

        t, before, previous, least, end = 1e-3, 0.0, 1e20, 1.0, math.inf
        while t < 40 and (h := distance(t)) > 1e-6:
            y = h * h / (2 * previous)
            if h * h - y * y > 0 and t - y > 0:
                term = STRENGTH * math.sqrt(h * h - y * y) / (t - y)
                assert t <= end or term >= least * (1 - 1e-6), (centre, half, turn)
                saved += t > end
                least = min(least, term)
            risen = before > 0 and previous < cone * before and h / t >= previous / before
            if risen and math.isinf(end) and STRENGTH * math.sqrt(0.75) * h / t > least:
                end, ended = t, ended + 1
            before, previous, t = t, h, t + h
        assert end == math.inf or t > 40 or h > 1e-6  # it is not met either
    assert ended > 300 and saved > 1000


@pytest.mark.parametrize("steps", ["1", "3", "40", "300"])
def test_few_steps_are_each_taken(steps: str, tmp_path: Path) -> None:
    """A cap that ends a shadow's march shapes its value: truth marches it in double-double under the same."""
    whole = scene([FLOOR, shape("sphere", radius=1), shape("box", position=[1.8, -0.9, 0.7])], light=SOFT)
    mine, exact = (picture(whole, tmp_path, "--max-steps", steps, phase=phase) for phase in (PHASE, "truth"))
    off = np.abs(clamped(mine) - clamped(exact)).max(axis=-1)
    assert np.quantile(off, 0.999) < 1e-4 and (off > 1 / 255).sum() <= 1
