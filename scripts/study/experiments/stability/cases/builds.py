"""The same phase, built otherwise: other compilers, other rounding. Each in a folder of its own.

Kept apart from the phases' own flags: they are for asking what a phase's arithmetic stands.
"""

import shutil

from study.core import registry
from study.experiments.stability.cases.phase import Phase


def _made(phase: Phase, make: tuple[str, ...], folder: str) -> Phase | None:
    if make[0] == "CC=gcc" and registry.find_phase(phase.name).embedded:
        return None  # what it compiles where it runs has flags of its own; the rest is its parent's code
    if not shutil.which(make[0].removeprefix("CC=")):
        return None
    return Phase(phase.name, make, folder, phase.time_limit)


def contracted(phase: Phase) -> Phase | None:
    """gcc, which may fuse every multiplication with the addition after it. None where the compiler is not
    installed, on a CPU without FMA, and of a phase that compiles itself: its parent is asked."""
    if "fma" not in registry.cpu_flags():
        return None
    return _made(phase, ("CC=gcc", "SANITIZERS=-mfma -ffp-contract=fast"), "build/hard-fma")


def clang(phase: Phase) -> Phase | None:
    return _made(phase, ("CC=clang",), "build/clang")
