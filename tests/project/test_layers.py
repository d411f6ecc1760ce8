"""The packages of scripts/study: which may import which, how large they are, and no circles."""

from __future__ import annotations

import functools
from pathlib import Path

from helpers import imports
from study.core.registry import ROOT

STUDY = ROOT / "scripts" / "study"
ORDER = ["core", "numbers", "pictures", "truth", "counting", "bounds", "measuring", "experiments", "claims"]
ORDER += ["report", "labs", "commands"]
# What every experiment of study/experiments may import beside the packages below.
BASE = {"experiment", "section", "running", "cuts", "shards", "venvs", "keys"}
MOST_FILES, MOST_LINES = 20, 400  # of a folder, of a module
FILES = sorted(path for path in STUDY.rglob("*.py") if "__pycache__" not in path.parts)


def module(path: Path) -> str:
    return ".".join(path.relative_to(STUDY.parent).with_suffix("").parts).removesuffix(".__init__")


NAMES = {module(path) for path in FILES}


def imported(path: Path) -> set[str]:
    """Modules of the study that a file imports by name."""
    found = set()
    for name in imports.named(path):
        while name not in NAMES and "." in name:
            name = name.rpartition(".")[0]
        if name in NAMES and name != "study":
            found.add(name)
    return found - {module(path)}


@functools.cache
def edges() -> dict[str, set[str]]:
    return {module(path): imported(path) for path in FILES}


def upward(name: str, others: set[str]) -> set[str]:
    """Imported modules of packages that come later than the module's own."""
    level = ORDER.index(name.split(".")[1])
    return {other for other in others if ORDER.index(other.split(".")[1]) > level}


def experiment_of(name: str) -> str | None:
    """The named experiment that a module is of."""
    words = name.split(".")
    return words[2] if len(words) > 2 and words[1] == "experiments" and words[2] not in BASE else None


def test_every_package_has_its_place() -> None:
    folders = {path.name for path in STUDY.iterdir() if path.is_dir() and path.name != "__pycache__"}
    assert folders == set(ORDER)


def test_imports_go_down_only() -> None:
    assert {
        name: up for name, others in edges().items() if name != "study" and (up := upward(name, others))
    } == {}


def test_no_modules_import_one_another() -> None:
    packages = {name for name in NAMES if (STUDY.parent / name.replace(".", "/")).is_dir()}
    assert imports.cycle({name: edges()[name] - packages for name in NAMES - packages}) == []


def test_an_experiment_knows_no_other_and_nothing_above_knows_one_by_name() -> None:
    """They are known by their objects (study.experiments.experiment)."""
    wrong = {
        name: found
        for name, others in edges().items()
        if (found := {o for o in others if experiment_of(o) and experiment_of(o) != experiment_of(name)})
    }
    assert wrong == {}


def test_a_folder_has_few_modules_and_a_module_few_lines() -> None:
    folders: dict[Path, int] = {}
    for path in FILES:
        text = path.read_text(encoding="utf-8")
        assert text.startswith('"""') and len(text.splitlines()) <= MOST_LINES, path
        folders[path.parent] = folders.get(path.parent, 0) + (path.name != "__init__.py")
    assert {str(folder): count for folder, count in folders.items() if count > MOST_FILES} == {}
