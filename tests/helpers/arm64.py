"""Programs for aarch64, cross-built and run here under qemu-aarch64: emulated, so no time is taken."""

from __future__ import annotations

import os
import subprocess
from functools import cache
from pathlib import Path

import pytest

from builds import SETTINGS, arm64_missing
from study.core.build import build
from study.core.registry import ROOT

FOLDER = "build/arm64"
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
