"""What a peer is: another program that draws a scene of ours. Each module of programs/ exports one, PEER.

A peer that is not there is left out by name. `--install` puts what comes from PyPI or crates.io into
build/peers; a Debian package is only named.
"""

import abc
import importlib
import os
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from study.core import cli, store
from study.core.cli import CANNOT_RUN, StudyError
from study.core.host import child
from study.core.registry import ROOT, Scene
from study.experiments import venvs
from study.experiments.peers import shader

HOME = ROOT / "build" / "peers"
WORKERS = Path(__file__).with_name("workers")
# In float a place 20 units away is known to 2e-6, and a march to less than that does not end.
HIT_DISTANCE = 1e-5
IN_FLOAT = f"float, hit distance {HIT_DISTANCE:g}"
FLOAT_DB = {"scene0_plain": 55.0, "mandelbulb_plain": 35.0}


@dataclass(frozen=True)
class Job:
    """One launch: `frames` timed frames of the scene, pinned to `cpus`. `folder` is for what it writes;
    `padding`: bytes of the environment; `picture`: whether it is wanted."""

    scene: Scene
    size: tuple[int, int]
    threads: int
    frames: int
    cpus: Collection[int]
    folder: Path
    padding: int = 0
    picture: bool = False

    def environment(self, **more: str) -> dict[str, str]:
        return os.environ | {"STEPWISE_PADDING": "x" * self.padding, "HOME": str(HOME)} | more


@dataclass(frozen=True)
class Drawn:
    """ns of each timed frame, the version, and the linear picture (height × width × 3) if it was wanted."""

    ns: Sequence[float]
    version: str
    rgb: np.ndarray | None = None


class Said(msgspec.Struct):
    """What a worker prints: ns of each timed frame, and the version."""

    ns: list[float]
    version: str = ""


@dataclass(frozen=True)
class Peer(abc.ABC):
    """`timed`: what is in the time of a frame; `differs`: why its picture is not ours. `least_db`: by scene,
    the PSNR to ground truth that its picture has at least, which a test holds it to. `cores`: whether it
    draws with several threads."""

    name: str
    title: str
    timed: str
    differs: str
    least_db: dict[str, float]
    cores: bool = True

    @property
    def home(self) -> Path:
        return HOME / self.name

    @abc.abstractmethod
    def lacking(self) -> str | None:
        """What it needs and how to get it; None where it can run."""

    def install(self) -> None:  # noqa: B027
        """Puts it into build/peers; nothing where that is not how it is had. Raises StudyError."""

    @abc.abstractmethod
    def draw(self, job: Job) -> Drawn:
        """Raises StudyError with the program's last line."""


def run(command: Sequence[str | Path], job: Job, title: str, **more: str) -> tuple[str, str]:
    """Standard output and errors of the program, pinned to the job's CPUs. Raises StudyError."""
    done = child.run(
        command,
        env=job.environment(**more),
        cwd=job.folder,
        capture_output=True,
        text=True,
        preexec_fn=lambda: os.sched_setaffinity(0, job.cpus),
    )
    if done.returncode:
        said = (done.stderr or done.stdout).strip().splitlines()
        raise StudyError(f"{title}: {said[-1] if said else f'status {done.returncode}'}", CANNOT_RUN)
    return done.stdout, done.stderr


@dataclass(frozen=True)
class Python(Peer):
    """A peer that is a package of PyPI: workers/draw.py NAME draws in an environment of its own."""

    packages: Sequence[str] = ()
    modules: str = ""
    environment: dict[str, str] = field(default_factory=dict)

    def lacking(self) -> str | None:
        if venvs.has(venvs.python_of(self.home), self.modules):
            return None
        return f"needs {' and '.join(self.packages)} from PyPI: --install"

    def install(self) -> None:
        if self.lacking():
            venvs.install(self.home, [*self.packages, "numpy"])

    def task(self, job: Job) -> dict[str, Any]:
        """What its worker is told: the scene as it is, its camera, and as a kernel's text, with the distance
        to each shape by itself."""
        scene, (width, height) = job.scene.content, job.size
        scene.march.hit_distance = HIT_DISTANCE
        return {
            **{"width": width, "height": height, "threads": job.threads, "frames": job.frames},
            **{"scene": scene, "source": shader.source(scene, width, height)},
            "distances": [shader.distance(shape) for shape in scene.shapes],
            "materials": scene.of_shapes,
            **vars(shader.camera(scene, width, height)),
            "out": job.folder / "picture.npy" if job.picture else None,
        }

    def draw(self, job: Job) -> Drawn:
        path, python = job.folder / "task.json", venvs.python_of(self.home)
        store.write_json(path, cli.plain(self.task(job)))
        more = {name: value.format(threads=job.threads) for name, value in self.environment.items()}
        command: list[str | Path] = [python, "-I", WORKERS / "draw.py", self.name, path]
        said, _ = run(command, job, self.title, **more)
        try:
            found = msgspec.json.decode(said.strip().rpartition("\n")[2], type=Said)
        except msgspec.DecodeError:
            raise StudyError(f"{self.title}: printed no JSON object", CANNOT_RUN) from None
        return Drawn(found.ns, found.version, np.load(job.folder / "picture.npy") if job.picture else None)


@cache
def find_all() -> dict[str, Peer]:
    names = sorted(path.stem for path in Path(__file__).with_name("programs").glob("[a-z]*.py"))
    found = [importlib.import_module(f"study.experiments.peers.programs.{name}").PEER for name in names]
    return {one.name: one for one in found}
