"""opt8_streams: queues, cones and refilled lanes change when a ray is marched, and not what it finds.

The bound that lets shadow rays go unmarched is tried on random scenes by a march written here, in double;
pictures are the parent's, and of any number of threads to the bit.
"""

from __future__ import annotations

import copy
import math

import numpy as np
import pytest
import test_tiles
from test_tiles import WIDTHS, check_same, crowd, picture

from conformance.feature_scenes import FEATURES
from study import registry

PHASE, PARENT = "opt8_streams", "opt7_tiles"
STRENGTH = 3.0

pytestmark = pytest.mark.skipif(
    bool(registry.missing_isa(registry.phases()[PHASE])), reason=f"the CPU lacks what {PHASE} needs"
)


def bound(q: float) -> float:
    """No term of a march with h ≥ q·t is less than strength times this (NOTES.md)."""
    r = (1 + q) / 2
    return min(q, q * math.sqrt(1 - r * r) / (1 - q * r))


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
    random = np.random.default_rng(8)
    tried, nearest = 0, math.inf
    dense = np.geomspace(1e-3, 60, 3000)
    for _ in range(300):
        count = random.integers(1, 5)
        centres = random.uniform((-3, -3, -2), (3, 3, 12), (count, 3))
        radii = random.uniform(0.05, 2.0, count)
        slope = random.uniform(0.05, 0.98) if random.random() < 0.5 else math.inf

        def distance(t, centres=centres, radii=radii, slope=slope):
            to = np.sqrt(centres[:, 0] ** 2 + centres[:, 1] ** 2 + (centres[:, 2] - t) ** 2) - radii
            return min(float(to.min()), slope * t)

        q = min(distance(t) / t for t in dense)
        if q <= 1e-3 or distance(0.0) < 0:
            continue
        tried += 1
        q = min(q, 0.999)
        term = least_term(distance, 1e-3, 60) / STRENGTH
        assert term >= bound(q) * (1 - 1e-3), (q, term)
        nearest = min(nearest, term / bound(q))
    assert tried > 80
    assert nearest < 1.02  # the bound is not idle: a march comes as near as that
    assert bound(0.3457) * STRENGTH == pytest.approx(1, abs=1e-3)  # the slope of scene0's cones


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("shadows", ["hard", "soft"])
def test_cones_and_queues_are_the_parents_picture(shadows, width, tmp_path) -> None:
    """A march in float has noise at its first steps, which what is told without one has not."""
    for seed, count in ((3, 12), (4, 60)):
        scene = crowd(seed, count, shadows)
        mine = picture(PHASE, scene, tmp_path, (160, 90), **WIDTHS[width])
        check_same(mine, picture(PARENT, scene, tmp_path, (160, 90)), f"{count} shapes, {shadows}, {width}")


@pytest.mark.parametrize("width", WIDTHS)
def test_full_queues(width, tmp_path) -> None:
    """Mirrors, and a repeated shape, so that no cone tells anything: four shadow rays of a pixel may wait."""
    scene = crowd(5, 10, "soft")
    for shape in scene["shapes"]:
        shape["material"] = next(s["material"] for s in scene["shapes"][1:] if s["material"] != "plain")
    ball = {"type": "sphere", "radius": 0.3, "repeat": [3, 0, 0], "position": [0, -4, 12]}
    scene["shapes"].append(ball | {"material": "plain"})
    mine = picture(PHASE, scene, tmp_path, (256, 90), **WIDTHS[width])
    check_same(mine, picture(PARENT, scene, tmp_path, (256, 90)), width)


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("name", [name for name, scene in registry.scenes().items() if scene.fractal])
def test_a_mandelbulbs_streams_are_the_parents_packets(name, width, tmp_path) -> None:
    """Lanes that are filled again find what those of a packet find: to the bit, and as many steps."""
    scene = registry.scenes()[name].path
    mine, parents = (picture(phase, scene, tmp_path, (160, 90), **WIDTHS[width]) for phase in (PHASE, PARENT))
    bulb = next(i for i, s in enumerate(registry.scenes()[name].data["shapes"]) if s["type"] == "mandelbulb")
    hit = parents["id"] == bulb
    assert hit.sum() > 500 and np.array_equal(mine["id"], parents["id"])
    for plane in ("Z", "N.x", "N.y", "N.z", "evals"):
        assert np.array_equal(mine[plane][hit], parents[plane][hit]), plane
    for channel in "RGB":
        assert np.abs(mine[channel] - parents[channel]).max() < 1e-5


def test_bulbs_among_other_shapes(tmp_path) -> None:
    """Hard shadows, two Mandelbulbs, one of them repeated, and a mirror: the parent's picture."""
    scene = crowd(6, 6, "hard")
    bulb = {"type": "mandelbulb", "power": 8, "iterations": 3, "bailout": 256, "material": "plain"}
    shapes = [bulb | {"position": [0, 0, 9]}, bulb | {"position": [3, 1, 14], "repeat": [6, 0, 0]}]
    for more in ([shapes[0]], shapes):
        whole = copy.deepcopy(scene) | {"shapes": scene["shapes"] + more}
        mine = picture(PHASE, whole, tmp_path, (96, 54))
        check_same(mine, picture(PARENT, whole, tmp_path, (96, 54)), f"{len(more)} bulbs")


@pytest.mark.parametrize("size", [(1, 1), (7, 3), (33, 9), (1, 70), (197, 41)])
def test_any_size_and_number_of_threads(size, tmp_path) -> None:
    for scene in (FEATURES["everything"], registry.scenes()["mandelbulb"].data):
        alone = picture(PHASE, scene, tmp_path, size)
        for threads in (2, 5):
            mine = picture(PHASE, scene, tmp_path, size, "--threads", threads, "--reps", 2)
            for name, plane in alone.items():
                assert np.array_equal(plane.view(np.uint32), mine[name].view(np.uint32)), f"{threads}: {name}"


def test_no_start_past_the_true_hit(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(test_tiles, "PHASE", PHASE)
    for name in ("trio", "mandelbulb"):
        test_tiles.check_starts(registry.scenes()[name].data, tmp_path, name)
