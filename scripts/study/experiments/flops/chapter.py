"""FLOPs of a picture, what their difference from the paper's is made of, and the validation."""

from collections.abc import Iterable, Sequence
from functools import partial
from math import isnan, nan
from pathlib import Path

from matplotlib.figure import Figure

from study.core import show
from study.counting import flops
from study.counting.schema import Row
from study.experiments.flops import columns, table1
from study.experiments.section import Section, part
from study.pictures import dots
from study.pictures.draw import Drawing

CONVENTIONS = "All lanes are counted; the useful share is that of lanes whose ray is still under way."
RULE = (
    "The paper's rule: calls of each function times the FLOPs of that function. A call of the Mandelbulb's "
    "distance then has all of its iterations; “as entered” counts those that were entered."
)
VALIDATION = (
    "Declared: costs.def times the calls that the counting build makes. Measured: by {backends} "
    "(docs/method.md). “The compiler's doing, known”: residues.def; what is left is judged. Functions under "
    "0.1 % of the picture are not shown."
)
GENERAL = "{phases}: counted is the general code, with no kernel generated for the scene."
UNMEASURED = "All FLOPs are declared (costs.def times counted calls): this run has none that were measured."
MEASURED = "{phases}: FLOPs are measured (block counters), since no costs are declared."
HEIGHT = 720  # of the paper's pictures


def _pictures(pictures: Iterable[table1.P]) -> list[table1.P]:
    """Per scene and phase the picture of the paper's height, else the largest. Flags change no FLOP."""
    best: dict[tuple[str, str], table1.P] = {}
    for one in pictures:
        old = best.get((one.scene, one.phase))
        ranks = [(each.height == HEIGHT, each.height) for each in (one, old or one)]
        if one.flags_from == one.phase and (old is None or ranks[0] > ranks[1]):
            best[one.scene, one.phase] = one
    return list(best.values())


def _said(rows: Sequence[Row], calls: Sequence[Row]) -> list[str]:
    """How to read the validation, by the back ends that were there: each has its own sums."""
    names = dict.fromkeys(row.backend for row in rows)
    said = [VALIDATION.format(backends=", ".join(names))] if names else []
    for name in names:
        if equal := [row.within for row in calls if row.backend == name]:
            said.append(f"Calls by name, counting build against {name}: {sum(equal)} of {len(equal)} equal.")
    return said


def counted(path: Path) -> Section:
    """Table 1, where its FLOPs are, and the validation."""
    found, drawn = flops.read(path / "counts.json"), {}
    first = _pictures(found.declared)
    rows = table1.rows(first, _pictures(one for one in found.measured if one.variant == "shipped"))
    about = [CONVENTIONS, RULE]
    for text, some in (
        (GENERAL, [r for r in rows if r.kernel]),
        (MEASURED, [r for r in rows if r.measured_gflop]),
    ):
        if phases := ", ".join(dict.fromkeys(row.phase for row in some)):
            about.append(text.format(phases=phases))
    if rows and not found.measured:
        about.append(UNMEASURED)
    parts = part("table1", "Table 1: FLOPs of a picture", rows, columns.TABLE1, "\n".join(about))
    if any(row.gflop for row in rows):
        caption = "FLOPs of a picture by phase, and the share of lanes at useful work"
        drawn = {"flops": Drawing(caption, CONVENTIONS, partial(_draw, rows))}
    parts += part("table1-terms", "Where the FLOPs are", table1.terms(first), columns.TERMS)
    every = flops.read_validation(path / "validation.json")
    order = list(dict.fromkeys(row.scene for row in every if row.judged))
    judged = sorted((row for row in every if row.judged), key=lambda row: order.index(row.scene))
    calls = [row for row in judged if row.scope.startswith("calls of")]
    judged = [row for row in judged if not row.of_calls]
    totals = [row for row in judged if row.scope == "total"]
    caption = "Declared against measured, whole pictures"
    parts += part("validation", caption, totals, columns.VALIDATION, "\n".join(_said(every, calls)))
    caption = "Declared against measured, by function"
    parts += part("validation-functions", caption, judged, columns.VALIDATION)
    answer = _answer(rows)
    if totals:
        within = f"{sum(row.within for row in totals)} of {len(totals)} pictures"
        answer += f" Declared and executed FLOPs agree within 1 % in {within}."
    told = {"file": path / "counts.json", "script": "scripts/stepwise flops", "drawn": drawn}
    title = "FLOPs: declared, counted, measured"
    return Section("flops", title, "make flops", parts, answer=answer.strip(), **told)


def _draw(rows: Sequence[table1.Row]) -> Figure:
    made = []
    for row in rows:
        share = nan if row.useful_share is None else row.useful_share
        text = "" if isnan(share) else f"{100 * share:.0f} % of lanes used"
        panel = f"{row.scene}, {row.width}×{row.height}"
        made.append(dots.Dot(panel, row.phase, row.gflop or nan, text=text))
    return dots.draw(made, "FLOPs of a picture, all lanes: left is less", "GFLOP, by the paper's convention")


def _answer(rows: Sequence[table1.Row]) -> str:
    """What baseline costs beside the paper's figure, and what the leanest phase saves of it."""
    said: list[str] = []
    for scene in dict.fromkeys(row.scene for row in rows):
        mine = [row for row in rows if row.scene == scene]
        base = next((row for row in mine if row.phase == table1.BASE), None)
        if base is None or (said and not any(row.paper_gflop for row in mine)):
            continue
        flop = base.paper_rule_gflop or base.paper_convention_gflop
        text = f"baseline's {scene} at n = {base.height} takes {show.number(flop, 4)} GFLOP"
        if base.difference is not None and not isnan(base.difference):
            text += f" by the paper's rule, {100 * base.difference:+.1f} % of the paper's own figure"
        least = max((row for row in mine if row.saved), key=lambda row: row.saved or 0, default=None)
        text += f"; {least.phase} saves {show.percent(least.saved)} of them" if least else ""
        said.append(text)
    text = "; ".join(said)
    return f"{text[0].upper()}{text[1:]}." if said else ""
