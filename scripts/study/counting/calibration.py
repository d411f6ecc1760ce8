"""Known work that a measuring back end must count exactly: tests/calibration.

`expected` is added up by hand from the program's text (tests/calibration/expected.json), never measured.
"""

from __future__ import annotations

import functools
from collections import Counter
from collections.abc import Mapping
from typing import Any

from study.core import store
from study.core.cli import StudyError
from study.core.registry import ROOT, cpu_flags
from study.counting.counts import Counts

EXPECTED = ROOT / "tests" / "calibration" / "expected.json"
Edges = Mapping[str, Mapping[str, int]]


@functools.cache
def _table() -> dict[str, Any]:
    return store.read_json(EXPECTED)


def parts() -> dict[str, list[str]]:
    """Part of the program to the CPU flags that this CPU lacks for it."""
    return {
        name: [flag for flag in part["needs"] if flag not in cpu_flags()]
        for name, part in _table()["parts"].items()
    }


def _part(name: str) -> dict[str, Any]:
    if name not in _table()["parts"]:
        raise StudyError(f"no part '{name}' of the calibration; there are {', '.join(_table()['parts'])}")
    return _table()["parts"][name]


def expected(part: str, repeats: int) -> dict[str, Counts]:
    """Counts by function of `calibrate PART REPEATS`, for the functions whose text is known."""
    found = {}
    for name, function in _part(part)["functions"].items():
        counts = found[name] = Counts(calls=function.get("calls", 1) * repeats)
        for piece, times in (("round", repeats * _table()["rounds"]), ("call", repeats)):
            does = function.get(piece, {})
            counts.load += times * does.get("load", 0)
            counts.store += times * does.get("store", 0)
            for kind, precision, bits, lanes in does.get("operations", []):
                counts.lanes[kind, precision, bits] += times * lanes
            for place, n in does.get("mix", {}).items():
                counts.mix[place] += times * n
        counts.instructions = sum(counts.mix.values())
    return found


def expected_edges(part: str, repeats: int) -> dict[str, dict[str, int]]:
    """Direct calls and tail calls, caller to callee, among the same functions."""
    edges = _part(part).get("edges", {})
    return {a: {b: n * repeats for b, n in callees.items()} for a, callees in edges.items()}


def flat(counts: Counts) -> dict[str, int]:
    """All its numbers by a readable name, those that are 0 left out."""
    flat = Counter({f"{kind} {bits}-bit {of}": n for (kind, of, bits), n in counts.lanes.items()})
    flat |= Counter(counts.mix)
    flat |= Counter(
        {
            "calls": counts.calls,
            "instructions": counts.instructions,
            "loaded": counts.load,
            "stored": counts.store,
        }
    )
    return {key: n for key, n in flat.items() if n}


def differences(
    functions: Mapping[str, Counts], part: str, repeats: int, edges: Edges | None = None
) -> list[str]:
    """What was measured and is not as it must be, one line each; none if all is exact. `edges`: of a
    back end that sees them."""
    found = []
    for name, known in expected(part, repeats).items():
        right, seen = flat(known), flat(functions.get(name, Counts()))
        found += [
            f"{part}, {name}, {what}: {seen.get(what, 0)} instead of {right.get(what, 0)}"
            for what in sorted(right.keys() | seen.keys())
            if right.get(what, 0) != seen.get(what, 0)
        ]
    if edges is not None:
        for caller, callees in expected_edges(part, repeats).items():
            if (seen := {name: n for name, n in edges.get(caller, {}).items() if n}) != callees:
                found.append(f"{part}, calls by {caller}: {seen} instead of {callees}")
    return found
