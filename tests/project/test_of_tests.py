"""Rules for the tests themselves."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

from helpers import imports

TESTS = Path(__file__).parents[1]
FILES = sorted(path for path in TESTS.rglob("*.py") if "__pycache__" not in path.parts)
MOST_LINES, MOST_FILES = 500, 20
SOURCES = sorted({*FILES, *TESTS.rglob("*.[ch]")})


def test_no_module_imports_a_test() -> None:
    """What tests share stands in a module that is none: a test may be moved or left out by itself."""
    tests = {path.stem for path in FILES if path.stem.startswith("test_")}
    for path in FILES:
        words = {word for name in imports.named(path) for word in name.split(".")[:-1] or [name]}
        assert not words & tests, path


def test_files_are_short_and_folders_are_small() -> None:
    long = {str(p.relative_to(TESTS)): n for p in SOURCES if (n := p.read_bytes().count(b"\n")) > MOST_LINES}
    folders = Counter(str(path.parent.relative_to(TESTS)) for path in SOURCES)
    assert (long, {name: n for name, n in folders.items() if n > MOST_FILES}) == ({}, {})
