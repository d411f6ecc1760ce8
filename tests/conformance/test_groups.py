"""Groups in every phase that draws them: their fields and pictures; and the sentence of every other phase."""

from __future__ import annotations

import functools
import random

import numpy as np
import pytest

from conformance import geometry, groups, shading
from conformance.beside import SMOOTH, check, compare, precision
from conformance.feature_scenes import scene
from conformance.group_scenes import GROUPS, made, tree
from conformance.harness import PHASES, REDUCED, distances, keep, render
from study.core import registry

DRAW = [name for name in PHASES if registry.phases()[name].groups]
SIZE = (17, 9) if REDUCED else (48, 27)
RANDOM = 4 if REDUCED else 24
pytestmark = pytest.mark.parametrize("phase", DRAW)


@pytest.mark.parametrize("name", GROUPS)
def test_group(phase: str, name: str) -> None:
    check(render(phase, keep(name, GROUPS[name]), *SIZE))


@pytest.mark.parametrize("name", registry.groups())
def test_group_scene(phase: str, name: str) -> None:
    check(render(phase, registry.groups()[name].path, 32, 18))


@functools.cache
def random_tree(seed: int) -> tuple[dict, np.ndarray, np.ndarray]:
    """A scene of one random tree, points, and the field there."""
    draw = np.random.default_rng(seed)
    whole = scene([tree(random.Random(seed))])
    points = np.concatenate([draw.uniform(-3, 3, (200, 3)), draw.uniform(-20, 20, (40, 3))])
    points = points.astype(np.float32).astype(float)
    return whole, points, geometry.scene_distance(points, whole)


@pytest.mark.parametrize("seeds", [range(RANDOM)])
def test_field(phase: str, seeds: range) -> None:
    """Random trees, against NumPy: within 256 roundings of the coordinates, for three levels of nodes."""
    unit = 2.0**-52 if registry.phases()[phase].precision == "double" else 2.0**-23
    for seed in seeds:
        whole, points, expected = random_tree(seed)
        path = keep(f"random_tree_{seed}", whole)
        off = np.abs(distances(phase, path, points)[0] - expected)
        allowed = 256 * unit * (np.linalg.norm(points, axis=1) + 4)
        worst = int(np.argmax(off / allowed))
        assert off[worst] <= allowed[worst], f"{phase} {path}: at {points[worst].tolist()} by {off[worst]}"


PICTURES = ("group_csg", "group_blend", "group_mirrors")


@pytest.mark.parametrize("name", PICTURES)
def test_picture_is_what_the_words_say(phase: str, name: str) -> None:
    """Against the renderer in NumPy: normals, light, and colours by the children's shares."""
    run = render(phase, keep(name, GROUPS[name]), 32, 18)
    compare(run, shading.render(run.scene, 32, 18), SMOOTH[precision(phase)])


@pytest.mark.parametrize("seeds", [range(40)])
def test_slope(phase: str, seeds: range) -> None:
    """No field of a group rises faster than a distance does, between points near and far."""
    for seed in seeds:
        draw = np.random.default_rng(1000 + seed)
        path = keep(f"random_tree_{seed}", scene([tree(random.Random(seed))]))
        a = np.concatenate([draw.uniform(-3, 3, (400, 3)), draw.uniform(-30, 30, (100, 3))])
        apart = draw.normal(size=a.shape)
        length = 10 ** draw.uniform(-5, 0.5, len(a))
        b = a + apart * (length / np.linalg.norm(apart, axis=1))[:, None]
        f = distances(phase, path, np.concatenate([a, b]))[0]
        slope = np.abs(f[: len(a)] - f[len(a) :]) / length
        assert slope.max() <= 1 + 1e-8, f"{path}: {slope.max()}"


STEEP = {
    "displaced": made("sphere", displace={"amplitude": 0.2, "frequency": [6, 5, 4]}),
    "twisted": made("box", half_size=[1.2, 1.2, 0.01], twist=1),
}


@pytest.mark.parametrize("name", STEEP)
def test_slope_reaches_one(phase: str, name: str) -> None:
    """The constants are not generous: where the field is steepest it is as steep as they allow."""
    draw = np.random.default_rng(5)
    a = draw.uniform(-1.4, 1.4, (40000, 3))
    path = keep(f"steep_{name}", scene([STEEP[name]]))
    f = distances(phase, path, np.concatenate([a, *(a + 1e-6 * axis for axis in np.eye(3))]))[0].reshape(
        4, -1
    )
    assert 0.95 < np.linalg.norm((f[1:] - f[0]) / 1e-6, axis=0).max() <= 1 + 1e-6


def test_bounds(phase: str) -> None:
    """Outside of a tree's sphere its field grows as fast as its bound says; none is below 0 there."""
    for seed in range(40):
        one = tree(random.Random(seed))
        bound, slope = groups.bound(one), groups.bound(one, root=True).slope
        far = np.random.default_rng(seed).normal(size=(500, 3)) * bound.radius + bound.centre
        outside = np.linalg.norm(far - bound.centre, axis=1) - bound.radius
        path = keep(f"random_tree_{seed}", scene([one]))
        f = distances(phase, path, far)[0] * slope
        assert (f >= bound.growth * outside - 1e-9)[outside > 0].all(), f"{path}"
