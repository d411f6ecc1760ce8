"""Programs for aarch64, cross-built and run here under qemu-aarch64: emulated, so no time is taken."""

from __future__ import annotations

import os
import subprocess
from functools import cache
from pathlib import Path

import pytest

from builds import SETTINGS, arm64_missing
from conformance import harness
from conformance.harness import Run
from study.core import registry
from study.core.build import build
from study.core.registry import ROOT, Phase

FOLDER = "build/arm64"
SCENES = registry.scenes() | registry.groups()
COMPILER = SETTINGS[FOLDER][0].removeprefix("CC=")
EMULATOR = ["qemu-aarch64", "-L", "/usr/aarch64-linux-gnu"]  # whose libraries libraries.sh completes

needs_arm64 = pytest.mark.skipif(bool(arm64_missing()), reason=f"aarch64: {arm64_missing()}")


@cache
def program(phase: str, target: str = "render") -> Path:
    """A script that runs a phase's program of the cross build, with its arguments and environment."""
    made = build(phase, target, FOLDER, tuple(SETTINGS[FOLDER]))
    script, written = made.with_name(f"{target}.sh"), made.with_name(f"{target}.{os.getpid()}.sh")
    written.write_text(f'#!/bin/sh\nexec {" ".join(EMULATOR)} {made} "$@"\n')
    written.chmod(0o755)
    return written.replace(script)  # whole at once: another worker may be running the one that stands there


def run(made: Path, **how) -> subprocess.CompletedProcess:
    return subprocess.run([*EMULATOR, made], capture_output=True, text=True, cwd=ROOT, **how)


def draw(phase: str, scene: Path, width: int, height: int) -> Run:
    """The picture of the cross-built program. Raises harness.Unsupported."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(harness, "binary", program)
        return harness.render(phase, scene, width, height, anew=True)  # by a script, whatever its program


def made_of(phase: Phase) -> str:
    """What its lanes are: NEON, or x86's intrinsics by SIMDe."""
    if phase.name in ("opt3", "opt4", "opt5_threads", "fixed_simd"):
        return "avx2 by SIMDe"
    return "neon" if phase.lanes > 1 else "aarch64"


def small(tolerance: dict, pixels: int) -> dict:
    """A phase's tolerance for so few pixels: a share of them is one pixel at least."""
    share, ppm = 1.01 / pixels, 1.01e6 / pixels
    one = {"fraction_over_1_255": share, "fraction_over_1_255_display": share, "flip_mean": share}
    one |= {"mask_mismatch_ppm": ppm, "id_mismatch_ppm": ppm}
    return tolerance | {name: max(bound, one[name]) for name, bound in tolerance.items() if name in one}
