"""Truth's first hits of groups, against balls of 200 bits; how many rays are left."""

from __future__ import annotations

import json
import subprocess

import enclosures
import numpy as np
import pytest
from flint import arb, ctx

from conformance import oracle_groups
from study.core import registry, run
from study.core.build import build
from study.pictures import images

NAMES = "csg", "metaballs", "bumpy"
BALL = {"type": "sphere", "radius": 0.8}
BOX = {"type": "box", "half_size": [0.7, 0.5, 0.6]}
RING = {"type": "torus", "major_radius": 0.8, "minor_radius": 0.25}
PILL = {"type": "capsule", "radius": 0.3, "half_height": 0.9, "rotation_degrees": [30, 0, 50]}
EGG = {"type": "ellipsoid", "radius": [0.9, 0.5, 0.7], "position": [0.3, 0.2, 0]}
SPONGE = {"type": "gyroid", "cell": 0.9, "thickness": 0.2}
WAVES = {"amplitude": 0.05, "frequency": [7, 9, 8]}


def group(operation, *shapes, **more):
    return {"type": "group", "operation": operation, "shapes": list(shapes), **more}


TREES = {
    "sharp": group("difference", group("intersection", BOX, BALL), PILL, RING, rotation_degrees=[20, 30, 5]),
    "blends": group("union", BALL, PILL, EGG | {"offset": 0.05}, RING, blend=0.3),
    "hollow": group("intersection", BALL | {"shell": 0.1}, BOX, blend=0.1, mirror="xz", position=[0.1, 0, 0]),
    "melted": group("difference", BOX, BALL | {"position": [0.5, 0.4, -0.5]}, PILL, blend=0.2),
    "waves": group("union", BALL | {"displace": WAVES}, RING, displace=WAVES, offset=0.02),
    "twisted": BOX | {"twist": 1.5, "rounding": 0.1, "rotation_degrees": [0, 0, 40]},
    "sponge": group("intersection", SPONGE, BALL),
    "deep": group(
        "union", group("difference", group("union", group("intersection", BALL, BOX), PILL, blend=0.1), EGG)
    ),
}


def painted(shape):
    inner = {"shapes": [painted(one) for one in shape["shapes"]]} if "shapes" in shape else {}
    return shape | (inner or {"material": "white"})


@pytest.fixture
def scene(tmp_path):
    def write(*shapes):
        data = enclosures.scene("sphere")
        data["shapes"] = [painted(one) for one in shapes]
        data["march"]["bounds_radius"] = 20
        path = tmp_path / "scene.json"
        path.write_text(json.dumps(data))
        return data, path

    return write


def rays(seed, count, centre=(0, 0, 0), size=1.0, start=(0.5, 1, -4)):
    rng = np.random.default_rng(seed)
    o = np.array(start) + rng.normal(size=(count, 3)) * 0.1
    return np.hstack([o, np.array(centre) + rng.normal(size=(count, 3)) * size / 2 - o])


def judge(data, path, sample):
    claims = enclosures.claimed(build("truth", "rays"), path, sample)
    for ray, claim in zip(sample.tolist(), claims.tolist(), strict=True):
        if claim[0] != 0:
            assert oracle_groups.fault(data, ray, claim) == "", (ray, claim)
    return claims


@pytest.mark.parametrize("name", TREES)
def test_first_hits_are_the_first_and_enclosed(scene, name):
    claims = judge(*scene(TREES[name], {"type": "plane", "normal": [0, 1, 0], "offset": -2}), rays(7, 20))
    hit = (claims[:, 0] == 2) & (claims[:, 1] >= 0)
    assert hit.sum() > 10 and (claims[:, 1] == 0).any() and (claims[hit, 3] - claims[hit, 2]).max() < 1e-13
    assert (claims[:, 0] == 2).sum() >= 19


@pytest.mark.parametrize("name", TREES)
def test_distances_are_the_field_by_one_constant(scene, name):
    """The distance is the field over the root's slope bound, which is at least 1."""
    ctx.prec = oracle_groups.BITS
    shape = TREES[name]
    points = np.random.default_rng(3).uniform(-0.7, 0.7, (30, 3))
    done = subprocess.run(
        [build("truth", "probe"), scene(shape)[1]], input=points.tobytes(), capture_output=True
    )
    found = np.frombuffer(done.stdout).reshape(-1, 2)[:, 0]
    exact = np.array([float(oracle_groups.field(shape, [arb(x) for x in p]).mid()) for p in points.tolist()])
    slope = exact[np.abs(exact) > 0.01] / found[np.abs(exact) > 0.01]
    assert np.ptp(slope) < 1e-13 * slope[0] and slope[0] >= 1 and np.sign(exact).min() < np.sign(exact).max()


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("rows", [10, pytest.param(180, marks=pytest.mark.slow)])
def test_the_scenes_are_decided(tmp_path, name, rows):
    """At 180 rows, and a sample of rays of the small picture against balls."""
    found, out = registry.find_scene(name), tmp_path / "picture.exr"
    run.render("truth", found.path, rows, aov=True, out=out, threads=2, timed=False)
    picture = images.read(out)
    assert (picture["status"] != 2).mean() <= 0.001 and (picture["status.all"] != 2).mean() <= 0.002
    assert np.isfinite([picture["R"], picture["ideal.R"]]).all() and len(np.unique(picture["id"])) > 1
    if rows < 100:
        camera = found.data["camera"]["position"]
        judge(found.data, found.path, rays(5, 8, (0, 0, 13), 3, camera))


def test_a_wrong_claim_is_noticed(scene):
    data, path = scene(TREES["blends"])
    sample = rays(1, 6, size=0.3)
    for ray, claim in zip(sample.tolist(), judge(data, path, sample).tolist(), strict=True):
        index, low, high = claim[1:4]
        for wrong in (
            [2, 0, low + 1e-9, high + 1e-9],
            [2, 0, low - 1e-9, high - 1e-9],
            [2, -1, np.inf, np.inf],
        ):
            assert index == 0 and oracle_groups.fault(data, ray, wrong), claim


def test_the_first_child_of_equals_and_coincident_faces(scene):
    """A ray along a face that two children share is not guessed; a doubled child changes nothing."""
    once = judge(*scene(group("union", BALL, BOX)), rays(2, 10))
    data, path = scene(group("union", BALL, BALL, BOX))
    assert np.array_equal(judge(data, path, rays(2, 10))[:, :4], once[:, :4])
    _, path = scene(group("difference", BOX, BOX))
    claims = enclosures.claimed(build("truth", "rays"), path, rays(4, 10, size=0.3))
    assert (claims[:, 0] == 0).all()  # a sheet where the field is 0 and never below
