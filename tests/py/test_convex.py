"""opt9_convex: the bound that lets shadow rays go unmarched; pictures that do not hang on lanes or threads.

The bound is tried on random scenes by a march written here, in double; the pictures are compared to the bit.
"""

from __future__ import annotations

import math
import os
import subprocess
from pathlib import Path

import numpy as np
import pytest

from study import images, registry
from study.build import build

PHASE = "opt9_convex"
STRENGTH = 3.0

pytestmark = pytest.mark.skipif(
    bool(registry.missing_isa(registry.phases()[PHASE])), reason=f"the CPU lacks what {PHASE} needs"
)


def bound(q: float) -> float:
    """No term of a march with h ≥ q·t is less than strength times this (NOTES.md, 1)."""
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
    random = np.random.default_rng(9)
    tried, nearest = 0, math.inf
    dense = np.geomspace(1e-3, 60, 6000)
    for _ in range(400):
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
    assert tried > 100
    assert nearest < 1.02  # the bound is not idle: a march comes as near as that


def picture(scene: str, folder: Path, *options: str, lanes: str | None = None) -> dict[str, np.ndarray]:
    path = folder / f"{scene}-{lanes}-{len(options)}.exr"
    environment = os.environ | ({"STEPWISE_ISA_LIMIT": lanes} if lanes else {})
    command = [
        build(PHASE),
        registry.scenes()[scene].path,
        "-n",
        "61",
        "-w",
        "107",
        "--aov",
        "-o",
        path,
        *options,
    ]
    subprocess.run(list(map(str, command)), check=True, env=environment, capture_output=True, timeout=60)
    return images.read(path)


@pytest.mark.parametrize("scene", ["scene0", "trio", "spheres40", "two_spheres"])
def test_lanes_and_threads_change_nothing(scene: str, tmp_path: Path) -> None:
    base = picture(scene, tmp_path)
    for other in (picture(scene, tmp_path, "--threads", "2"), picture(scene, tmp_path, lanes="avx2")):
        for name, values in base.items():
            assert np.array_equal(values, other[name], equal_nan=True), name
