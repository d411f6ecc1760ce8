"""Float pictures by the driver, kept in a folder so that none is rendered twice and none can be stale."""

import hashlib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from study.core import progress
from study.core.build import build
from study.core.cli import BAD_INPUT, StudyError
from study.core.registry import Scene, Spec
from study.core.run import DriverError, render
from study.pictures import images

Size = tuple[int, int]  # width, height
Task = tuple[Spec, Scene, Size]


def sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


class Gallery:
    """Pictures in a folder, rendered once per binary, scene and size: file names have a hash of these."""

    def __init__(self, folder: Path, specs: list[Spec]) -> None:
        self.folder = folder
        self.programs = {spec: build(spec) for spec in specs}
        self.hashes = {spec: sha256(path) for spec, path in self.programs.items()}
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise StudyError(f"{folder}: cannot be made: {error.strerror}") from None

    def stem(self, spec: Spec, scene: Scene, size: Size) -> str:
        return f"{scene.name}-{spec}-{size[0]}x{size[1]}"

    def path(self, spec: Spec, scene: Scene, size: Size) -> Path:
        made_of = hashlib.sha256(f"{self.hashes[spec]} {sha256(scene.path)}".encode()).hexdigest()[:12]
        return self.folder / f"{self.stem(spec, scene, size)}-{made_of}.exr"

    def render(self, spec: Spec, scene: Scene, size: Size) -> None:
        """Renders the picture unless it is there already. Raises DriverError."""
        path = self.path(spec, scene, size)
        if path.exists():
            return
        render(spec, scene.path, size[1], size[0], aov=True, out=path, timed=False)
        if sha256(self.programs[spec]) != self.hashes[spec]:
            path.unlink()
            raise StudyError(f"{self.programs[spec]} has changed meanwhile: verify again")
        for old in self.folder.glob(f"{self.stem(spec, scene, size)}-{'[0-9a-f]' * 12}.exr"):
            if old != path:
                old.unlink(missing_ok=True)

    def png(self, name: str, linear: np.ndarray) -> str:
        images.write_png(self.folder / f"{name}.png", images.to_display(linear))
        return f"{self.folder.name}/{name}.png"

    def render_all(self, tasks: list[Task], jobs: int) -> dict[tuple[Spec, str], DriverError]:
        """Renders every picture once, `jobs` at a time. Returns what failed, by spec and scene name. Raises
        DriverError for what is the user's to mend: a size that cannot be, a full disk."""

        def one(task: Task) -> DriverError | None:
            try:
                self.render(*task)
            except DriverError as error:
                if error.status == BAD_INPUT:
                    raise
                return error
            return None

        once = list({self.path(*task): task for task in tasks}.values())
        with ThreadPoolExecutor(jobs) as pool:
            outcomes = list(progress.each(pool.map(one, once), "render", len(once)))
        return {(task[0], task[1].name): error for task, error in zip(once, outcomes, strict=True) if error}
