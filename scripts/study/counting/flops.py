"""FLOPs of the phases: declared costs times counted calls, held against what back ends measure.

Conventions (common/counting/flops.h): `paper`, one FLOP per math.h call; `machine`, what the hardware counts.
"""

from __future__ import annotations

import importlib
import math
from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping
from pathlib import Path
from typing import Any

from study.core import registry, run, store
from study.core.registry import Scene, Spec
from study.counting import costs, schema
from study.counting.counts import Counts, Measured
from study.counting.decode import FLOPS

TOLERANCE = 0.01  # of declared against measured, in the machine convention
SMALL = 0.001  # of the total: a function under it is listed, and not judged
KEYS = ("flops", "by_function", "by_class", "executed", "useful", "useful_paper")

Row = dict[str, Any]


BACKENDS = ("blocks", "qemu", "ptrace", "sde", "pmu")
# Those that know functions; the others see totals, with the inside of libm in them.
WITH_FUNCTIONS = ("blocks", "qemu", "ptrace")
LIBM_INSIDE = ("sde", "pmu")
_TARGETS = {"shipped": "render", "calls": "render-calls"}


def missing(backend: str) -> str | None:
    """What a back end lacks here and what it would add, in one line; None if it can be used."""
    module = importlib.import_module(f"study.counting.{backend}")
    if backend == "blocks":
        return module.missing()
    found = module.available()
    return found if not isinstance(found, tuple) else None if found[0] else found[1]


def measure(backend: str, spec: Spec, scene: Scene, height: int, variant: str = "shipped") -> Measured:
    """One picture's timed region by that back end."""
    module = importlib.import_module(f"study.counting.{backend}")
    how = {"variant": variant} if backend == "blocks" else {"target": _TARGETS[variant]}
    wide, high = scene.size(height)
    return module.measure(spec, scene.path, high, wide, **how)


def declared(spec: Spec, scene: Scene, height: int, width: int | None = None, threads: int = 1) -> Row:
    """Calls counted by build/SPEC/render-count times costs.def. FLOPs of one picture; `executed` counts all
    lanes, `useful` the active ones (both by the machine convention).
    """
    wide, high = scene.size(height, width)
    made = run.render(spec, scene.path, high, wide, threads=threads, target="render-count", timed=False)
    about = {key: made[key] for key in ("phase", "flags_from", "scene", "scene_hash", "width", "height")}
    about |= {key: made.get(key) for key in ("compiler", "flags", "lanes", "kernel")}
    return {**about, "threads": threads, **{key: made[key] for key in KEYS}}


def fold(measured: Measured, named: Collection[str]) -> dict[str, Counts]:
    """The functions of a build without inlining as costs.def has them: those without a line of their own
    go to their callers, by their share of the calls. Exact where each of their calls costs the same.
    """
    found = {}
    for name, counts in measured.functions.items():
        found[name] = Counts()
        found[name].merge(counts)
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
            own, calls = found.pop(name), incoming[name]
            for caller, part in zip(calls, own.split([*calls.values()]), strict=True):
                part.calls = 0  # the caller's own stay what they are
                found[caller].merge(part)
            waiting.remove(name)
    return found


Range = tuple[int, int]


def lanes_of(stated: Row) -> int:
    """Of the variant that was counted; counts of older runs do not say."""
    return stated.get("lanes") or registry.find_phase(stated["phase"]).lanes


def by_kind(stated: Row) -> dict[str, dict[str, int]]:
    """Function → kind → FLOPs (machine): costs.def times the parts that were executed."""
    phase = registry.find_phase(stated["phase"])
    found: dict[str, dict[str, int]] = defaultdict(lambda: defaultdict(int))
    for cost in costs.read(phase.file("costs.def")):
        width = lanes_of(stated) if cost.width == "LANES" else 1
        times = stated["by_function"][cost.function]["parts"][cost.part] * width
        for kind, flop in FLOPS.items():
            found[cost.function][kind] += cost.per_lane.get(kind, 0) * flop * times
    return found


def explained(stated: Row, variant: str) -> dict[str, dict[str, Range]]:
    """Function → kind → FLOPs (machine) that the compiler is known to add, at least and at most: the phase's
    residues.def times the parts that were executed.
    """
    phase = registry.find_phase(stated["phase"])
    lines = {(c.function, c.part): c for c in costs.read(phase.file("costs.def"))}
    found: dict[str, dict[str, Range]] = defaultdict(dict)
    for residue in costs.residues_of(phase, lines.values()):
        if residue.build in (variant, "both") and residue.kind != "call":
            width = lanes_of(stated) if lines[residue.function, residue.part].width == "LANES" else 1
            times = stated["by_function"][residue.function]["parts"][residue.part] * width
            times *= FLOPS[residue.kind]
            low, high = found[residue.function].get(residue.kind, (0, 0))
            found[residue.function][residue.kind] = low + residue.least * times, high + residue.most * times
    return found


