"""opt11_ideal: its soft shadows are those of ground truth's ideal picture, whatever the solids and the light.

The rays of each solid are tried by tests/c/phases/widest_cones.h; here are whole pictures, by 16 and by 8
lanes.
"""

from __future__ import annotations

import functools
import shutil
from pathlib import Path

import numpy as np
import pytest
from phase_pictures import needs
from soft_shadows import decibels

from conformance import harness
from conformance.feature_scenes import FLOOR, scene, shape
from study.core import registry
from study.pictures import images

PHASE = "opt11_ideal"
WIDTH, HEIGHT = 64, 36

pytestmark = needs(PHASE)

SOLIDS = [
    shape("sphere", radius=0.5, position=[-1.6, -0.5, 3], material="mirror"),
    shape("box", half_size=[0.3, 0.5, 0.4], position=[-0.6, -0.5, 3.4], rotation_degrees=[0, 30, 0]),
    shape("box", half_size=[0.3, 0.3, 0.3], rounding=0.1, position=[0.3, -0.6, 2.6]),
    shape("cone", bottom_radius=0.5, top_radius=0.1, half_height=0.5, position=[1.1, -0.5, 3.2]),
    shape("octahedron", radius=0.6, position=[0.2, 0.6, 3.8], rotation_degrees=[20, 10, 0]),
    shape(
        "torus", major_radius=0.5, minor_radius=0.2, position=[-0.9, 0.7, 3.4], rotation_degrees=[60, 0, 20]
    ),
    shape("cone", bottom_radius=0.3, top_radius=0.3, half_height=0.4, position=[1.8, 0.4, 4]),
]
LIGHTS = {
    "above": [2, 5, 0],
    "low": [-6, 0.2, 2],
    "before a solid": [0.3, 0.9, 2.9],
    "in a solid": [0.3, -0.6, 2.6],
    "in the ring": [-0.9, 0.7, 3.4],
    "at the floor": [0.5, -0.9999, 2],
}


def lit_from(place: list[float], shapes: list[dict], strength: float = 3) -> dict:
    light = {"shadows": "soft", "shadow_strength": strength, "position": place, "emission": [9, 9, 9]}
    return scene([FLOOR, *shapes], light=light)


