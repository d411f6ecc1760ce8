"""What a module imports, by its text; and what a calibration is kept for."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from study.core import imports
from study.counting import backend

FILES = {
    "__init__.py": "",
    "top.py": "import numpy.typing\nfrom toy import low\nfrom toy.sub import deep\nimport json\n",
    "low.py": "VALUE = 1\n",
    "page.py": "from toy import top\n",
    "sub/__init__.py": "from .deep import NAME\n",
    "sub/deep.py": "from ..far import away as here\nNAME = 1\ndef f():\n    import pandas\n",
    "far/__init__.py": "",
    "far/away.py": "",
}


@pytest.fixture
def toy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    folder = tmp_path / "toy"
    for name, text in FILES.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    yield folder
    for name in [name for name in sys.modules if name.partition(".")[0] == "toy"]:
        del sys.modules[name]


def names(found: imports.Imported, folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in found.files}


def test_imports_are_followed_wherever_they_stand(toy: Path) -> None:
    found = imports.closure("toy.top")
    assert names(found, toy) == set(FILES) - {"page.py"}
    assert found.packages == {"numpy", "pandas"}
    assert names(imports.closure("toy.low"), toy) == {"__init__.py", "low.py"}
    with pytest.raises(ModuleNotFoundError):
        imports.closure("toy.nothing")


@pytest.mark.parametrize(
    ("changed", "again"), [("top.py", True), ("sub/deep.py", True), ("far/away.py", True), ("page.py", False)]
)
def test_known_work_is_counted_again_when_the_analysis_changes_and_for_no_page(
    changed: str, again: bool, toy: Path, tmp_path: Path
) -> None:
    counted: list[str] = []

    def calibrate(part: str) -> list[str]:
        counted.append(part)
        return []

    def known() -> bool:
        return backend.known_work(tmp_path / "known.json", "toy.top", [], ["sse"], calibrate)

    assert known() and known() and len(counted) == 1
    path = toy / changed
    path.write_text(path.read_text() + "# changed\n")
    assert known() and (len(counted) == 2) is again


def test_another_version_of_a_package_is_another_analysis(
    toy: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    counted: list[str] = []
    for version in ("1.0", "1.0", "2.0"):
        monkeypatch.setattr(backend.metadata, "version", lambda _, version=version: version)
        backend.known_work(tmp_path / "known.json", "toy.top", [], ["sse"], lambda p: counted.append(p) or [])
    assert len(counted) == 2


@pytest.mark.parametrize("module", ["study.counting.blocks", "study.counting.qemu", "study.counting.ptrace"])
def test_a_back_end_rests_on_its_decoder_and_on_no_page(module: str) -> None:
    found = imports.closure(module)
    stems = {path.stem for path in found.files}
    assert {"decode", "counts", "calibration", "backend", "elf"} <= stems
    assert {"iced_x86", "elftools"} <= found.packages
    assert not stems & {"show", "draw", "section", "tables", "figures"}
