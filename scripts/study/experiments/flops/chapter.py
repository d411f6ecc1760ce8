"""FLOPs of a picture, what their difference from the paper's is made of, and the validation."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

from study.core.show import Row
from study.counting import flops, libm
from study.experiments.flops import columns as flops_columns
from study.experiments.flops import table1
from study.experiments.section import Section, part, reading

CONVENTIONS = (
    "Two conventions. The paper's: one FLOP for each addition, multiplication, division, root, and for each "
    "call of math.h. The machine's, which hardware and emulators count: the same without the calls (an FMA "
    "is two, a minimum or maximum one), libm's inside apart. Comparisons are FLOPs in neither. All lanes are "
    "counted; the useful share is that of lanes whose ray is still under way."
)


RULE = (
    "Table 1 is judged by the paper's rule: calls of each function times the FLOPs of that function, by the "
    "paper's convention. A call of the Mandelbulb's distance then has all of its iterations; “as entered” "
    "counts those that were entered. The rule says nothing of a phase that evaluates a Mandelbulb in pieces."
)


VALIDATION = (
    "Declared: costs.def, derived by hand from the source and committed before it was first compared, times "
    "the calls that the counting build makes. Measured: by {backends}. “The compiler's doing, known”: "
    "phases/NAME/residues.def, where the compiled code does otherwise than the source says; what is left is "
    "judged. Functions under 0.1 % of the picture are not shown. This is the machine's convention; the calls "
    "of math.h that the paper's adds are held against the calls into libm. fabs and floor are instructions "
    "there: they, and the comparisons, are as the source has them and not measured."
)


GENERAL = (
    "{phases}: counted is the general code, with no kernel generated for the scene (STEPWISE_CC=none). A "
    "kernel does the same operations but for products with 0 and 1, and for highlights, where it has no "
    "logarithm."
)


# How each back end comes by its figure, beside its name.
MEANS = {
    "blocks": "every basic block that was executed, decoded",
    "qemu": "every block that the emulator executed, decoded",
    "sde": "Intel's emulator, by instruction",
    "pmu": "the CPU's own counters",
}


HEIGHT = 720  # of the paper's pictures


def _pictures(stated: Iterable[Row]) -> list[Row]:
    """Per scene and phase the picture of the paper's height, else the largest. Flags change no FLOP."""
    best: dict[tuple, Row] = {}
    for one in stated:
        which = one["scene"], one["phase"]
        if one["flags_from"] != one["phase"]:
            continue
        rank = [(row["height"] == HEIGHT, row["height"]) for row in (one, best.get(which, one))]
        if which not in best or rank[0] > rank[1]:
            best[which] = one
    return list(best.values())


def _said(rows: Sequence[Row], calls: Sequence[Row], math: Sequence[Row] = ()) -> list[str]:
    """How to read the validation, by the back ends that were there: each has its own sums."""
    names = dict.fromkeys(row["backend"] for row in rows)
    told = "; ".join(f"{name} ({MEANS[name]})" if name in MEANS else name for name in names)
    said = [VALIDATION.format(backends=told)] if names else []
    for name in names:
        equal = [row["within"] for row in calls if row["backend"] == name]
        if equal:
            said.append(f"Calls by name, counting build against {name}: {sum(equal)} of {len(equal)} equal.")
        into = [row["within"] for row in math if row["backend"] == name]
        if into:
            said.append(
                f"Calls of math.h, declared against calls into libm by {name}, in all and by function: "
                f"{sum(into)} of {len(into)} within 1\u00a0%."
            )
    return said


def counted(path: Path) -> Section:
    """Table 1, what its difference from the paper's is made of, and the validation."""
    remarks, parts = [], []
    file = path / "counts.json"
    with reading(file, f"scripts/stepwise flops --run {path}"):
        first = _pictures(flops.read(file)[0])
        remarks += [CONVENTIONS, RULE] if first else []
        general = dict.fromkeys(one["phase"] for one in first if one.get("kernel"))
        remarks += [GENERAL.format(phases=", ".join(general))] if general else []
        parts += part("table1", "Table 1: FLOPs of a picture", table1.rows(first), flops_columns.TABLE1)
        parts += part(
            "table1-readings",
            "Table 1 by the paper's rule, and by others: baseline's FLOPs. The paper's text states the rule; "
            "its sheet with the FLOPs of each function is not public",
            table1.readings(first),
            flops_columns.READINGS,
        )
        parts += part(
            "table1-terms", "Where the FLOPs are", table1.terms(first), flops_columns.TERMS, folded=True
        )
    file = path / "validation.json"
    with reading(file, f"scripts/stepwise flops --validate --run {path}"):
        rows = flops.read_validation(file)
        judged = table1.by_scene(r for r in rows if r["judged"])
        calls = [r for r in judged if r["scope"].startswith("calls of")]
        math = [r for r in judged if r["scope"].startswith(libm.MATH)]
        judged = [r for r in judged if not r["scope"].startswith(("calls of", libm.MATH))]
        totals = [r for r in judged if r["scope"] == "total"]
        remarks += _said([r for r in rows if not r["scope"].startswith(libm.MATH)], calls, math)
        caption = "Declared against measured, whole pictures"
        parts += part("validation", caption, totals, flops_columns.VALIDATION)
        caption = "Declared against measured, by function"
        parts += part("validation-functions", caption, judged, flops_columns.VALIDATION, folded=True)
    return Section("flops", "FLOPs: declared, counted, measured", "make flops", parts, remarks)