def measured_kinds(counts: Counts) -> dict[str, int]:
    """Kind → FLOPs (machine)."""
    found: dict[str, int] = defaultdict(int)
    for kind, lanes in counts.by_kind().items():
        found[kind] += FLOPS[kind] * lanes
    return found


def _sum(kinds: Iterable[Mapping[str, int]]) -> dict[str, int]:
    found: dict[str, int] = defaultdict(int)
    for one in kinds:
        for kind, flop in one.items():
            found[kind] += flop
    return found


def _sum_ranges(kinds: Iterable[Mapping[str, Range]]) -> dict[str, Range]:
    several = list(kinds)
    low, high = (_sum({k: ends[i] for k, ends in one.items()} for one in several) for i in (0, 1))
    return {kind: (low[kind], high[kind]) for kind in low}


def _left(
    counted: Mapping[str, int], measured: Mapping[str, int], known: Mapping[str, Range], doublings: int
) -> int:
    """FLOPs that neither costs nor residues say, summed over kinds: at least, over the readings of x + x."""

    def off(kind: str, more: int = 0) -> int:
        low, high = (counted.get(kind, 0) + end for end in known.get(kind, (0, 0)))
        found = measured.get(kind, 0) + more
        return max(low - found, found - high, 0)

    rest = sum(off(kind) for kind in (counted.keys() | measured.keys()) - {"add", "mul"})
    # Convex in how many are read as products: the least is where a bound is met, or at an end.
    at = {0, doublings, min(off("mul"), doublings), min(off("add"), doublings)}
    return rest + min(off("add", -n) + off("mul", n) for n in at)


def _in_branches(known: Mapping[str, Range], compares: int) -> dict[str, Range]:
    """Residues of minima narrowed by what was seen: a minimum that became a branch is a comparison more."""
    low, high = known.get("minmax", (0, 0))
    return {**known, "minmax": (max(low, min(high, -compares)),) * 2} if low < 0 else dict(known)


def row(
    stated: Row,
    scope: str,
    counted: Mapping[str, int],
    measured: Mapping[str, int],
    by: Measured,
    judged: bool = True,
    residues: Mapping[str, Range] | None = None,
    doublings: int = 0,
) -> Row:
    """Kind is held against kind: what explains a missing minimum explains no missing product. Up to
    `doublings` of the measured sums are x + x and may be declared as products 2·x. Residues that the phase
    inherits are shown (`inherited_from`) and explain nothing: they were read in its ancestor's code.
    """
    known = residues or {}
    some = any(end for ends in known.values() for end in ends)
    ancestor = registry.find_phase(stated["phase"]).inherits("residues.def") if some else None
    if by.backend in LIBM_INSIDE or "any" in measured:  # these do not tell kinds apart, or not as others do
        measured = {"any": sum(measured.values())}
        counted, known = {"any": sum(counted.values())}, {"any": _total(known)}
    left = _left(counted, measured, {} if ancestor else known, doublings)
    declared, found = sum(counted.values()), sum(measured.values())
    scale = found or math.nan
    return {
        "phase": stated["phase"],
        "flags_from": stated["flags_from"],
        "scene": stated["scene"],
        "width": stated["width"],
        "height": stated["height"],
        "scope": scope,
        "variant": by.variant,
        "counted": declared,
        "measured": found,
        "backend": by.backend,
        "calibrated": by.calibrated,
        "relative_difference": 0.0 if declared == found else (declared - found) / scale,
        "residue_low": _total(known)[0],
        "residue_high": _total(known)[1],
        "inherited_from": ancestor,
        "unexplained": 0.0 if left == 0 else left / scale,
        "explained_to": (_total(known)[1] - _total(known)[0]) / scale if found and not ancestor else 0.0,
        "judged": judged,
        "within": left == 0 or left / scale <= TOLERANCE,
    }


def _total(ranges: Mapping[str, Range]) -> Range:
    return sum(low for low, _ in ranges.values()), sum(high for _, high in ranges.values())


