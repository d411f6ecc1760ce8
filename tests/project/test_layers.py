"""The packages of scripts/study: which may import which, how large they are, and no circles."""

from __future__ import annotations

from pathlib import Path

import pytest

from study.core import imports
from study.core.registry import ROOT

STUDY = ROOT / "scripts" / "study"
ORDER = [
    "core",
    "numbers",
    "pictures",
    "truth",
    "counting",
    "bounds",
    "measuring",
    "experiments",
    "claims",
    "report",
    "commands",
]
MODULES = 20  # of a folder at most
FILES = sorted(path for path in STUDY.rglob("*.py") if "__pycache__" not in path.parts)


def module(path: Path) -> str:
    name = ".".join(path.relative_to(STUDY.parent).with_suffix("").parts)
    return name.removesuffix(".__init__")


NAMES = {module(path) for path in FILES}


def imported(path: Path) -> set[str]:
    """Modules of the study that a file imports by name."""
    found = set()
    for name in imports.named(path, "study"):
        while name not in NAMES and "." in name:
            name = name.rpartition(".")[0]
        if name in NAMES and name != "study":
            found.add(name)
    return found - {module(path)}


def upward(path: Path, names: set[str]) -> set[str]:
    """Of the imported modules those of packages that come later than the file's own."""
    own = path.relative_to(STUDY).parts[0]
    level = ORDER.index(own)
    return {name for name in names if ORDER.index(name.split(".")[1]) > level}


def circles(edges: dict[str, set[str]]) -> set[str]:
    """Nodes that lie on a circle, or only between circles."""
    left = {node: {other for other in others if other in edges} for node, others in edges.items()}
    while ends := [node for node, others in left.items() if not others & left.keys()]:
        for node in ends:
            del left[node]
    return set(left)


def test_every_package_has_its_place() -> None:
    folders = {path.name for path in STUDY.iterdir() if path.is_dir() and path.name != "__pycache__"}
    assert folders == set(ORDER)


def test_imports_go_down_only() -> None:
    wrong = {str(path): found for path in FILES[1:] if (found := upward(path, imported(path)))}
    assert not wrong


def test_an_import_that_goes_up_is_seen() -> None:
    assert upward(STUDY / "core" / "store.py", {"study.core.cli", "study.report.facts"}) == {
        "study.report.facts"
    }


def test_no_modules_import_one_another() -> None:
    edges = {module(path): imported(path) for path in FILES}
    packages = {name for name in NAMES if (STUDY.parent / name.replace(".", "/")).is_dir()}
    assert not circles({name: others - packages for name, others in edges.items() if name not in packages})


def test_experiments_do_not_go_in_circles() -> None:
    edges: dict[str, set[str]] = {}
    for path in (STUDY / "experiments").glob("*/*.py"):
        others = {n.split(".")[2] for n in imported(path) if n.startswith("study.experiments.")}
        mine = edges.setdefault(path.parent.name, set())
        mine |= others - {path.parent.name, "section", "experiment"}
    assert not circles(edges)


@pytest.mark.parametrize(
    ("edges", "found"),
    [
        ({"a": {"b"}, "b": {"c"}, "c": set()}, set()),
        ({"a": {"b"}, "b": {"a"}, "c": {"a"}}, {"a", "b", "c"}),
    ],
)
def test_circles_by_hand(edges: dict[str, set[str]], found: set[str]) -> None:
    assert circles(edges) == found


@pytest.mark.parametrize("folder", sorted({path.parent for path in FILES}), ids=lambda path: path.name)
def test_a_folder_has_at_most_so_many_modules(folder: Path) -> None:
    assert len([path for path in folder.glob("*.py") if path.name != "__init__.py"]) <= MODULES


@pytest.mark.parametrize("path", FILES, ids=module)
def test_a_module_says_what_it_is_and_is_not_long(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert text.startswith('"""') and len(text.splitlines()) <= 400
