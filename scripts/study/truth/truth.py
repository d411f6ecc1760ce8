"""The exact picture of a scene, as near as it can be had: rendered once by truth, then kept.

A cached file is there whole or not at all; its name has hashes of the scene's values and of the program.
"""

import hashlib
import json
import os
import shutil
from pathlib import Path
from typing import Any

from study.core import cli, run, store, temporary
from study.core.build import build
from study.core.cli import StudyError
from study.core.registry import ROOT, Scene
from study.pictures import images
from study.pictures.images import Picture

CACHE = ROOT / "build" / "truth" / "cache"
PROVED, MARCHED, UNDECIDED = 2, 1, 0
Size = tuple[int, int]  # width, height


def scene_hash(data: dict[str, Any]) -> str:
    """16 hexadecimal digits of the scene's values, whatever their spelling and order."""
    doubles = json.loads(json.dumps(data), parse_int=float)  # 1 and 1.0 are one scene
    text = json.dumps(doubles, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def path_of(scene: Scene, size: Size) -> Path:
    program = hashlib.sha256(build("truth").read_bytes()).hexdigest()[:16]
    return CACHE / f"{scene_hash(scene.data)}-{size[0]}x{size[1]}-{program}.exr"


def picture(scene: Scene, size: Size) -> Picture:
    """Its planes as pictures.images.read gives them, rendered if they are not cached. Raises StudyError."""
    return images.read(make(scene, size))


def make(scene: Scene, size: Size, threads: int | None = None) -> Path:
    """Path of the cached picture, rendered by `threads` (default: CPUs) if need be."""
    path = path_of(scene, size)
    if path.exists():
        return path
    store.writable(CACHE)
    cli.doing(f"truth of {scene.name}, {size[0]}×{size[1]}: made once, then kept")
    _sweep()
    try:
        # Named by this process: a killed run's folder is known for what it is, and swept by the next one.
        with temporary.folder(CACHE, f".{os.getpid()}.") as folder:
            done, cpus = folder / "picture.exr", threads or len(os.sched_getaffinity(0))
            run.render("truth", scene.path, size[1], size[0], aov=True, out=done, threads=cpus, timed=False)
            if path_of(scene, size) != path:
                raise StudyError("build/truth/render has changed meanwhile: once more")
            done.replace(path)
    except OSError as error:
        raise StudyError(f"{path}: cannot be written: {error.strerror}") from None
    return path


def _sweep() -> None:
    """Removes what killed runs left: folders of processes that are no more."""
    for folder in CACHE.glob(".*.*"):
        pid = folder.name.split(".")[1]
        if folder.is_dir() and pid.isdecimal() and not Path(f"/proc/{pid}").exists():
            shutil.rmtree(folder, ignore_errors=True)
