"""FLOPs of the phases: declared costs times counted calls, held against what back ends measure.

Conventions (common/counting/flops.h): `paper`, one FLOP per math.h call; `machine`, what the hardware counts.
"""

import importlib
import math
from collections import Counter, defaultdict
from collections.abc import Collection, Iterable, Mapping
from pathlib import Path
from typing import Any

import msgspec

from study.core import machine, registry, run, store
from study.core.cli import StudyError
from study.core.registry import Scene, Spec
from study.counting import costs, schema
from study.counting.counts import Counts, Kind
from study.counting.schema import FLOPS, Declared, Measurement, Row, Validation, named

TOLERANCE = 0.01  # of declared against measured, in the machine convention
SMALL = 0.001  # of the total: a function under it is listed, and not judged
BACKENDS = ("blocks", "ptrace", "sde", "pmu")
LIBM_INSIDE = ("sde", "pmu")  # their totals have the inside of libm in them
FORMER = {"direction": "lit", "facing": "lit"}  # parts of costs.def by their names in published runs
# Compilers write 2·x as x + x: sums and products are judged together.
_JUDGED = {"mul": "add"}

Range = tuple[int, int]


def missing(backend: str) -> str | None:
    """What a back end lacks here and what it would add, in one line; None if it can be used."""
    if backend != "pmu" and (here := machine.not_x86()):
        return (
            f"back end {backend} reads x86-64 code; on {here} counts are declared (costs.def), not measured"
        )
    if backend == "blocks":
        return None
    return importlib.import_module(f"study.counting.{backend}").missing()


def measure(backend: str, spec: Spec, scene: Scene, height: int, variant: str = "shipped") -> Measurement:
    return importlib.import_module(f"study.counting.{backend}").measure(spec, scene, height, variant)


def declared(spec: Spec, scene: Scene, height: int, width: int | None = None, threads: int = 1) -> Declared:
    """What build/SPEC/render-count counts of one picture: calls and lanes, times costs.def if there is one.
    `executed` counts all lanes, `useful` the active ones (both by the machine convention).
    """
    wide, high = scene.size(height, width)
    made = run.render(spec, scene.path, high, wide, threads=threads, target="render-count", timed=False)
    return msgspec.convert(made | {"threads": threads}, Declared)


def fold(measured: Measurement, named: Collection[str]) -> dict[str, Counts]:
    """The functions of a build without inlining as costs.def has them: those without a line of their own
    go to their callers, by their share of the calls. Exact where each of their calls costs the same.
    """
    found = {name: Counts.of(executed) for name, executed in measured.functions.items()}
    incoming: dict[str, dict[str, int]] = defaultdict(dict)
    for caller, callees in measured.edges.items():
        for callee, calls in callees.items():
            if calls and callee in found and caller in found and callee != caller:
                incoming[callee][caller] = calls
    waiting = [name for name in found if name not in named and incoming[name]]
    while waiting:
        # Leaves first: what a helper's own helpers did must be in it before it is handed on.
        ready = [n for n in waiting if not any(w != n and n in incoming[w] for w in waiting)]
        for name in ready or waiting[:1]:
            own, callers = found.pop(name), incoming[name]
            for caller, part in zip(callers, own.split([*callers.values()]), strict=True):
                part.calls = 0  # the caller's own stay what they are
                found[caller].merge(part)
            waiting.remove(name)
    return found


def by_kind(stated: Declared) -> dict[str, Counter[str]]:
    """Function → kind → FLOPs (machine): costs.def times the parts that were executed."""
    found: dict[str, Counter[str]] = defaultdict(Counter)
    for cost in costs.of_phase(stated.phase):
        width = stated.lanes if cost.width == "LANES" else 1
        times = stated.by_function[cost.function].parts[cost.part] * width
        for kind, flop in FLOPS.items():
            found[cost.function][kind] += cost.per_lane.get(kind, 0) * flop * times
    return found


