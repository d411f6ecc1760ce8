"""Our phases beside Dr.Jit on the same machine: its Python and its LLVM, times in one run, errors of both."""

from __future__ import annotations

import contextlib
import ctypes
import functools
import json
import os
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from study.core import registry, run, store
from study.core.cli import CANNOT_RUN, StudyError
from study.core.host import child
from study.core.registry import Spec
from study.experiments import venvs
from study.experiments.drjit.schema import DrJit
from study.experiments.frames import measure as frames
from study.numbers import stats, verdicts
from study.pictures import images

FILE = "drjit.json"
DRJIT = "Dr.Jit"
PACKAGES = ("drjit==1.5.0", "numpy")
NEEDED = "drjit, numpy"  # modules
HOME = registry.ROOT / "build" / "drjit"
WORKER = Path(__file__).with_name("render.py")
ADDS = "it would add the ratio of our phases to Dr.Jit's kernels on this machine"
OLDEST = 17  # LLVM that can compile Dr.Jit's minimum for x86
STEPS, HIT = 100, 1e-3  # of the march that Dr.Jit was published with
# Goal, and ms on one and two threads as published: a Zen 5 core at 4.27 GHz, LLVM 19, 1280×720.
GOALS = {"scene0_plain": (8.0, (76.0, 40.0)), "mandelbulb": (3.0, (152.0, 76.0))}
OWN, SAME = "the scene's own", f"{STEPS} steps, {HIT:g}"  # limits of the march
FRAMES = 4  # timed ones of a launch
Row = dict[str, Any]


@dataclass(frozen=True)
class Point:
    """A program (Dr.Jit, or a phase) on a scene by some limits of the march, on a number of threads."""

    program: str
    scene: str
    limits: str
    threads: int


@dataclass(frozen=True)
class Rival:
    """The Python that has Dr.Jit, and the LLVM it compiles with."""

    python: Path
    llvm: Path

    def command(
        self, path: Path, width: int, height: int, threads: int, out: Path | None = None
    ) -> list[str]:
        numbers = map(str, (width, height, threads, FRAMES))
        return [str(self.python), "-I", str(WORKER), str(path), *numbers, *([str(out)] if out else [])]


def llvm_version(path: Path) -> int | None:
    """Major version of a libLLVM; None where it cannot be loaded or is older than its own question, 16."""
    try:
        ask = ctypes.CDLL(str(path)).LLVMGetVersion
    except (OSError, AttributeError):
        return None
    parts = [ctypes.c_uint() for _ in range(3)]
    ask(*map(ctypes.byref, parts))
    return parts[0].value


def find_llvm(given: str | None, folders: Iterable[Path] | None = None) -> Path:
    """The LLVM that is named, or the newest of the system's. Raises StudyError: none is new enough."""
    if given:
        found = [Path(given)]
    else:
        where = folders or [Path("/usr/lib/x86_64-linux-gnu"), *Path("/usr/lib").glob("llvm-*/lib")]
        found = [path for folder in where for path in folder.glob("libLLVM*.so*")]
    versions = {path.resolve(): llvm_version(path) for path in found}
    able = {path: version for path, version in versions.items() if version and version >= OLDEST}
    if not able:
        seen = ", ".join(sorted(path.name for path in versions)) or "none"
        raise StudyError(
            f"libLLVM {OLDEST} or newer is missing (found: {seen}): install libllvm19, or name one in "
            f"DRJIT_LIBLLVM_PATH; {ADDS}",
            CANNOT_RUN,
        )
    return max(able, key=lambda path: (able[path], str(path)))


def find_python(given: Path | None, home: Path = HOME) -> Path:
    """The Python that is named, or one of our own in build/drjit, made now. Raises StudyError."""
    if given:
        if not venvs.has(given, NEEDED):
            raise StudyError(f"{given}: is no Python with drjit and numpy; {ADDS}", CANNOT_RUN)
        return given
    python = venvs.python_of(home)
    if not venvs.has(python, NEEDED):
        try:
            venvs.install(home, PACKAGES)
        except StudyError as error:
            raise StudyError(f"drjit is missing: {error}; {ADDS}", CANNOT_RUN) from None
    return python


def scene_of(name: str, limits: str, folder: Path) -> Path:
    """The scene without shadows, by its own limits of the march or by Dr.Jit's; written into `folder`."""
    data = registry.find_scene(name).data
    march = data["march"] | ({"max_steps": STEPS, "hit_distance": HIT} if limits == SAME else {})
    made = {**data, "light": {**data["light"], "shadows": "none"}, "march": march}
    path = folder / f"{name}-{'own' if limits == OWN else 'same'}.json"
    store.write_json(path, made)
    return path


def points(specs: Sequence[Spec], scenes: Sequence[str], threads: Sequence[int]) -> list[Point]:
    """Dr.Jit by its limits, every phase by these and by the scene's own."""
    made = []
    for scene in scenes:
        for count in dict.fromkeys(threads):
            made.append(Point(DRJIT, scene, SAME, count))
            able = [s for s in specs if count == 1 or registry.find_phase(s.phase).threads]
            made += [Point(str(spec), scene, limits, count) for limits in (OWN, SAME) for spec in able]
    return made


