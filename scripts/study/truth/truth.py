"""The exact picture of a scene, as near as it can be had: rendered once by truth, then kept.

Undecided primary rays are decided by truth.exact and written back (id, Z, width, status); the pixel's chain
(status.all) stays undecided. Colour, normal and shadow stay the phase's where it had guessed that shape, and
are NaN, that is unjudged, where it had guessed another or had no normal. A cached file is there whole or not
at all; its name has hashes of the scene's values, of the program and of what decides here.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import shutil
import time
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio

from study.core import cli, run, store, temporary
from study.core.build import build
from study.core.cli import StudyError
from study.core.registry import FRACTALS, ROOT, Scene
from study.pictures import images
from study.pictures.images import Picture

CACHE = ROOT / "build" / "truth" / "cache"
PROVED, CONVERGED, UNDECIDED = 2, 1, 0
DECIDERS = ("truth", "exact", "rays", "solids", "algebra")  # modules whose text is part of the name
Size = tuple[int, int]  # width, height


@dataclass(frozen=True)
class Summary:
    """How sure a picture is: shares of its pixels' primary rays, widest enclosure of t, in scene units."""

    scene: str
    width: int
    height: int
    proved: int
    decided_exactly: int  # of the proved ones
    guess_mended: int  # of these, where the phase had guessed another shape
    undecided: int
    converged_only: int
    widest: float
    chain_proved: int  # pixels whose mirror rays are proved too
    seconds: float  # to render and decide; as it was when the picture was made
    cached: bool
    path: str


