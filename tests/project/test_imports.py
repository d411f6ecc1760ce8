"""What a module imports, by its text."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from study.core import imports

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
