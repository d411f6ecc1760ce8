"""Rules of the house for C code: sizes of files, functions and folders, depth of includes, and no cycles."""

from __future__ import annotations

import graphlib
import re
import subprocess
from pathlib import Path

import pytest
from imports import cycle

from study.core import patches, registry
from study.core.build import build
from study.core.registry import ROOT

FILES = sorted(
    path
    for folder in ("common", "phases", "systems", "truth")
    for path in (ROOT / folder).rglob("*.[ch]")
    if "/." not in str(path.relative_to(ROOT))
)
MOST_LINES, MOST_FILES, MOST_FUNCTION, MOST_INCLUDES = 400, 20, 60, 5
HEAD = re.compile(r"^(?!typedef|struct \w+ \{|enum|union|#)[A-Za-z_].*[^;]$")


def functions(path: Path) -> dict[str, int]:
    """Lines of each function of a formatted source, by its first line."""
    found, start, lines = {}, None, path.read_text().splitlines()
    for number, line in enumerate(lines):
        if start is None and HEAD.match(line) and "(" in line:
            start = number
        if start is not None and line.endswith(";") and not line.startswith(" ") and line != "}":
            start = None
        if line == "}" and start is not None:
            found[lines[start]] = number - start + 1
            start = None
    return found


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(ROOT)))
def test_a_file_has_at_most_400_lines_and_a_function_60(path: Path) -> None:
    assert len(path.read_text().splitlines()) <= MOST_LINES
    assert {name: size for name, size in functions(path).items() if size > MOST_FUNCTION} == {}


@pytest.mark.parametrize(
    "folder", sorted({path.parent for path in FILES}), ids=lambda path: str(path.relative_to(ROOT))
)
def test_a_folder_has_at_most_20_files(folder: Path) -> None:
    assert len([path for path in folder.iterdir() if path.suffix in (".c", ".h")]) <= MOST_FILES


def includes(phase: str) -> dict[str, set[str]]:
    """Which file of a phase's tree, or of common/, includes which other one."""
    tree = patches.files(phase)
    common = {str(path.relative_to(ROOT / "common")): path for path in (ROOT / "common").rglob("*.h")}
    graph: dict[str, set[str]] = {}
    for name, path in {**common, **tree}.items():
        for wanted in re.findall(r'^#include "([^"]+)"', path.read_text(), re.MULTILINE):
            beside = str((Path(name).parent / wanted).as_posix())
            target = beside if beside in tree or (name not in tree and beside in common) else wanted
            if target in tree or target in common:
                graph.setdefault(name, set()).add(target)
    return graph


@pytest.mark.parametrize("phase", registry.phases())
def test_includes_have_no_cycle(phase: str) -> None:
    assert cycle(includes(phase)) == []


def deepest(graph: dict[str, set[str]]) -> list[str]:
    """The longest chain of includes, from the file that begins it. The graph has no cycle."""
    chains: dict[str, list[str]] = {}
    for name in graphlib.TopologicalSorter(graph).static_order():  # what is included comes first
        below = max((chains[other] for other in graph.get(name, ())), key=len, default=[])
        chains[name] = [name, *below]
    return max(chains.values(), key=len, default=[])


@pytest.mark.parametrize("phase", registry.phases())
def test_no_chain_has_more_than_five_includes(phase: str) -> None:
    chain = deepest(includes(phase))
    assert len(chain) - 1 <= MOST_INCLUDES, " -> ".join(chain)


# Folders of a phase and of those derived from it, from the bottom up: none includes a file of one above it.
LAYERS = {
    "opt9_convex": (
        "core",
        "shading",
        "march",
        "groups",
        "fields",
        "types",
        "spans",
        "hit",
        "bvh",
        "repetition",
        "bulb",
        "shadow",
        "fallback",
        "kernel",
        "frame",
        "fused",
    )
}


def layers(phase: str) -> tuple[str, ...]:
    return next((LAYERS[name] for name in patches.lineage(phase) if name in LAYERS), ())


@pytest.mark.parametrize("phase", [name for name in registry.phases() if layers(name)])
def test_includes_go_down(phase: str) -> None:
    """A kernel's root stands above what it includes. Calls: test_calls_of_a_phase_go_one_way."""
    order = layers(phase)
    graph = includes(phase)
    assert {
        Path(name).parts[0] for name in patches.files(phase) if "/" in name and name.endswith((".c", ".h"))
    } <= {*order}
    wrong = [
        f"{name} includes {other}"
        for name, others in graph.items()
        for other in others
        if {Path(name).parts[0], Path(other).parts[0]} <= {*order}
        and order.index(Path(other).parts[0]) > order.index(Path(name).parts[0])
        and name != "kernel/kernel_root.h"
    ]
    assert wrong == []


def calls(objects: list[Path]) -> dict[str, set[str]]:
    """Which object uses a symbol that another one defines."""
    defined: dict[str, str] = {}
    wanted: list[tuple[str, str]] = []
    for line in subprocess.check_output(["nm", "-A", *objects], text=True).splitlines():
        user = Path(line.partition(":")[0]).stem
        kind, name = line.split()[-2:]
        if kind == "U":
            wanted.append((user, name))
        elif kind.isupper():
            defined[name] = user
    graph: dict[str, set[str]] = {}
    for user, name in wanted:
        if defined.get(name, user) != user:
            graph.setdefault(user, set()).add(defined[name])
    return graph


def test_no_two_files_of_common_call_each_other() -> None:
    build("baseline")
    rooms = ("driver", "scene", "frame", "timing", "workers")
    objects = [path for room in rooms for path in sorted((ROOT / "build/common" / room).glob("*.o"))]
    assert len(objects) > 10 and cycle(calls(objects)) == []


@pytest.mark.slow
def test_no_two_files_of_the_function_bench_call_each_other() -> None:
    build("functions", "bench")
    objects = sorted((ROOT / "build/functions").glob("*.o"))
    assert len(objects) > 10 and cycle(calls(objects)) == []


# Pairs of files that call each other: an entry is a fault that is known, and goes with it.
MUTUAL = {
    "opt4": [{"march", "shade"}],
    "opt5_threads": [{"march", "shade"}],
    "rods": [{"render", "rods"}],
}


@pytest.mark.slow
@pytest.mark.parametrize("phase", registry.phases())
def test_calls_of_a_phase_go_one_way(phase: str) -> None:
    """No two files call each other, and none calls a file of a folder above its own. Variants of a file
    define the same symbols: one variant at a time, with the files that have none."""
    build(phase)
    objects = sorted((ROOT / "build" / phase / "objects").rglob("*.o"))
    lanes = {path.stem.partition("-lanes")[2] for path in objects}
    order, sources = layers(phase), [Path(name) for name in patches.files(phase) if name.endswith(".c")]
    floor = {path.stem: order.index(path.parts[0]) for path in sources if path.parts[0] in order}
    assert len(objects) > 2
    for width in sorted(lanes - {""}) or [""]:
        variant = [path for path in objects if path.stem.partition("-lanes")[2] in ("", width)]
        graph = calls(variant)
        for one, other in map(sorted, MUTUAL.get(phase, [])):
            assert other in graph[one] and one in graph[other], f"{one} and {other} no longer do"
            graph[one].remove(other)
        assert cycle(graph) == []
        named = [(one.partition("-")[0], other.partition("-")[0]) for one in graph for other in graph[one]]
        assert [each for each in named if floor.get(each[1], 0) > floor.get(each[0], len(order))] == []
