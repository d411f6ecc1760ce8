"""Programs of no phase, and of builds beside the usual one; where 16 lanes run: by AVX-512, or emulated."""

from __future__ import annotations

import os
from functools import cache
from pathlib import Path

import pytest

from builds import SETTINGS
from study.core import registry
from study.core.build import build

SIMDE = Path(os.environ.get("STEPWISE_INCLUDE", "/usr/include")) / "simde" / "x86" / "avx512.h"
TRUE = registry.cpu_flags() >= {"avx512f", "avx512dq"}
CAN_EMULATE = not TRUE and SIMDE.exists() and registry.cpu_flags() >= {"avx2", "fma"}
WORD = "16 lanes" if TRUE else "16 lanes emulated"  # for a test's id

needs_sixteen = pytest.mark.skipif(
    not TRUE and not CAN_EMULATE, reason="no AVX-512 here and no SIMDe: 16 lanes are not held against 8"
)
needs_emulation = pytest.mark.skipif(
    not CAN_EMULATE, reason="AVX-512 is here, or SIMDe is not: nothing is emulated"
)


@cache
def sixteen(phase: str, target: str = "render") -> Path:
    """A program of the phase that takes 16 lanes: the ordinary one, or the emulated build's."""
    return build(phase, target) if TRUE else emulated(phase, target)


@cache
def emulated(phase: str, target: str) -> Path:
    return made_in("emulated", phase, "EMULATE=1", target)


def made_in(folder: str, phase: str, setting: str, target: str = "render") -> Path:
    """A program of a build in a folder of its own; `setting`: of make, e.g. SANITIZE=1."""
    return build(phase, target, f"build/{folder}", (setting,))


def built(target: str, folder: str = "build") -> Path:
    """E.g. viewer, or tests/test_simd_8 of build/arm64: brought up to date, one worker at a time."""
    where, _, name = target.rpartition("/")
    return build(where, name, folder, tuple(SETTINGS[folder]))
