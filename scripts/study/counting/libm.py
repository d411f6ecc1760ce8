"""Calls of math.h, which the paper's convention counts as FLOPs: declared ones against calls into libm."""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Collection, Mapping

from study.core import registry
from study.counting import costs, flops
from study.counting.flops import Range
from study.counting.schema import Declared, Measurement, Row

MATH = "math.h calls of "  # what the scope of such a row begins with
# Of math.h what a phase may call (C11 7.12), but for sqrt, which is an instruction and a class of its own.
_MATH = re.compile(
    r"a?(cos|sin|tan)h?|atan2|cbrt|ceil|copysign|exp2?|expm1|fabs|fdim|floor|fmax|fmin|fmod|hypot|ldexp|log(10|1p|2)?"
    r"|nearbyint|pow|remainder|rint|round|sincos|trunc"
)
_TWO = "sincos"  # GNU: a sine and a cosine of one angle, by one call


def _into_libm(edges: Mapping[str, int]) -> int:
    """Calls of math.h among a function's, each counted as the source has it."""
    found = 0
    for name, times in edges.items():
        plain = name.split("@")[0].removesuffix("_finite").strip("_")
        plain = plain if _MATH.fullmatch(plain) else plain.removesuffix("f")
        found += times * (2 if plain == _TWO else 1 if _MATH.fullmatch(plain) else 0)
    return found


def compare(stated: Declared, by: Measurement) -> list[Row]:
    """The calls of math.h that the paper's convention counts, against calls into libm: of the whole picture,
    and by function in the build without inlining. A phase with lanes calls none: what it declares stands in
    their place (its own log and exp are functions of it, and compared as such).
    """
    lines = costs.of_phase(stated.phase)
    calls: Counter[str] = Counter({cost.function: 0 for cost in lines})
    known: dict[str, Range] = defaultdict(lambda: (0, 0))
    for cost in lines:
        calls[cost.function] += cost.per_lane["call"] * stated.by_function[cost.function].parts[cost.part]
    for one in costs.residues_of(stated.phase, lines):
        if one.kind == "call" and one.build in (by.variant, "both"):
            times, (low, high) = stated.by_function[one.function].parts[one.part], known[one.function]
            known[one.function] = low + one.least * times, high + one.most * times
    measured = {
        caller: _into_libm({name: n for name, n in callees.items() if name not in by.functions})
        for caller, callees in _folded_edges(by, calls).items()
    }
    if registry.find_phase(stated.phase).lanes > 1:
        calls, known = Counter({"total": 0}), {}
    ends = [sum(both[i] for both in known.values()) for i in (0, 1)]
    rows = [("total", calls.total(), (ends[0], ends[1]), sum(measured.values()))]
    if by.variant == "calls" and len(calls) > 1:
        names = sorted(calls.keys() | measured.keys())
        rows += [(name, calls[name], known.get(name, (0, 0)), measured.get(name, 0)) for name in names]
    return [
        flops.row(stated, f"{MATH}{name}", {"any": n}, {"any": found}, by, residues={"any": both})
        for name, n, both, found in rows
        if found or n + both[1] > 0 or name == "total"
    ]


def _folded_edges(by: Measurement, named: Collection[str]) -> dict[str, Counter[str]]:
    """Calls out of the functions of costs.def; a helper without a line has its own counted where it is
    called from, which must be one function.
    """
    found: dict[str, Counter[str]] = defaultdict(Counter)
    for caller, calls in by.edges.items():
        owner = caller
        while owner not in named:
            above = [name for name, n in by.edges.items() if n.get(owner) and name != owner]
            if len(above) != 1:
                break
            owner = above[0]
        found[owner].update(calls)
    return found
