"""Runs a phase's driver and probe for the tests, and checks what must hold of any picture.

STEPWISE_BUILD names another build folder (build/asan): its programs must be there, and the suite is a
reduced one, since sanitised programs are slow.
"""

from __future__ import annotations

import functools
import hashlib
import json
import os
import shutil
import subprocess
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from processes import only_warned

from conformance import geometry
from study.core import build, registry
from study.core.registry import ROOT
from study.core.run import UNTIMED
from study.pictures import images
from study.pictures.images import Picture
from study.truth.judging import PROVED

BUILD = os.environ.get("STEPWISE_BUILD", "build")
REDUCED = BUILD != "build"
# Scenes stay here, so that a failure can be run again; scripts/stepwise random takes them from elsewhere.
KEPT = Path(os.environ.get("STEPWISE_KEPT", ROOT / BUILD / "test-scenes"))
PHASES = list(registry.phases())
REFERENCE = next(name for name, phase in registry.phases().items() if phase.parent is None)
HITS = ("Z", "id", "N.x", "N.y", "N.z")
TRUTH = next(name for name, phase in registry.phases().items() if phase.family == registry.TRUTH)


@functools.cache
def binary(phase: str, target: str = "render") -> Path:
    """Path of the program; the default build is brought up to date, another one must be there."""
    path = ROOT / BUILD / phase / target
    if not REDUCED:
        return build.build(phase, target)
    assert path.is_file(), f"{path} is missing; run `make check-all PART=builds` first"
    return path


def keep(name: str, scene: dict) -> Path:
    """Write the scene under its name, where a failing test leaves it."""
    KEPT.mkdir(parents=True, exist_ok=True)
    path = KEPT / f"{name}.json"
    temporary = path.with_suffix(f".{os.getpid()}")
    temporary.write_text(json.dumps(scene, indent=1))
    temporary.replace(path)
    return path


@dataclass
class Run:
    """One call of the driver. Its text is the command line: what to run to see the failure again."""

    command: list[str]
    status: int
    stdout: str
    stderr: str
    scene: dict | None = None
    picture: dict[str, np.ndarray] | None = None

    def __str__(self) -> str:
        return f"[{' '.join(self.command)}] status {self.status} {self.stderr.strip()}"

    @property
    def drawn(self) -> bool:
        """Whether it ended well, and said no more than warnings."""
        return self.status == 0 and only_warned(self.stderr)

    @property
    def record(self) -> dict:
        return json.loads(self.stdout)


def call(
    phase: str,
    *arguments: str | Path | int,
    env: dict[str, str] | None = None,
    timeout: float = 300,
    timed: bool = False,
    once: Path | None = None,
) -> Run:
    """The driver with these arguments, whatever comes of it. Not `timed`: clocks, 25 ms a call, are not.
    `once`: the picture among them, if a kept one will do."""
    command = [str(binary(phase).relative_to(ROOT)), *map(str, arguments)]
    environment = os.environ | {UNTIMED: "1"} | (env or {})
    if timed:
        del environment[UNTIMED]
    how = {"cwd": ROOT, "timeout": timeout, "env": environment}
    if once:
        done = drawn_once(command, once, **how)
    else:
        done = subprocess.run(command, capture_output=True, text=True, **how)
    return Run(command, done.returncode, done.stdout, done.stderr)


def check_refusal(run: Run, status: int) -> None:
    """That status, one line on standard error, nothing on standard output."""
    assert run.status == status, f"{run}: status should be {status}"
    assert run.stderr.startswith("render: ") and run.stderr.count("\n") == 1, f"{run}: not one line"
    assert run.stderr.endswith("\n") and len(run.stderr) > 20, f"{run}: not one line"
    assert run.stdout == "", f"{run}: standard output is not empty"


class Unsupported(Exception):
    """The phase says that it does not render this scene: allowed, and counted."""


