"""opt7_tiles: no cone starts past a true hit, no list lacks what matters, the Mandelbulb stays in its ball.

A start is the phase's own plane `start` (−1: the whole cone misses); the true hit is truth's. What the
lists must not change is the parent's picture.
"""

from __future__ import annotations

import copy
import json
import re
import subprocess

import numpy as np
import pytest
from phase_pictures import needs
from tile_pictures import (
    EACH_WIDTH,
    SMALL,
    WIDTHS,
    check_bits,
    check_same,
    check_starts,
    crowd,
    flat_scenes,
    picture,
)

from conformance.feature_scenes import FEATURES, SIZES
from study.core import registry
from study.core.build import build

PHASE, PARENT = "opt7_tiles", "opt6_wide"

pytestmark = needs(PHASE)


def views(scene: dict) -> dict[str, dict]:
    """The scene's own view, and others: from the side, from above and rolled, nearer and narrower; and two
    with cones as narrow as a picture's of 720 rows (but no view below 1 degree, the least of a scene).
    """
    camera = scene["camera"]
    place, at = np.array(camera["position"], float), np.array(camera["look_at"], float)
    ahead = (at - place) / np.linalg.norm(at - place)
    side = np.cross(camera["up"], ahead)
    fov = camera["vertical_fov_degrees"]
    changed = {
        "own": {},
        "side": {"position": place + 2 * side - 0.5 * ahead, "look_at": at + 0.7 * side + 3 * ahead},
        "above": {
            "position": place + np.array([0.3, 1.1, 0]) - ahead,
            "look_at": at + 4 * ahead,
            "up": [0.5, 0.8, 0.1],
            "vertical_fov_degrees": min(1.7 * fov, 100),
        },
        "near": {"position": place + 0.4 * ahead + 0.05 * side, "vertical_fov_degrees": 0.35 * fov},
    }
    whole = np.tan(np.radians(fov / 2))
    narrow = 2 * np.degrees(np.arctan(whole * SMALL[1] / 720))
    piece = {"vertical_fov_degrees": max(narrow, 1)}
    up = np.array(camera["up"], float) - np.dot(camera["up"], ahead) * ahead
    for right, above in ((0.45, -0.3), (-0.2, 0.15)):
        off = whole * (right * np.cross(up, ahead) + above * up) / np.linalg.norm(up)
        changed[f"piece at {right}, {above}"] = piece | {"look_at": place + ahead + off}
    found = {}
    for name, change in changed.items():
        found[name] = copy.deepcopy(scene)
        found[name]["camera"] |= {key: np.asarray(value).tolist() for key, value in change.items()}
    return found


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(registry.scenes()))
def test_no_start_past_the_true_hit(name, tmp_path) -> None:
    late = {}
    scene = registry.scenes()[name]
    for view, seen in views(scene.data).items():
        if scene.fractal and view in ("side", "near"):  # whose truth takes most of the time
            continue
        late[view] = check_starts(PHASE, seen, tmp_path, f"{name} from {view}")
    if not scene.fractal:  # rays that may meet a fractal take all of their steps
        assert late["own"][0] > 0.5, f"{name}: hardly a cone has started beyond the camera"
        pieces = [hits for view, (_, hits) in late.items() if view.startswith("piece")]
        assert max(pieces) > 0.1, f"{name}: the narrow views see next to nothing"


@pytest.mark.parametrize("width", EACH_WIDTH)
@pytest.mark.parametrize("name", [name for name, scene in registry.scenes().items() if scene.fractal])
def test_a_fractal_is_the_parents(name, width, tmp_path) -> None:
    """What a march by its estimate finds hangs on every step: the same hits and normals, to the bit."""
    scene = registry.scenes()[name]
    shapes = scene.data["shapes"]
    fractal = next(i for i, shape in enumerate(shapes) if shape["type"] in registry.FRACTALS)
    mine, parents = (
        picture(phase, scene.path, tmp_path, (96, 54), **WIDTHS[width]) for phase in (PHASE, PARENT)
    )
    hit = parents["id"] == fractal
    assert hit.sum() > 200 and np.array_equal(mine["id"] == fractal, hit)
    for plane in ("Z", "N.x", "N.y", "N.z", "evals"):
        assert np.array_equal(mine[plane][hit], parents[plane][hit]), plane