GRID = shape("box", half_size=[0.2, 0.3, 0.2], position=[0, 0, 5], repeat=[1.2, 0, 1.2])
RINGS = shape("torus", major_radius=0.4, minor_radius=0.1, position=[0, 0.5, 5], repeat=[1.5, 0, 1.5])
# Truth gives up a search among copies after 100,000 parts (least_ratio_any), which a grazing own face takes:
# so no face of these boxes is in grazing light.
SCENES = {
    **{f"light {name}": lit_from(place, SOLIDS) for name, place in LIGHTS.items()},
    "strength 0.5": lit_from(LIGHTS["above"], SOLIDS, 0.5),
    "strength 40": lit_from(LIGHTS["above"], SOLIDS, 40),
    "boxes repeated": lit_from([9, 8, -9], [GRID]),
    "rings repeated": lit_from(LIGHTS["low"], [RINGS, SOLIDS[0]]),
    "a crowd": lit_from(
        LIGHTS["above"],
        [
            shape("sphere", radius=0.2, position=[0.5 * (i % 8) - 2, 0.4 * (i // 8) - 0.8, 4])
            for i in range(40)
        ],
    ),
}


def ideal_of(truth: dict[str, np.ndarray]) -> np.ndarray:
    return np.stack([truth[f"ideal.{name}"] for name in "RGB"], axis=-1)


def nearness(picture: dict[str, np.ndarray], truth: dict[str, np.ndarray]) -> float:
    """PSNR to the ideal picture where both hit the same shape and truth is sure of all rays, dB."""
    same = (picture["id"] == truth["id"]) & (truth["status.all"] == 2)
    assert same.mean() > 0.9, f"only {same.mean():.0%} of the pixels can be compared"
    return decibels(images.rgb(picture), ideal_of(truth), same)


def drawn(name: str, phase: str = PHASE) -> dict[str, np.ndarray]:
    path = harness.keep(f"ideal_{name.replace(' ', '_')}", SCENES[name])
    return harness.render(phase, path, WIDTH, HEIGHT).picture


@functools.cache
def truths(name: str) -> dict[str, np.ndarray]:
    return drawn(name, "truth")


# In the quick half one width of each scene, and both of one.
LANES = [
    pytest.param(name, lanes, marks=[pytest.mark.slow] * ((i + int(lanes) // 8) % 2 and i > 0))
    for i, name in enumerate(SCENES)
    for lanes in ("16", "8")
]


@pytest.mark.parametrize(("name", "lanes"), LANES)
def test_shadows_are_the_ideal(name: str, lanes: str, monkeypatch: pytest.MonkeyPatch) -> None:
    truth = truths(name)
    if lanes == "8":
        monkeypatch.setenv("STEPWISE_ISA_LIMIT", "avx2")
    assert nearness(drawn(name), truth) >= 90


@pytest.mark.slow
@pytest.mark.parametrize("name", ["light above", "light in the ring", "strength 40"])
def test_marched_frames_are_near_the_ideal(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    truth = truths(name)
    monkeypatch.setenv("STEPWISE_PATH", "march")
    assert nearness(drawn(name), truth) >= 60


def lonely(picture: np.ndarray) -> int:
    """Pixels that differ from all eight neighbours by more than 0.2."""
    apart = np.full(picture.shape[:2], np.inf)
    for down in (-1, 0, 1):
        for right in (-1, 0, 1):
            if down or right:
                moved = np.roll(picture, (down, right), axis=(0, 1))
                apart = np.minimum(apart, np.abs(picture - moved).max(axis=-1))
    return int((apart[1:-1, 1:-1] > 0.2).sum())


def test_a_mandelbulb_is_near_the_ideal() -> None:
    """On the floor beside a Mandelbulb of one iteration the estimator draws black dots, this phase none."""
    bulb = shape("mandelbulb", iterations=1, position=[0, 0.3, 3.5])
    path = harness.keep("ideal_bulb", lit_from([-6, 1.5, 2], [bulb]))
    mine, truth = (harness.render(phase, path, WIDTH, HEIGHT).picture for phase in (PHASE, "truth"))
    floor = (mine["id"] == 0) & (truth["id"] == 0)
    wanted = ideal_of(truth)
    assert decibels(images.rgb(mine), wanted, floor) >= 40
    dots = [lonely(np.where(floor[..., None], rgb, 0.0)) for rgb in (images.rgb(mine), wanted)]
    assert dots[0] == dots[1]


def test_a_mandelbox_is_near_the_ideal() -> None:
    path = registry.scenes()["mandelbox"].path
    mine, truth = (harness.render(phase, path, WIDTH, HEIGHT).picture for phase in (PHASE, "truth"))
    assert decibels(images.rgb(mine), ideal_of(truth), mine["id"] == truth["id"]) >= 60


@pytest.mark.slow
@pytest.mark.skipif(not shutil.which("gcc"), reason="gcc would compile kernels")
@pytest.mark.parametrize("name", ["scene0", "mandelbulb"])
def test_a_kernel_draws_what_the_general_code_draws(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = registry.scenes()[name].path
    general = harness.render(PHASE, path, WIDTH, HEIGHT)
    monkeypatch.setenv("STEPWISE_CC", "gcc")
    monkeypatch.setenv("STEPWISE_CACHE", str(tmp_path))
    kernel = harness.render(PHASE, path, WIDTH, HEIGHT)
    assert kernel.record["kernel"] == "generated" != general.record["kernel"]
    for plane, values in general.picture.items():
        allowed = 4e-6 if plane in "RGB" else 0  # highlights; where a search ends (room_for)
        with np.errstate(invalid="ignore"):
            apart = np.abs(np.where(values == kernel.picture[plane], 0, values - kernel.picture[plane]))
        assert (apart <= allowed).all(), (plane, apart.max())
