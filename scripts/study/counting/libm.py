"""Calls of math.h, which the paper's convention counts as FLOPs: declared ones against calls into libm."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Collection, Mapping

from study.core import registry
from study.counting import costs, flops
from study.counting.counts import Measured

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


def _declared_calls(stated: flops.Row, variant: str) -> dict[str, tuple[int, flops.Range]]:
    """Function → calls of math.h declared, and how many of them more (fewer) go to libm."""
    phase = registry.find_phase(stated["phase"])
    lines = costs.read(phase.file("costs.def"))
    parts = {name: function["parts"] for name, function in stated["by_function"].items()}
    found: dict[str, tuple[int, flops.Range]] = {}
    for cost in lines:
        calls, known = found.get(cost.function, (0, (0, 0)))
        found[cost.function] = calls + cost.per_lane["call"] * parts[cost.function][cost.part], known
    for residue in costs.residues_of(phase, lines):
        if residue.kind == "call" and residue.build in (variant, "both"):
            calls, (low, high) = found[residue.function]
            times = parts[residue.function][residue.part]
            found[residue.function] = calls, (low + residue.least * times, high + residue.most * times)
    return found


def compare(stated: flops.Row, by: Measured) -> list[flops.Row]:
    """The calls of math.h that the paper's convention counts, against calls into libm: of the whole picture,
    and by function in the build without inlining. A phase with lanes calls none: what it declares stands in
    their place (its own log and exp are functions of it, and compared as such).
    """
    stated_calls = _declared_calls(stated, by.variant)
    measured: dict[str, int] = defaultdict(int)
    for caller, calls in _folded_edges(by, stated_calls).items():
        measured[caller] = _into_libm({name: n for name, n in calls.items() if name not in by.functions})
    if registry.find_phase(stated["phase"]).lanes > 1:
        stated_calls = {"total": (0, (0, 0))}
    whole = sum(n for n, _ in stated_calls.values())
    ends = [sum(known[i] for _, known in stated_calls.values()) for i in (0, 1)]
    rows = [("total", whole, (ends[0], ends[1]), sum(measured.values()))]
    if by.variant == "calls" and len(stated_calls) > 1:
        names = sorted(stated_calls.keys() | measured.keys())
        rows += [(name, *stated_calls.get(name, (0, (0, 0))), measured.get(name, 0)) for name in names]
    made = []
    for name, counted, known, found in rows:
        if found or counted + known[1] > 0 or name == "total":
            row = flops.row(
                stated, f"{MATH}{name}", {"any": counted}, {"any": found}, by, residues={"any": known}
            )
            made.append(row)
    return made


def _folded_edges(by: Measured, named: Collection[str]) -> dict[str, dict[str, int]]:
    """Calls out of the functions of costs.def; a helper without a line has its own counted where it is
    called from, which must be one function.
    """
    found: dict[str, dict[str, int]] = defaultdict(lambda: defaultdict(int))
    for caller, calls in by.edges.items():
        owner = caller
        while owner not in named:
            above = [name for name, n in by.edges.items() if n.get(owner) and name != owner]
            if len(above) != 1:
                break
            owner = above[0]
        for callee, n in calls.items():
            found[owner][callee] += n
    return found