@pytest.mark.slow
def test_no_start_past_the_true_hit_of_any_feature(tmp_path) -> None:
    for name in FEATURES:  # by their names: conformance has drawn truth's pictures of them
        check_starts(PHASE, name, tmp_path, name)


@pytest.mark.parametrize("width", EACH_WIDTH)
@pytest.mark.parametrize("name", ["balls", "slanted"])
def test_what_falls_alone_meets_no_ball(name, width, tmp_path) -> None:
    """Rays that go on to the floor without a question after the balls would pass through them."""
    scene = flat_scenes()[name]
    mine, parents = (
        picture(phase, scene, tmp_path, (214, 120), **WIDTHS[width]) for phase in (PHASE, PARENT)
    )
    assert len(np.unique(parents["id"])) == 5
    check_same(mine, parents, f"{name}, {width}")


@pytest.mark.parametrize("width", EACH_WIDTH)
def test_what_falls_alone_takes_the_parents_steps(width, tmp_path) -> None:
    """Where a Mandelbulb may be met, rays begin at the camera, with all shapes: the same bits."""
    scene = flat_scenes()["balls"]
    bulb = {"type": "mandelbulb", "power": 8, "iterations": 4, "bailout": 256, "material": "plain"}
    scene["shapes"] += [bulb | {"position": [x, 0, 5]} for x in (-2.2, 1.8)]
    mine, parents = (
        picture(phase, scene, tmp_path, (214, 120), **WIDTHS[width]) for phase in (PHASE, PARENT)
    )
    here = (mine["start"] == 0) & (mine["shapes"] == len(scene["shapes"]))
    assert (here & (parents["id"] == 0)).sum() > 500
    check_bits(mine, parents, here)


@pytest.mark.parametrize("phase", ["opt6_wide", "opt7_tiles", "opt8_streams", "rods_simd"])
def test_shadow_rays_that_start_far_away(phase, tmp_path) -> None:
    """The squared term of a shadow ray's first step: past² is beyond a float, its quotient is not."""
    scene = flat_scenes()["floor"]
    # Repeated, so that no cone of opt8_streams tells anything; below the floor.
    below = {"type": "sphere", "radius": 1, "repeat": [0, 0, 100], "position": [0, -50, 0]}
    scene["shapes"].append(below | {"material": "plain"})
    scene["light"] |= {"position": [1000, 100, 0], "emission": [5000, 5000, 4000], "shadows": "soft"}
    scene["march"] |= {"surface_offset": 2e5, "bounds_radius": 1e6}
    scene["camera"]["look_at"] = [0, -1, 1]
    mine, base = (picture(name, scene, tmp_path) for name in (phase, "baseline"))
    here = (mine["id"] == 0) & (base["id"] == 0)
    assert here.sum() > 500 and np.median(base["R"][here]) > 0.05  # ambient alone: 0.006
    assert np.allclose(mine["R"][here], base["R"][here], rtol=1e-4, atol=0)


@pytest.mark.parametrize("width", EACH_WIDTH)
@pytest.mark.parametrize("shadows", ["none", "hard", "soft"])
def test_lists_leave_out_nothing_that_matters(shadows, width, tmp_path) -> None:
    for seed, count in ((1, 12), (2, 60)):
        scene = crowd(seed, count, shadows)
        mine = picture(PHASE, scene, tmp_path, (160, 90), **WIDTHS[width])
        parents = picture(PARENT, scene, tmp_path, (160, 90))
        check_same(mine, parents, f"{count} shapes, {shadows} shadows, {width}")
        offered = mine["shapes"][mine["start"] >= 0]
        assert 0 < offered.mean() < 0.5 * (count + 1), "the lists hold half of the scene and more"


def test_a_capped_march_finds_more_of_the_true_hits(tmp_path) -> None:
    """two_spheres allows 20 steps: those before the start are saved."""
    scene = registry.scenes()["two_spheres"].data
    true = picture("truth", scene, tmp_path, (64, 64))["id"] >= 0
    mine, parents = (picture(phase, scene, tmp_path, (64, 64))["id"] >= 0 for phase in (PHASE, PARENT))
    assert not (mine & ~true).any() and not (parents & ~mine).any()
    assert (true & ~mine).sum() < (true & ~parents).sum()


