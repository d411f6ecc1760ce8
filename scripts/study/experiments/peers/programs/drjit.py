"""Dr.Jit: the program of stepwise drjit, with the limits that the other float programs have."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from functools import cache

import numpy as np

from study.core import store
from study.core.cli import CANNOT_RUN, StudyError
from study.experiments import venvs
from study.experiments.drjit import measure as drjit
from study.experiments.peers.peer import FLOAT, FLOAT_DB, IN_FLOAT, Drawn, Job, Peer, run


@cache
def rival() -> drjit.Rival:
    """Its Python and its LLVM. Raises StudyError."""
    llvm = drjit.find_llvm(os.environ.get("DRJIT_LIBLLVM_PATH"))
    return drjit.Rival(venvs.python_of(drjit.HOME), llvm)


@dataclass(frozen=True)
class DrJit(Peer):
    def lacking(self) -> str | None:
        try:
            python = rival().python
        except StudyError as error:
            return f"needs LLVM {drjit.OLDEST} or newer: {str(error).partition(';')[0]}"
        return None if venvs.has(python, drjit.NEEDED) else "needs drjit from PyPI: --install"

    def install(self) -> None:
        drjit.find_python(None)

    def draw(self, job: Job) -> Drawn:
        path, out = job.folder / "scene.json", job.folder / "picture.npz" if job.picture else None
        data = job.scene.data
        store.write_json(path, {**data, "march": data["march"] | FLOAT})
        command = rival().command(path, *job.size, job.threads, out)
        said, _ = run(command, job, self.title, DRJIT_LIBLLVM_PATH=str(rival().llvm))
        try:
            found = json.loads(said)
        except json.JSONDecodeError:
            raise StudyError(f"{self.title}: printed no JSON object", CANNOT_RUN) from None
        version = f"{found['drjit']} on {drjit.say_versions(rival().llvm)}"
        return Drawn(found["ns"], version, np.load(out)["rgb"] if out else None)


PEER = DrJit(
    name="drjit",
    title="Dr.Jit",
    timed="the frozen kernel and its end, without compiling",
    differs=IN_FLOAT,
    least_db=FLOAT_DB,
)