@functools.cache
def shelf(program: Path, changed_ns: int) -> Path:
    """Folder of the pictures that this program has drawn, by its bytes; those of another one go."""
    own = program.parent / "kept" / hashlib.sha256(program.read_bytes()).hexdigest()[:16]
    own.mkdir(parents=True, exist_ok=True)
    for other in own.parent.iterdir():
        if other != own:
            shutil.rmtree(other, ignore_errors=True)
    return own


# Phases that others are held against. A picture of theirs is drawn once and kept beside the program, for this
# run of the tests and the next: ground truth takes seconds. test_same_call_same_bits draws anew.
BESIDE = (REFERENCE, TRUTH)
MATTER = ("STEPWISE_ISA_LIMIT", "STEPWISE_UNTIMED", "GLIBC_TUNABLES")


def drawn_once(command: list[str], picture: Path, **how: Any) -> subprocess.CompletedProcess[str]:
    """The driver's run (program, scene, options), or what is kept of the same one; `picture`: its file."""
    program, scene = ROOT / command[0], ROOT / command[1]
    told = [word for word in command[2:] if word != str(picture)]
    told += [f"{name}={how['env'].get(name, '')}" for name in MATTER]
    asked = json.dumps([scene.name, *told, json.loads(scene.read_text())])
    key = hashlib.sha256(asked.encode()).hexdigest()[:24]
    kept = shelf(program, program.stat().st_mtime_ns) / f"{key}.exr"
    record = kept.with_suffix(".json")
    if kept.is_file():
        shutil.copyfile(kept, picture)
        return subprocess.CompletedProcess(command, 0, *json.loads(record.read_text()))
    done = subprocess.run(command, capture_output=True, text=True, **how)
    if done.returncode == 0:
        new = kept.with_suffix(f".{os.getpid()}")
        new.write_text(json.dumps([done.stdout, done.stderr]))
        new.replace(record)
        shutil.copyfile(picture, new)
        new.replace(kept)
    return done


def render(
    phase: str, scene: Path, width: int, height: int, *options: str | int, aov=True, anew=False
) -> Run:
    """A picture; not `anew`: one that is kept will do. Raises Unsupported if the phase refuses the scene,
    properly, as not for it."""
    picture = KEPT / f"{phase}.{os.getpid()}.exr"
    KEPT.mkdir(parents=True, exist_ok=True)
    try:
        words = ["-n", height, "-w", width, "-o", picture, "--json", *["--aov"] * aov, *options]
        run = call(phase, scene, *words, once=None if anew or phase not in BESIDE else picture)
        if run.status == 4:
            check_refusal(run, 4)
            raise Unsupported(run.stderr.strip())
        assert run.drawn, f"{run}"
        run.scene = json.loads(scene.read_text())
        run.picture = images.read(picture)
    finally:
        picture.unlink(missing_ok=True)
    size = run.picture["R"].shape
    assert size == (height, width), f"{run}: the picture is {size}"
    return run


@functools.cache
def reference(scene: Path, width: int, height: int, *options: str | int, phase: str = REFERENCE) -> Run:
    """The picture that another is held against: of the phase without a parent, or the proved one."""
    return render(phase, scene, width, height, *options)


FAR = {"Z", "surface.Z"}  # +inf where nothing is hit
COLOURS = {f"surface.{kind}{channel}" for kind in ("", "ideal.") for channel in "RGB"}  # NaN where undecided


