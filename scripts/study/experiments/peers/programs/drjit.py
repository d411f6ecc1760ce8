"""Dr.Jit: the march as one fused kernel, compiled by LLVM."""

import ctypes
import os
import platform
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

from study.core.cli import CANNOT_RUN, StudyError
from study.experiments.peers.peer import FLOAT_DB, IN_FLOAT, Drawn, Job, Python

OLDEST = 17  # LLVM that can compile Dr.Jit's minimum
FOLDERS = (Path(f"/usr/lib/{platform.machine()}-linux-gnu"), *Path("/usr/lib").glob("llvm-*/lib"))


def llvm_version(path: Path) -> int | None:
    """Major version of a libLLVM; None where it cannot be loaded or is older than its own question, 16."""
    try:
        ask = ctypes.CDLL(str(path)).LLVMGetVersion
    except (OSError, AttributeError):
        return None
    parts = [ctypes.c_uint() for _ in range(3)]
    ask(*map(ctypes.byref, parts))
    return parts[0].value


def find_llvm(folders: Iterable[Path] = FOLDERS) -> tuple[Path, int]:
    """The LLVM that DRJIT_LIBLLVM_PATH names, or the newest in the folders, and its version. Raises
    StudyError: none is new enough."""
    given = os.environ.get("DRJIT_LIBLLVM_PATH")
    found = [Path(given)] if given else [path for folder in folders for path in folder.glob("libLLVM*.so*")]
    versions = {path.resolve(): llvm_version(path) or 0 for path in found}
    able = [path for path, version in versions.items() if version >= OLDEST]
    if not able:
        seen = ", ".join(sorted(path.name for path in versions)) or "none"
        raise StudyError(
            f"needs LLVM {OLDEST} or newer (found: {seen}): libllvm19, or DRJIT_LIBLLVM_PATH", CANNOT_RUN
        )
    best = max(able, key=lambda path: (versions[path], str(path)))
    return best, versions[best]


@dataclass(frozen=True)
class DrJit(Python):
    def lacking(self) -> str | None:
        try:
            find_llvm()
        except StudyError as error:
            return str(error)
        return super().lacking()

    def draw(self, job: Job) -> Drawn:
        path, version = find_llvm()
        with_llvm = replace(self, environment={"DRJIT_LIBLLVM_PATH": str(path)})
        made = super(DrJit, with_llvm).draw(job)
        return replace(made, version=f"{made.version} on {path.name} ({version})")


PEER = DrJit(
    name="drjit",
    title="Dr.Jit",
    timed="the frozen kernel and its end, without compiling",
    differs=IN_FLOAT,
    least_db=FLOAT_DB,
    packages=("drjit==1.5.0",),
    modules="drjit, numpy",
)
