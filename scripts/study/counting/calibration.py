"""Known work that a measuring back end must count exactly: tests/calibration.

What is expected is added up by hand from the program's text (expected.json), never measured.
"""

import functools
from collections import Counter
from collections.abc import Mapping

import msgspec

from study.core.registry import ROOT, cpu_flags
from study.counting.counts import Counts

EXPECTED = ROOT / "tests" / "calibration" / "expected.json"


class Work(msgspec.Struct, frozen=True):
    operations: list[tuple[str, str, int, int]] = []  # kind, precision, bits, lanes
    load: int = 0
    store: int = 0
    instructions: int = 0


class Function(msgspec.Struct):
    why: str = ""
    calls: int = 1
    round: Work = Work()
    call: Work = Work()


class Part(msgspec.Struct):
    needs: list[str]
    functions: dict[str, Function]
    edges: dict[str, dict[str, int]] = {}


class Table(msgspec.Struct):
    rounds: int
    parts: dict[str, Part]


@functools.cache
def table() -> Table:
    return msgspec.json.decode(EXPECTED.read_bytes(), type=Table)


def parts() -> dict[str, list[str]]:
    """Part of the program to the CPU flags that this CPU lacks for it."""
    return {name: [f for f in part.needs if f not in cpu_flags()] for name, part in table().parts.items()}


def runnable() -> list[str]:
    return [name for name, lacking in parts().items() if not lacking]


def expected(part: str, repeats: int) -> dict[str, Counts]:
    """Counts by function of `calibrate PART REPEATS`, for the functions whose text is known."""
    found = {}
    for name, function in table().parts[part].functions.items():
        counts = found[name] = Counts(calls=function.calls * repeats)
        for work, times in ((function.round, repeats * table().rounds), (function.call, repeats)):
            counts.instructions += times * work.instructions
            counts.load += times * work.load
            counts.store += times * work.store
            for kind, precision, bits, lanes in work.operations:
                counts.lanes[kind, precision, bits] += times * lanes
    return found


def expected_edges(part: str, repeats: int) -> dict[str, dict[str, int]]:
    """Direct calls and tail calls, caller to callee, among the same functions."""
    edges = table().parts[part].edges
    return {a: {b: n * repeats for b, n in callees.items()} for a, callees in edges.items()}


def flat(counts: Counts) -> dict[str, int]:
    """All its numbers by a readable name, those that are 0 left out."""
    found = {f"{kind} {bits}-bit {of}": n for (kind, of, bits), n in counts.lanes.items()}
    found |= {"calls": counts.calls, "instructions": counts.instructions}
    found |= {"loaded": counts.load, "stored": counts.store}
    return {key: n for key, n in found.items() if n}


def differences(
    functions: Mapping[str, Counts],
    part: str,
    repeats: int,
    edges: Mapping[str, Mapping[str, int]] | None = None,
) -> list[str]:
    """What was measured and is not as it must be, one line each. `edges` None: of a back end that sees no
    calls."""
    found = []
    for name, known in expected(part, repeats).items():
        right, seen = Counter(flat(known)), Counter(flat(functions.get(name, Counts())))
        off = sorted(what for what in right.keys() | seen.keys() if right[what] != seen[what])
        off = [what for what in off if what != "calls" or edges is not None]
        found += [f"{part}, {name}, {what}: {seen[what]} instead of {right[what]}" for what in off]
    if edges is not None:
        for caller, callees in expected_edges(part, repeats).items():
            if (calls := {name: n for name, n in edges.get(caller, {}).items() if n}) != callees:
                found.append(f"{part}, calls by {caller}: {calls} instead of {callees}")
    return found
