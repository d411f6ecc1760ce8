"""What a module imports, by its text: nothing runs."""

from __future__ import annotations

import ast
import graphlib
from collections.abc import Iterator
from pathlib import Path


def named(path: Path) -> Iterator[str]:
    """Full names that the file imports; `from a import b` gives `a.b`, which may be no module."""
    for node in ast.walk(ast.parse(path.read_bytes(), str(path))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.module and not node.level, f"{path}:{node.lineno}: a relative import"
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def cycle(graph: dict[str, set[str]]) -> list[str]:
    """The names along a cycle of a graph, or none."""
    try:
        graphlib.TopologicalSorter(graph).prepare()
    except graphlib.CycleError as error:
        return list(error.args[1])
    return []
