"""A copy of the project's sources, for tests that change them."""

import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

from study.commands.upkeep.artifact import MANIFEST
from study.core.registry import ROOT

LEFT_OUT = (".git", ".venv", "build", "results/reference", "__pycache__")


def names() -> list[str]:
    """The project's files: what git knows, in an unpacked artifact what its MANIFEST lists."""
    if (ROOT / MANIFEST).is_file():
        return [line.partition("  ")[2] for line in (ROOT / MANIFEST).read_text().splitlines()]
    return subprocess.check_output(["git", "ls-files"], cwd=ROOT, text=True).splitlines()


def sources(folder: Path) -> Path:
    """The folder, with the sources and this project's packages: nothing that was built, no published run."""
    for name in names():
        if not name.startswith(LEFT_OUT) and (ROOT / name).is_file():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, folder / name)
    (folder / ".venv").symlink_to(ROOT / ".venv")
    return folder


def folders(to: Path, *names: str, without: Sequence[str] = ("__pycache__",)) -> Path:
    """`to`, with these folders of the project: without what other workers may write and remove meanwhile."""
    for name in names:
        shutil.copytree(ROOT / name, to / name, ignore=shutil.ignore_patterns(*without))
    return to


def built(folder: Path, *phases: str) -> Path:
    """The folder, with what this project has built of common/, of ground truth and of these phases. Nothing
    of it is built again whose sources have the times of this project's, or older ones."""
    names = [f"build/{name}" for name in ("common", "truth", *phases) if (ROOT / "build" / name).is_dir()]
    return folders(folder, *names, without=(".*", "kept", "parsed"))