def test_what_cannot_be_trusted_starts_at_the_camera(tmp_path) -> None:
    """A cone repeated along its axis, or a group with one, jumps at its cells' walls; a Mandelbox's
    estimate is no bound; a camera within a shape, or out of bounds."""
    whole = FEATURES["everything"]
    cone = {"type": "cone", **SIZES["cone"], "repeat": [0, 4, 0], "material": "plain", "position": [0, 0, 6]}
    ball = {"type": "sphere", "radius": 2, "material": "plain", "position": [0, 0, 0]}
    group = {"type": "group", "operation": "union", "shapes": [cone], "position": [0, 0, 1]}
    box = {"type": "mandelbox", **SIZES["mandelbox"], "material": "plain", "position": [0, 0, 9]}
    camera = whole["camera"] | {"position": [0, 0.3, 0], "look_at": [0, 0, 6], "up": [0, 1, 0]}
    ahead = ball | {"position": [0, 0, 6]}
    outside = camera | {"position": [0, 0.3, -101]}
    for shapes, view, count in (
        ([cone, ahead], camera, None),
        ([group, ahead], camera, None),
        ([box, ahead], camera, 2),
        ([ball, ahead], camera, 2),
        ([ahead], outside, 1),
    ):
        scene = whole | {"shapes": shapes, "camera": view}
        mine = picture(PHASE, scene, tmp_path)
        assert (mine["start"] == 0).all()
        assert (mine["shapes"] >= 1).all() and (count is None or (mine["shapes"] == count).all())


def constant(phase: str, file: str, pattern: str) -> float:
    found = re.search(pattern, registry.find_phase(phase).file(file).read_text())
    assert found, f"{file} of {phase} has no {pattern}"
    return float(found[1])


UPDATE, BOUNDS = "core/prepare_bounds.h", "cones/distance_bounds.h"
RADIUS, TANGENT = r"#define BALL_RADIUS ([\d.]+)f", r"#define FAR_TANGENT ([\d.]+)f"


def test_the_mandelbulbs_bounds_are_the_same_in_opt8() -> None:
    for file, pattern in ((UPDATE, RADIUS), (BOUNDS, TANGENT)):
        assert constant(PHASE, file, pattern) == constant("opt8_streams", file, pattern)


@pytest.mark.parametrize("iterations", [1, 2, 4, 20])
@pytest.mark.parametrize("bailout", [4, 256, 10000])
def test_the_mandelbulbs_bounds_hold(iterations, bailout, tmp_path) -> None:
    """Outside of its ball the estimate is positive and above both lines that stand for it in a list."""
    radius, tangent = constant(PHASE, UPDATE, RADIUS), constant(PHASE, BOUNDS, TANGENT)
    bulb = {"type": "mandelbulb", "power": 8, "iterations": iterations, "bailout": bailout}
    scene = FEATURES["everything"] | {"shapes": [bulb | {"material": "plain"}]}
    (tmp_path / "bulb.json").write_text(json.dumps(scene))
    random = np.random.default_rng(iterations + bailout)
    away = random.normal(size=(100_000, 3))
    away /= np.linalg.norm(away, axis=1, keepdims=True)
    away[:2000] = np.round(away[:2000])  # axes and diagonals
    away[:2000] /= np.maximum(np.linalg.norm(away[:2000], axis=1, keepdims=True), 1e-9)
    beyond = np.exp(random.uniform(np.log(1e-4), np.log(100), len(away)))[:, None]
    points = away * (radius + beyond)
    done = subprocess.run(
        [build(PARENT, "probe"), tmp_path / "bulb.json"], input=points.tobytes(), capture_output=True
    )
    assert done.returncode == 0
    estimate = np.frombuffer(done.stdout).reshape(-1, 2)[:, 0]
    r = np.linalg.norm(points, axis=1)
    far = r > radius  # a rounded direction may be none at all
    assert far.sum() > 0.9 * len(r)
    assert (estimate[far] > 0.01).all()
    assert (estimate[far] >= np.maximum(0.5 * (r[far] - radius), r[far] - tangent)).all()