def stated_operations(stated: Declared, precision: str, wide: int, element: int) -> Counter[Kind] | None:
    """The same as a back end has it, lane by lane: in vectors of `wide` bits, or scalar. None where costs.def
    is not there or has other parts than were counted, as of an older run."""
    found: Counter[Kind] = Counter()
    try:
        for cost in costs.of_phase(stated.phase):
            lanes = stated.lanes if cost.width == "LANES" else 1
            parts = stated.by_function[cost.function].parts
            times = lanes * parts[cost.part if cost.part in parts else FORMER[cost.part]]
            for kind, n in cost.per_lane.items():
                if kind in FLOPS:
                    found[kind, precision, wide if lanes > 1 else element] += n * times
    except (KeyError, StudyError):
        return None
    return found


def explained(stated: Declared, variant: str) -> dict[str, dict[str, Range]]:
    """Function → kind → FLOPs (machine) that the compiler is known to add, at least and at most: the phase's
    residues.def times the parts that were executed.
    """
    lines = {(c.function, c.part): c for c in costs.of_phase(stated.phase)}
    found: dict[str, dict[str, Range]] = defaultdict(dict)
    for one in costs.residues_of(stated.phase, lines.values()):
        if one.build in (variant, "both"):
            width = stated.lanes if lines[one.function, one.part].width == "LANES" else 1
            times = stated.by_function[one.function].parts[one.part] * width * FLOPS[one.kind]
            low, high = found[one.function].get(one.kind, (0, 0))
            found[one.function][one.kind] = low + one.least * times, high + one.most * times
    return found


def measured_kinds(counts: Counts) -> Counter[str]:
    found: Counter[str] = Counter()
    for (kind, _, _), lanes in counts.lanes.items():
        found[kind] += FLOPS[kind] * lanes
    return found


def _sum(kinds: Iterable[Mapping[str, int]]) -> Counter[str]:
    found: Counter[str] = Counter()
    for one in kinds:
        found.update(one)
    return found


def _total(ranges: Iterable[Range]) -> Range:
    low, high = zip(*ranges, (0, 0), strict=True)
    return sum(low), sum(high)


def _judged(kinds: Mapping[str, int], all_together: bool) -> Counter[str]:
    found: Counter[str] = Counter()
    for kind, flop in kinds.items():
        found["any" if all_together else _JUDGED.get(kind, kind)] += flop
    return found


def _left(counted: Mapping[str, int], measured: Mapping[str, int], known: Mapping[str, Range]) -> int:
    """FLOPs that neither costs nor residues say, summed over kinds. Kind is held against kind: what explains
    a missing minimum explains no missing product."""
    together = "any" in measured  # a back end that does not tell kinds apart
    ours, theirs = _judged(counted, together), _judged(measured, together)
    ends = [_judged({kind: ends[i] for kind, ends in known.items()}, together) for i in (0, 1)]
    left = 0
    for kind in ours.keys() | theirs.keys():
        low, high = (ours[kind] + end[kind] for end in ends)
        left += max(low - theirs[kind], theirs[kind] - high, 0)
    return left


def row(
    stated: Declared,
    scope: str,
    counted: Mapping[str, int],
    measured: Mapping[str, int],
    by: Measurement,
    judged: bool = True,
    residues: Mapping[str, Range] | None = None,
) -> Row:
    if by.backend in LIBM_INSIDE:
        measured = {"any": sum(measured.values())}
    known = residues or {}
    left = _left(counted, measured, known)
    declared, found = sum(counted.values()), sum(measured.values())
    scale, (low, high) = found or math.nan, _total(known.values())
    return Row(
        **named(stated),
        scope=scope,
        variant=by.variant,
        counted=declared,
        measured=found,
        backend=by.backend,
        calibrated=by.calibrated,
        relative_difference=0.0 if declared == found else (declared - found) / scale,
        residue_low=low,
        residue_high=high,
        unexplained=0.0 if left == 0 else left / scale,
        explained_to=(high - low) / scale if found else 0.0,
        judged=judged,
        within=left == 0 or left / scale <= TOLERANCE,
    )


