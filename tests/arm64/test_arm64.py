"""aarch64, cross-built and emulated (helpers/arm64.py): pictures of every phase and scene, and words.

The pictures are held against those of baseline (and truth) on this machine, by the bounds of
tests/conformance. No test looks at a time: an emulator's says nothing.
"""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import programs
import pytest
from hypothesis import HealthCheck, given, settings

import arm64
from builds import ARM64_TESTS, ARM64_WORDS
from conformance import harness
from conformance.beside import check
from conformance.feature_scenes import is_fractal
from conformance.harness import PHASES, TRUTH, keep
from hard.drawn_scenes import random_scenes, spheres_alone
from study.core import registry
from study.pictures import gate, images

pytestmark = [pytest.mark.slow, arm64.needs_arm64]


@pytest.mark.parametrize("scene", arm64.SCENES)
@pytest.mark.parametrize("phase", PHASES)
def test_scene(phase: str, scene: str) -> None:
    """Within the conformance suite's bounds to baseline's picture of this machine, and within the phase's own
    tolerance to it, where it declares one."""
    size = (8, 5) if phase == TRUTH else (32, 18)
    about, path = registry.phases()[phase], arm64.SCENES[scene].path
    try:
        run = arm64.draw(phase, path, *size)
    except harness.Unsupported as refused:
        assert about.family == registry.SYSTEMS, refused
        return
    record = run.record
    assert record["isa"] == arm64.made_of(about)
    assert record["lanes"] == min(about.lanes, 8) and "-mavx" not in record["flags"]
    harness.check_picture(run)
    if about.approximate:
        return
    check(run)
    declared = gate.tolerance(about, arm64.SCENES[scene])
    if declared and not is_fractal(run.scene):
        beside = harness.reference(path, *size).picture
        failed = gate.failures(
            images.compare(beside, run.picture, None), arm64.small(declared, size[0] * size[1])
        )
        assert not failed, f"{run}: {failed}"


@pytest.mark.parametrize("phase", PHASES)
def test_random_scenes(phase: str) -> None:
    """Any scene that hypothesis draws: status 0, and a picture of finite numbers."""
    size = (3, 2) if phase == TRUTH else (11, 7)

    @settings(max_examples=2, database=None, suppress_health_check=list(HealthCheck))
    @given(random_scenes())
    def each(whole: dict) -> None:
        for one in (whole, spheres_alone(whole)):
            try:
                harness.check_picture(arm64.draw(phase, keep(f"arm64_{phase}", one), *size))
                return
            except harness.Unsupported:
                continue

    each()


def test_a_kernel_is_compiled_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It draws what the general code draws, but for the last bits of shininess. opt11_ideal's, by the code
    that it has of opt10_scene."""
    phase, path = "opt11_ideal", registry.scenes()["scene0"].path
    general = arm64.draw(phase, path, 16, 9)
    assert general.record["kernel"] != "generated"
    monkeypatch.setenv("STEPWISE_CC", arm64.COMPILER)
    monkeypatch.setenv("STEPWISE_CC_SECONDS", "270")  # beside all other tests
    monkeypatch.setenv("STEPWISE_CACHE", str(tmp_path / "cache"))
    generated = arm64.draw(phase, path, 16, 9)
    assert generated.record["kernel"] == "generated" and generated.record["kernel_compile_ns"] > 0
    for name, plane in general.picture.items():
        with np.errstate(invalid="ignore"):
            apart = np.abs(np.where(plane == generated.picture[name], 0, plane - generated.picture[name]))
        assert (apart <= (4e-6 if name in "RGB" else 0)).all(), (name, np.nanmax(apart))


@pytest.mark.parametrize("name", ARM64_TESTS)
def test_program(name: str) -> None:
    """What holds words to the bit, enclosures to their bounds and polynomials to their ulp."""
    done = arm64.run(programs.built(f"tests/{name}", arm64.FOLDER))
    assert done.returncode == 0, done.stdout + done.stderr
    assert "skipped" not in done.stdout + done.stderr


@pytest.mark.parametrize("name", ARM64_WORDS)
def test_words_sanitized(name: str) -> None:
    """By ASan and UBSan, whose leak check needs ptrace, which the emulator lacks."""
    made = programs.built(f"tests/{name}", "build/arm64-asan")
    done = arm64.run(made, env=os.environ | {"ASAN_OPTIONS": "detect_leaks=0"})
    assert done.returncode == 0, done.stdout + done.stderr


def test_truth_proves_the_same_pixels() -> None:
    """By long double of 113 bits as by __float128: the same arithmetic, so the same picture to the bit."""
    for scene in ("trio", "cubes"):
        path = registry.scenes()[scene].path
        here, there = harness.reference(path, 8, 5, phase=TRUTH), arm64.draw(TRUTH, path, 8, 5)
        harness.same_bits(there, here, ("Z", "id", "status", "width", "N.x", "N.y", "N.z"))
        assert json.loads(there.stdout)["isa"] == "aarch64"
