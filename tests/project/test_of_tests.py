"""Rules for the tests themselves."""

from __future__ import annotations

from pathlib import Path

import pytest

from study.core import imports

TESTS = Path(__file__).parents[1]
FILES = sorted(path for path in TESTS.rglob("*.py") if "__pycache__" not in path.parts)


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(TESTS)))
def test_no_module_imports_a_test(path: Path) -> None:
    """What tests share stands in a module that is none: a test may be moved or left out by itself."""
    words = {word for name in imports.named(path) for word in name.split(".")[:-1] or [name]}
    tests = {other.stem for other in FILES if other.stem.startswith("test_")}
    assert not words & tests