class Measuring:
    """Renders and times points; `scratch`: a folder for scenes and pictures."""

    def __init__(self, rival: Rival, height: int, cpu: int, scratch: Path) -> None:
        self.rival, self.height, self.cpu, self.scratch = rival, height, cpu, scratch
        self.scene = functools.cache(lambda name, limits: scene_of(name, limits, scratch))
        doubles = [name for name, phase in registry.ladder().items() if phase.precision == "double"]
        self.reference = [name for name in doubles if registry.cpu_supports(Spec.parse(name))][-1]
        self._references: dict[tuple[str, str], images.Picture] = {}

    def size(self, point: Point) -> tuple[int, int]:
        return registry.find_scene(point.scene).size(self.height)

    def rival_run(self, point: Point, padding: int = 0, out: Path | None = None) -> Row:
        """One launch of Dr.Jit's program. Raises StudyError with its last line."""
        command = self.rival.command(
            self.scene(point.scene, point.limits), *self.size(point), point.threads, out
        )
        environment = os.environ | {"DRJIT_LIBLLVM_PATH": str(self.rival.llvm), "HOME": str(HOME)}
        environment |= {"STEPWISE_PADDING": "x" * padding}
        cpus = run.cpu_set(self.cpu, point.threads)
        done = child.run(
            command,
            env=environment,
            capture_output=True,
            text=True,
            preexec_fn=lambda: os.sched_setaffinity(0, cpus or run.USABLE),
        )
        try:
            return json.loads(done.stdout)
        except json.JSONDecodeError:
            said = done.stderr.strip().splitlines()
            raise StudyError(
                f"Dr.Jit on {self.rival.llvm}: {said[-1] if said else done.returncode}", CANNOT_RUN
            ) from None

    def once(self, point: Point, padding: int) -> float:
        """Median ns of a launch's timed frames."""
        if point.program == DRJIT:
            return float(np.median(self.rival_run(point, padding)["ns"]))
        width, height = self.size(point)
        how = {"cpu": self.cpu, "threads": point.threads, "env_bytes": padding, "warmup": 1, "reps": FRAMES}
        path = self.scene(point.scene, point.limits)
        with contextlib.closing(run.frames(point.program, path, height, width, **how)) as made:
            return float(np.median([frame["ns"] for frame in made if not frame["warmup"]]))

    def picture(self, point: Point) -> images.Picture:
        width, height = self.size(point)
        if point.program != DRJIT:
            out = self.scratch / "picture.exr"
            run.render(point.program, self.scene(point.scene, point.limits), height, width, aov=True, out=out)
            return images.read(out)
        out = self.scratch / "picture.npz"
        self.rival_run(point, out=out)
        with np.load(out) as made:
            planes = {name: made["rgb"][..., i] for i, name in enumerate("RGB")}
            planes |= {"Z": made["t"], "id": made["id"]}
        # It keeps no normals and counts no evaluations: neither is compared here.
        zero = np.zeros((height, width), np.float32)
        planes |= dict.fromkeys(("N.x", "N.y", "N.z", "evals"), zero)
        return {name: np.asarray(plane, np.float32) for name, plane in planes.items()}

    def errors(self, point: Point) -> Row:
        """To the double picture by the same limits, and in `to_own` to that by the scene's own."""
        made, fractal = self.picture(point), registry.find_scene(point.scene).fractal
        both = {
            limits: frames.against(self._reference(point, limits), made, fractal) for limits in (SAME, OWN)
        }
        return {"reference": self.reference, **both[point.limits], "to_own": both[OWN]}

    def _reference(self, point: Point, limits: str) -> images.Picture:
        key = point.scene, limits
        if key not in self._references:
            self._references[key] = self.picture(Point(self.reference, point.scene, limits, 1))
        return self._references[key]


def rows(times: dict[Point, list[float]], errors: dict[Point, Row], published: bool) -> list[Row]:
    """One per point: ms, times as fast as Dr.Jit on as many threads. `published`: at the figures' size."""
    made = []
    for point, ns in times.items():
        goal, figures = GOALS[point.scene]
        base = times[Point(DRJIT, point.scene, SAME, point.threads)]
        rival = point.program == DRJIT
        ratio = None if rival else stats.ratio_interval(base, ns)
        theirs = figures[point.threads - 1] if published and point.threads in (1, 2) else None
        made.append(
            {
                **{"program": point.program, "scene": point.scene, "limits": point.limits},
                **{"threads": point.threads, "ns": ns, "ms": stats.median_interval(np.array(ns) * 1e-6)},
                **{"ratio": ratio, "goal": None if rival else goal, "published_ms": theirs},
                # What Dr.Jit's own limits make of a picture is no goal of ours.
                "verdict": verdicts.goal(ratio, goal) if ratio and point.limits == OWN else None,
                **errors[Point(point.program, point.scene, point.limits, 1)],
            }
        )
    return made


def read(path: Path) -> Row:
    """A run's drjit.json; without that file no row. Raises StudyError for another thing's JSON."""
    if not path.exists():
        return {"rows": []}
    return DrJit.read(path)


def say_versions(path: Path) -> str:
    """`libLLVM.so.19.1 (19)`."""
    return f"{path.name} ({llvm_version(path) or re.sub('[^0-9]', '', path.name)})"
