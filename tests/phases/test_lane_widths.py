"""opt6_wide: one picture, whatever the lanes, the threads and the packets; its parent's within a few ulp."""

from __future__ import annotations

import json

import numpy as np
import pytest
from phase_pictures import check_bits, needs, picture, render
from programs import WORD, needs_sixteen, sixteen

from study.core import registry
from study.core.build import build

PHASE, PARENT = "opt6_wide", "opt5_threads"
NAMES = ["everything", "shapes_64_turned", "camera_within_a_shape", "nothing_to_see", "mirrors_facing_6"]
WIDEST = registry.cpu_flags() >= {"avx512f", "avx512dq"}
# Part of a block, of a tile, of nothing; smaller where 16 lanes are emulated, a hundred times as slow.
SIZES = [(61, 33), (1, 1), (5, 300), (257, 3)] if WIDEST else [(37, 17), (1, 1), (5, 75), (133, 3)]

pytestmark = needs(PHASE)
EIGHT = {"STEPWISE_ISA_LIMIT": "avx2"}


def test_the_record_says_which_lanes_ran(tmp_path) -> None:
    for limit, lanes in [("avx2", 8), ("", 16 if WIDEST else 8)]:
        done = render(PHASE, "trio", tmp_path, STEPWISE_ISA_LIMIT=limit)
        record = json.loads(done.stdout)
        assert record["lanes"] == lanes
        assert ("avx512f" in record["isa"]) == (lanes == 16)
        assert ("-mavx512f" in record["flags"]) == (lanes == 16)


@needs_sixteen
@pytest.mark.parametrize("name", [pytest.param(i, id=f"{i}, {WORD}") for i in (*registry.scenes(), *NAMES)])
def test_sixteen_lanes_draw_what_eight_draw(name, tmp_path) -> None:
    for size in SIZES:
        eight = picture(PHASE, name, tmp_path, size=size, **EIGHT)
        check_bits(picture(sixteen(PHASE), name, tmp_path, size=size), eight, (WORD, name, size))


@needs_sixteen
@pytest.mark.parametrize("steps", [1, 7, 40])
def test_the_step_cap_is_each_rays_own(steps, tmp_path) -> None:
    """Rays that march on from a hit count on, whatever their neighbours had."""
    for name in ("cubes", "mandelbulb"):
        capped = (name, tmp_path, "--max-steps", steps)
        wide = picture(sixteen(PHASE), *capped, size=(61, 33))
        check_bits(wide, picture(PHASE, *capped, size=(61, 33), **EIGHT), (WORD, name, steps))
        assert np.nanmax(wide["evals"]) == steps


@pytest.mark.slow
@pytest.mark.parametrize("limit", ["", "avx2"])
@pytest.mark.parametrize(
    "name", ["scene0", "trio", "mandelbulb", "spheres40", "everything", "shapes_64_turned"]
)
def test_a_sleeping_shape_changes_not_one_bit(name, limit, tmp_path) -> None:
    """Against the same source with every shape evaluated at every step."""
    mine, every = (
        picture(program, name, tmp_path, STEPWISE_ISA_LIMIT=limit)
        for program in (PHASE, build(f"{PHASE}+awake"))
    )
    check_bits(mine, every, name)


@pytest.mark.parametrize("name", ["scene0", "scene0_plain", "trio", "cubes", "spheres40", "two_spheres"])
def test_it_draws_its_parents_picture(name, tmp_path) -> None:
    """Same hits and evaluations; t and the shadow's terms are rounded in another order."""
    mine, parents = (picture(phase, name, tmp_path, size=(160, 90)) for phase in (PHASE, PARENT))
    for plane in ("id", "evals", "N.x", "N.y", "N.z"):
        assert np.array_equal(mine[plane], parents[plane]), plane
    hit = parents["id"] >= 0
    t, other = mine["Z"][hit].astype(float), parents["Z"][hit].astype(float)
    assert (abs(t - other) <= 2.0**-22 * other).all()
    for plane in "RGB":
        off = abs(mine[plane].astype(float) - parents[plane])
        assert (off <= 2e-6 + 2e-5 * abs(parents[plane])).all(), (plane, off.max())


def test_the_bulbs_estimate_is_above_what_lets_it_sleep() -> None:
    """The bound of shape_distances.h, 0.18 + (r − 3/2)/2 beyond r = 3/2, held against the map in polar form
    (r⁸, 8θ, 8φ), in double, for 1 to 8 iterations."""
    random = np.random.default_rng(6)
    direction = random.normal(size=(20_000, 3))
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    radius = np.concatenate([np.linspace(1.5, 3, 15_000), np.geomspace(3, 32, 5_000)])
    p = direction * radius[:, None]
    bound = np.minimum(radius - 1.5, 0.18 + (radius - 1.5) / 2)
    for iterations in (1, 2, 4, 8):
        w, dz, escaped = p.copy(), np.full(len(p), 1.5), np.zeros(len(p), bool)
        for _ in range(iterations):
            r = np.linalg.norm(w, axis=1)
            theta, phi = np.arccos(np.clip(w[:, 1] / r, -1, 1)), np.arctan2(w[:, 0], w[:, 2])
            turned = [
                np.sin(8 * theta) * f(8 * phi) if f else np.cos(8 * theta) for f in (np.sin, None, np.cos)
            ]
            to = r[:, None] ** 8 * np.stack(turned, 1) + p
            dz = np.where(escaped, dz, 8 * r**7 * dz + 1)
            w = np.where(escaped[:, None], w, to)
            escaped |= (w**2).sum(1) > 256
        m = (w**2).sum(1)
        estimate = 0.25 * np.sqrt(m) / dz * np.log(m)
        assert (estimate > bound * (1 + 2**-10)).all()