def compare(stated: Row, shipped: Measured, calls: Measured | None = None) -> list[Row]:
    """Declared × counted against measured, machine convention: the shipped build's total, and the
    functions of the build without inlining. libm's inside is in neither. What residues.def explains of a
    difference is told apart from the rest, and the rest is judged.
    """
    declared = by_kind(stated)
    whole = _sum(declared.values())

    def total(by: Measured, measured: Mapping[str, int], doublings: int) -> Row:
        known = _sum_ranges(explained(stated, by.variant).values())
        if by is shipped and calls is not None and lanes_of(stated) == 1:  # lanes are masked
            one, other = (m.total.by_kind().get("compare", 0) for m in (shipped, calls))
            known = _in_branches(known, one - other)
        # A scalar phase calls libm: what is in there is not declared, so such a total cannot be judged.
        judged = by.backend not in LIBM_INSIDE or registry.find_phase(stated["phase"]).lanes > 1
        return row(stated, "total", whole, measured, by, judged, known, doublings)

    rows = [total(shipped, measured_kinds(shipped.total), shipped.total.doublings)]
    if calls is None:
        return rows
    parts = fold(calls, declared)
    folded = {name: measured_kinds(counts) for name, counts in parts.items()}
    doublings = {name: counts.doublings for name, counts in parts.items()}
    rows.append(total(calls, _sum(folded.values()), sum(doublings.values())))
    executed = rows[-1]["measured"]
    known = explained(stated, calls.variant)
    for name in sorted(declared.keys() | folded.keys()):
        counted, measured = declared.get(name, {}), folded.get(name, {})
        most = max(sum(counted.values()), sum(measured.values()))
        if most:
            judged, residues = most > SMALL * executed, known.get(name)
            rows.append(row(stated, name, counted, measured, calls, judged, residues, doublings.get(name, 0)))
    return rows


def compare_calls(stated: Row, calls: Measured) -> list[Row]:
    """How often each function was entered: the counting build against a back end, which must be equal."""
    rows = []
    for name, function in stated["by_function"].items():
        counted = function["calls"]
        measured = calls.functions[name].calls if name in calls.functions else 0
        made = row(stated, name, {"any": counted}, {"any": measured}, calls)
        rows.append(made | {"within": counted == measured})
    return rows


def failures(rows: Iterable[Row]) -> list[Row]:
    """Rows outside the tolerance among those that are judged. NaN is outside."""
    return [row for row in rows if row["judged"] and not row["within"]]


def summary(one: Measured) -> Row:
    """A measurement for people: 10⁹ FLOPs (machine), instructions and bytes of the whole picture."""
    about = ("phase", "flags_from", "scene", "width", "height", "backend", "calibrated")
    sums = {
        "machine_gflop": one.total.machine,
        "instructions_g": one.total.instructions,
        "load_gb": one.total.load,
        "store_gb": one.total.store,
    }
    return {key: getattr(one, key) for key in about} | {key: n / 1e9 for key, n in sums.items()}


# --- counts.json of a run


def read(path: Path) -> tuple[list[Row], list[Measured]]:
    """Declared rows and measurements of a run's counts.json; none without that file."""
    path = store.stored(path)
    if not path.exists():
        return [], []
    data = schema.Counts.read(path)
    return data["declared"], [Measured.from_json(one) for one in data["measured"]]


def _key(one: Row) -> tuple:
    names = ("backend", "variant", "phase", "flags_from", "scene", "width", "height")
    return tuple(one.get(name) for name in names)


def write(path: Path, stated: Iterable[Row], measured: Iterable[Measured]) -> None:
    """Adds to counts.json; newer counts of the same thing replace older ones."""
    old_stated, old_measured = read(path)
    both = {_key(row): row for row in [*old_stated, *stated]}
    many = {_key(one): one for one in (m.to_json() for m in [*old_measured, *measured])}
    store.write_json(path, {"schema": 1, "declared": [*both.values()], "measured": [*many.values()]})


def write_validation(path: Path, rows: Iterable[Row]) -> None:
    """Adds to validation.json; newer rows of the same phase, scene and back end replace older ones."""

    def key(row: Row) -> tuple:
        return tuple(row[name] for name in ("backend", "phase", "flags_from", "scene"))

    rows = list(rows)
    new = {key(row) for row in rows}
    old = [row for row in read_validation(path) if key(row) not in new]
    store.write_json(path, {"schema": 1, "tolerance": TOLERANCE, "rows": [*old, *rows]})


def read_validation(path: Path) -> list[Row]:
    """Rows of a run's validation.json; none without that file."""
    path = store.stored(path)
    if not path.exists():
        return []
    return schema.Validation.read(path)["rows"]