def _compares(measured: Measurement) -> int:
    return sum(one.lanes for one in measured.total.operations if one.kind == "compare")


def compare(stated: Declared, shipped: Measurement, calls: Measurement | None = None) -> list[Row]:
    """Declared × counted against measured, machine convention: the shipped build's total, and the
    functions of the build without inlining. libm's inside is in neither. What residues.def explains of a
    difference is told apart from the rest, and the rest is judged.
    """
    declared = by_kind(stated)
    whole, scalar = _sum(declared.values()), stated.lanes == 1

    def total(by: Measurement, measured: Mapping[str, int]) -> Row:
        several = list(explained(stated, by.variant).values())
        known = {k: _total(one.get(k, (0, 0)) for one in several) for one in several for k in one}
        if by is shipped and calls is not None and scalar and known.get("minmax", (0, 0))[0] < 0:
            # A minimum that became a branch is a comparison more than without inlining: their number is seen.
            low, high = known["minmax"]
            known["minmax"] = (max(low, min(high, _compares(calls) - _compares(shipped))),) * 2
        # A scalar phase calls libm: what is in there is not declared, so such a total cannot be judged.
        judged = by.backend not in LIBM_INSIDE or registry.find_phase(stated.phase).lanes > 1
        return row(stated, "total", whole, measured, by, judged, known)

    rows = [total(shipped, measured_kinds(Counts.of(shipped.total)))]
    if calls is None:
        return rows
    folded = {name: measured_kinds(counts) for name, counts in fold(calls, declared).items()}
    rows.append(total(calls, _sum(folded.values())))
    executed, known = rows[-1].measured, explained(stated, calls.variant)
    for name in sorted(declared.keys() | folded.keys()):
        counted, measured = declared.get(name, Counter()), folded.get(name, Counter())
        if most := max(counted.total(), measured.total()):
            judged = most > SMALL * executed
            rows.append(row(stated, name, counted, measured, calls, judged, known.get(name)))
    return rows


def compare_calls(stated: Declared, calls: Measurement) -> list[Row]:
    """How often each function was entered: the counting build against a back end, which must be equal."""
    rows = []
    for name, function in stated.by_function.items():
        measured = calls.functions[name].calls if name in calls.functions else 0
        made = row(stated, f"calls of {name}", {"any": function.calls}, {"any": measured}, calls)
        made.within = function.calls == measured
        rows.append(made)
    return rows


def failures(rows: Iterable[Row]) -> list[Row]:
    """Rows outside the tolerance among those that are judged. NaN is outside."""
    return [row for row in rows if row.judged and not row.within]


# --- counts.json of a run


def read(path: Path) -> schema.Counts:
    """A run's counts.json, empty without that file."""
    return schema.Counts.load_if_there(path) or schema.Counts(declared=[], measured=[])


def write(path: Path, stated: Iterable[Declared], measured: Iterable[Measurement]) -> None:
    """Adds to counts.json; newer counts of the same thing replace older ones."""
    old = read(path)
    both = {(one.spec, one.scene, one.size): one for one in [*old.declared, *stated]}
    many = {
        (one.backend, one.variant, one.spec, one.scene, one.size): one for one in [*old.measured, *measured]
    }
    store.write_json(path, schema.Counts(declared=[*both.values()], measured=[*many.values()]))


def read_validation(path: Path) -> list[Row]:
    """Rows of a run's validation.json; none without that file."""
    found = Validation.load_if_there(path)
    return found.rows if found else []


def write_validation(path: Path, rows: Iterable[Row]) -> None:
    """Adds to validation.json; newer rows of the same phase, scene and back end replace older ones."""

    def which(one: Row) -> tuple[Any, ...]:
        return one.backend, one.phase, one.flags_from, one.scene

    rows = list(rows)
    new = {which(one) for one in rows}
    old = [one for one in read_validation(path) if which(one) not in new]
    store.write_json(path, Validation(tolerance=TOLERANCE, rows=[*old, *rows]))
