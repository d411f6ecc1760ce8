"""The steps of the paper's program as peers, on its own scene files. stepwise original fetches and builds."""

from __future__ import annotations

import functools
import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from study.core import run, store
from study.core.cli import StudyError
from study.core.registry import Scene, find_scene
from study.experiments.original import measure as original
from study.experiments.original import scenes
from study.experiments.peers.peer import HOME, Drawn, Job, Peer
from study.pictures import images

HELD = HOME / "paper"  # the clone and the steps' programs
PREFIX = "paper_"  # of its scenes' names: three of them are ours, too


@functools.cache
def tsc_hz() -> float:
    """Ticks a second of the clock that its program counts."""
    (frame,) = run.frames("opt1", find_scene("scene0_plain").path, 16, cpu=run.FASTEST)
    return float(frame["tsc_hz"])


def linear(display: np.ndarray) -> np.ndarray:
    """The linear colours that are displayed as these bytes: the middle of each byte's step."""
    return (((display + 0.5) / 255) ** (1 / images.GAMMA)).astype(np.float32)


@dataclass(frozen=True)
class Step(Peer):
    """`phase`: ours of the same step. Its program draws one height; each has its own build."""

    phase: str = ""

    def lacking(self) -> str | None:
        return None

    def draw(self, job: Job) -> Drawn:
        program = original.build(HELD / "repository", self.phase, job.size[1])
        name = job.scene.name.removeprefix(PREFIX)
        shutil.copy(HELD / "scenes" / f"{name}.json", program.parents[1] / "scenes" / f"{name}.json")
        ns, picture = [], None
        for _ in range(job.frames):
            cycles, picture = original.launch(program, name, min(job.cpus), job.padding)
            ns.append(1e9 * cycles / tsc_hz())
        assert picture is not None
        if picture.shape[:2] != (job.size[1], job.size[0]):
            raise StudyError(f"the paper's {self.phase} drew {picture.shape[1]}×{picture.shape[0]} pixels")
        version = f"commit {original.COMMITS[self.phase]}"
        return Drawn(ns, version, linear(picture) if job.picture else None)


def fetched(repository: Path) -> dict[str, Scene]:
    """Its scene files by name, as ours, from a checkout that the user has. Raises StudyError."""
    if not (repository / ".git").exists():
        raise StudyError(f"{repository}: is no git checkout of the paper's program")
    shutil.rmtree(HELD, ignore_errors=True)
    original.fetch(str(repository.resolve()), HELD / "repository")
    program = original.build(HELD / "repository", "baseline", 16)
    shutil.copytree(program.parents[1] / "scenes", HELD / "scenes")
    found = {}
    for path in sorted((HELD / "scenes").glob("*.json")):
        data, name = scenes.converted(path), f"{PREFIX}{path.stem}"
        ours = HELD / f"{name}.json"
        store.write_json(ours, data)
        fractal = any(shape["type"] == "mandelbulb" for shape in data["shapes"])
        found[name] = Scene(name, ours, data, fractal)
    return found


def steps(names: Sequence[str]) -> dict[str, Peer]:
    """Every step by its name, which draws the scenes of these names."""
    return {
        f"paper_{phase}": Step(
            name=f"paper_{phase}",
            title=f"the paper's {phase}",
            timed="its frame by the TSC, as its benchmark has it",
            differs="8 bits a channel, gamma undone"
            + ("; another fog and larger bounds" if phase == "opt4" else ""),
            least_db=dict.fromkeys(names, 20.0),
            cores=False,
            phase=phase,
        )
        for phase in original.COMMITS
    }