def _canonical(value: Any) -> Any:
    """Numbers as the doubles that they mean, so that 1 and 1.0 are one scene."""
    if isinstance(value, dict):
        return {key: _canonical(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_canonical(item) for item in value]
    return float(value) + 0.0 if isinstance(value, (int, float)) else value


def scene_hash(data: dict[str, Any]) -> str:
    """16 hexadecimal digits of the scene's values, whatever their spelling and order."""
    text = json.dumps(_canonical(data), sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def program_hash(program: Path) -> str:
    """16 hexadecimal digits of the binary and of the modules that decide after it."""
    digest = hashlib.sha256(program.read_bytes())
    for name in DECIDERS:
        digest.update(Path(__file__).with_name(f"{name}.py").read_bytes())
    return digest.hexdigest()[:16]


def path_of(scene: Scene, size: Size) -> Path:
    """Where the picture is, or would be, cached."""
    program = build("truth")
    return CACHE / f"{scene_hash(scene.data)}-{size[0]}x{size[1]}-{program_hash(program)}.exr"


def picture(scene: Scene, size: Size) -> Picture:
    """Its planes as pictures.images.read gives them, rendered if they are not cached. Raises StudyError."""
    return images.read(make(scene, size))


def make(scene: Scene, size: Size, threads: int | None = None) -> Path:
    """Path of the cached picture, rendered by `threads` (default: CPUs) and decided if need be."""
    path = path_of(scene, size)
    if path.exists():
        return path
    store.writable(CACHE)
    cli.say(f"truth of {scene.name}, {size[0]}×{size[1]}: made once, then kept")
    _sweep()
    try:
        # Named by this process: a killed run's folder is known for what it is, and swept by the next one.
        with temporary.folder(CACHE, f".{os.getpid()}.") as folder:
            done = _rendered(scene, size, folder, threads or len(os.sched_getaffinity(0)))
            if path_of(scene, size) != path:
                raise StudyError("build/truth/render has changed meanwhile: once more")
            done.replace(path)
    except OSError as error:
        raise StudyError(f"{path}: cannot be written: {error.strerror}") from None
    return path


def _rendered(scene: Scene, size: Size, folder: Path, threads: int) -> Path:
    """The exact picture as a file in `folder`, with the count of pixels decided and mended."""
    begun = time.monotonic()
    raw, done = folder / "raw.exr", folder / "done.exr"
    run.render("truth", scene.path, size[1], size[0], aov=True, out=raw, threads=threads, timed=False)
    planes = images.read(raw)
    decided, mended = decide(scene.data, planes)
    _write(done, planes, {"decided": decided, "mended": mended, "seconds": time.monotonic() - begun})
    return done


def _sweep() -> None:
    """Removes what killed runs left: folders of processes that are no more."""
    for folder in CACHE.glob(".*.*"):
        pid = folder.name.split(".")[1]
        if folder.is_dir() and pid.isdecimal() and not Path(f"/proc/{pid}").exists():
            shutil.rmtree(folder, ignore_errors=True)


def _forget(planes: Picture, row: int, column: int) -> None:
    """NaN, which nothing is judged by, for what hangs on the primary hit: normal, colours, shadows."""
    for name in planes:
        if name.startswith(("N.", "ideal.", "none.", "shadow")) or name in ("R", "G", "B"):
            planes[name][row, column] = np.nan


def decide(data: dict[str, Any], planes: Picture) -> tuple[int, int]:
    """Decides undecided primary rays in place. Number of rays decided, and of these found to be otherwise."""
    rows, columns = np.nonzero(planes["status"] == UNDECIDED)
    if not len(rows) or any(shape["type"] in FRACTALS for shape in data["shapes"]):
        return 0, 0
    from study.truth import exact  # flint is needed here only

    scene = exact.Scene.of(data)
    height, width = planes["status"].shape
    decided = mended = 0
    for row, column in zip(rows.tolist(), columns.tolist(), strict=True):
        origin, direction = scene.camera_ray(column, row, width, height)
        found = exact.first_hit(scene, origin, direction)
        if found.status == "undecided":
            continue
        decided += 1
        other = planes["id"][row, column] != found.shape
        mended += int(other)
        if other or (found.shape >= 0 and not any(planes[f"N.{axis}"][row, column] for axis in "xyz")):
            _forget(planes, row, column)
        planes["id"][row, column] = found.shape
        planes["status"][row, column] = PROVED
        if found.low is None or found.high is None:
            planes["Z"][row, column], planes["width"][row, column] = np.inf, 0
        else:
            length = math.sqrt(sum(Fraction(x) ** 2 for x in direction))
            planes["Z"][row, column] = float((found.low + found.high) / 2) * length
            planes["width"][row, column] = float(found.high - found.low) * length
    return decided, mended


def _write(path: Path, planes: Picture, facts: dict[str, float]) -> None:
    """A float EXR of the planes, with facts for `summary` in its header."""
    height, width = planes["status"].shape
    spec = oiio.ImageSpec(width, height, len(planes), "float")
    spec.channelnames = tuple(planes)
    spec.attribute("compression", "zip")
    for name, value in facts.items():
        spec.attribute(f"stepwise:{name}", float(value))
    file = oiio.ImageOutput.create("exr")
    done = file.open(str(path), spec) and file.write_image(np.stack(list(planes.values()), -1))
    if not (file.close() and done):
        raise StudyError(f"{path}: cannot be written: {file.geterror().strip()}")


def summary(scene: Scene, size: Size, threads: int | None = None) -> Summary:
    """Counts of the cached picture, which is made if it is not there."""
    cached = path_of(scene, size).exists()
    path = make(scene, size, threads)
    planes = images.read(path)
    file = oiio.ImageInput.open(str(path))
    try:
        facts = {k: file.spec().getattribute(f"stepwise:{k}") for k in ("decided", "mended", "seconds")}
    finally:
        file.close()
    status = planes["status"]
    if not np.isin(status, (PROVED, CONVERGED, UNDECIDED)).all():
        raise StudyError(f"{path}: a status that is not {PROVED}, {CONVERGED} or {UNDECIDED}")
    widths = planes["width"][status == PROVED]
    return Summary(
        scene=scene.name,
        width=size[0],
        height=size[1],
        proved=int((status == PROVED).sum()),
        decided_exactly=int(facts["decided"]),
        guess_mended=int(facts["mended"]),
        undecided=int((status == UNDECIDED).sum()),
        converged_only=int((status == CONVERGED).sum()),
        widest=float(widths.max(initial=0)),
        chain_proved=int((planes["status.all"] == PROVED).sum()),
        seconds=float(facts["seconds"]),
        cached=cached,
        path=str(path.relative_to(ROOT) if path.is_relative_to(ROOT) else path),
    )
