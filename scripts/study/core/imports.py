"""What a module imports, itself and by others: files of its own package, X.

Read from the text, so that nothing runs. An import by a computed name (importlib) is not seen.
"""

from __future__ import annotations

import ast
import importlib.util
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Imported:
    """`files`: of the own package, sorted. `packages`: other packages, none of the standard library."""

    files: list[Path]
    packages: set[str]


def closure(*modules: str) -> Imported:
    """Everything that those modules import, with their own files. All are of one package, by full name.

    ModuleNotFoundError for a module that is not there.
    """
    package = modules[0].partition(".")[0]
    waiting, files, packages = list(modules), {}, set()
    while waiting:
        name = waiting.pop()
        if name in files:
            continue
        spec = importlib.util.find_spec(name)
        if spec is None or spec.origin is None:
            raise ModuleNotFoundError(f"no module {name}", name=name)
        files[name] = Path(spec.origin)
        waiting += _parents(name)
        home = name if spec.submodule_search_locations is not None else name.rpartition(".")[0]
        for found in named(files[name], home):
            if found.partition(".")[0] == package:
                waiting += _modules(found)
            else:
                packages.add(found.partition(".")[0])
    return Imported(sorted(files.values()), packages - sys.stdlib_module_names)


def named(path: Path, package: str = "") -> Iterator[str]:
    """Full names that the file imports; `from a import b` gives `a.b`, which may be no module.

    `package`: which relative imports start from.
    """
    for node in ast.walk(ast.parse(path.read_bytes(), str(path))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                above = package.split(".")[: len(package.split(".")) - node.level + 1]
                base = ".".join([*above, *([base] if base else [])])
            yield from (f"{base}.{alias.name}" for alias in node.names)


def _parents(name: str) -> list[str]:
    words = name.split(".")
    return [".".join(words[:count]) for count in range(1, len(words))]


def _modules(name: str) -> list[str]:
    """The module that an imported name is, or is in."""
    try:
        found = importlib.util.find_spec(name) is not None
    except ModuleNotFoundError:  # of a name within a module that is no package
        found = False
    return [name] if found else [name.rpartition(".")[0]]