def check_picture(run: Run) -> None:
    """What holds of any picture of any phase, without knowing another."""
    p, scene, limits = run.picture, run.scene, run.record
    phase = registry.phases()[limits["phase"]]
    assert sorted(p) == sorted([*images.AOVS, *phase.planes]), f"{run}: channels {sorted(p)}"
    bad = {name: int((~np.isfinite(plane)).sum()) for name, plane in p.items() if name not in FAR | COLOURS}
    assert not any(bad.values()), f"{run}: samples that are not finite: {bad}"
    for far in FAR & p.keys():
        missed = p[far.replace("Z", "id")] == -1
        assert np.array_equal(p[far] == np.inf, missed), f"{run}: {far} is not +inf exactly where id is -1"
        assert np.isfinite(p[far][~missed]).all(), f"{run}: NaN or -inf in {far}"
    miss = p["id"] == -1
    assert np.isin(p["id"], range(-1, len(scene["shapes"]))).all(), f"{run}: ids {np.unique(p['id'])}"
    for name in "RGB":
        assert (p[name] >= 0).all(), f"{run}: {name} is negative"
    background = np.array(scene["background"], np.float32)
    assert (images.rgb(p)[miss] == background).all(), f"{run}: a miss is not the background"
    evals = p["evals"]
    assert (evals == np.rint(evals)).all(), f"{run}: evals are not whole"
    most = np.inf if phase.family == registry.TRUTH else limits["max_steps"]  # its evaluations are no steps
    least = p["start"] >= 0 if "start" in p else 1  # none where a whole cone misses
    assert (evals >= least).all() and (evals <= most).all(), (
        f"{run}: evals from {evals.min()} to {evals.max()}"
    )
    normal = np.stack([p["N.x"], p["N.y"], p["N.z"]], axis=-1)
    assert (normal[miss] == 0).all(), f"{run}: a miss has a normal"
    length = np.linalg.norm(normal[~miss], axis=-1)
    assert (np.abs(length - 1) < 1e-5).all(), f"{run}: normals of length {length.min()} to {length.max()}"
    _, directions = geometry.rays(scene, *reversed(miss.shape))
    facing = np.einsum("ijk,ijk->ij", normal, directions)[~miss]
    # 1e-5: a normal square to the ray may have been turned by float rounding
    assert (facing < 1e-5).all(), f"{run}: a normal faces away from its ray by {facing.max()}"


@functools.cache
def drawn_scene(phase: str) -> tuple[str, Path]:
    """Name and path of the first scene that the phase draws, for what is asked of its form:
    scene0, or one that has no torus and no soft shadow."""
    known = registry.scenes()
    for name in ("scene0", "spheres40"):
        if call(phase, known[name].path, "-n", 1).status != 4:
            return name, known[name].path
    raise AssertionError(f"{phase} draws neither scene0 nor spheres40")


def same_bits(a: Run, b: Run, channels: Iterable[str] | None = None) -> None:
    for name in channels or a.picture:
        assert np.array_equal(a.picture[name].view(np.uint32), b.picture[name].view(np.uint32)), (
            f"{a}: channel {name} differs from {b}"
        )


def within_reach(expected: Picture, run: Run, proved: Callable[[], Picture]) -> Picture:
    """What is expected where the reference's rays ran out of steps and the phase's begin nearer to the hit.

    There a hit on the shape that truth has is right, its depth and normal are truth's, and its colour is not
    judged; of any other the reference's miss is expected. One where truth proves that there is none fails.
    """
    picture = run.picture
    if "start" not in picture:
        return expected
    spent = (expected["id"] < 0) & (expected["evals"] >= run.record["max_steps"]) & (picture["start"] > 0)
    found = spent & (picture["id"] >= 0)
    if not found.any():
        return expected
    truth = proved()
    false = found & (truth["id"] < 0) & (truth["status"] == PROVED)
    assert not false.any(), f"{run}: {false.sum()} hits where truth has no surface and the reference no steps"
    right = found & (truth["id"] == picture["id"])
    planes = {**picture, **{name: truth[name] for name in HITS}}
    return {name: np.where(right, planes[name], plane) for name, plane in expected.items()}


def distances(phase: str, scene: Path, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distance and nearest shape at each point (count, 3), in the phase's own arithmetic."""
    raw = np.ascontiguousarray(points, "<f8").tobytes()
    done = subprocess.run(
        [binary(phase, "probe"), scene], cwd=ROOT, input=raw, capture_output=True, timeout=300
    )
    assert done.returncode == 0, f"{phase} probe {scene}: {done.stderr.decode(errors='replace')}"
    pairs = np.frombuffer(done.stdout, "<f8").reshape(-1, 2)
    assert len(pairs) == len(points), f"{phase} probe {scene}: {len(pairs)} answers to {len(points)} points"
    return pairs[:, 0], pairs[:, 1].astype(int)
