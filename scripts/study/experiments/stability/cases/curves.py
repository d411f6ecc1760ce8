"""One figure a case: error against strength, all phases, the limit as a line."""

import math
import textwrap
from pathlib import Path

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, NullFormatter, NullLocator

from study.experiments.stability.schema import Case, Row
from study.pictures.draw import BAD, COLOURS, MARKERS, STYLE, save, thumbnail

MARK = {
    "not finite": "NaN",
    "crashed": "crash",
    "hung": "hang",
    "broken": "case broken",
    "wrong": "no answer",
}


def number(value: float) -> str:
    """1e-06 as 10⁻⁶, 0.03 and 1024 as they are."""
    if value == 0 or 1e-3 <= abs(value) < 1e5:
        return f"{value:.4g}" if abs(value) < 9999.5 else f"{value:,.0f}"
    digits, power = f"{value:.1e}".split("e")
    digits = digits.rstrip("0").rstrip(".")
    raised = str(int(power)).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
    return f"10{raised}" if digits == "1" else f"{digits}·10{raised}"


def _span(rows: list[Row], limit: float) -> tuple[float, float]:
    """Where the errors of 0 are drawn, and where those that are no number: below and above all others."""
    seen = [e for r in rows for e in r.errors if e] + [limit] * (limit > 0) or [1.0]
    return 10 ** (math.floor(math.log10(min(seen))) - 1), 10 ** (math.ceil(math.log10(max(seen))) + 1)


def _apart(places: list[float], values: list[float]) -> list[float]:
    """The values whose labels have room beside each other: from both ends inwards, the hardest first."""
    room = 0.095 * (max(places) - min(places))
    order = sorted(range(len(values)), key=lambda i: (i not in (0, len(values) - 1), -i))
    kept: list[int] = []
    for i in order:
        if all(abs(places[i] - places[j]) >= room for j in kept):
            kept.append(i)
    return [values[i] for i in kept]


def _strength_axis(axes: Axes, case: Case) -> None:
    """Runs from easy (left) to hard, logarithmic where the strengths are positive and span much."""
    values = list(case.strengths)
    low, high = min(values), max(values)
    by_powers = low > 0 and high / low > 20
    if by_powers:
        axes.set_xscale("log")
    if values[-1] < values[0]:
        axes.invert_xaxis()
    axes.xaxis.set_major_locator(
        FixedLocator(_apart([math.log(v) if by_powers else v for v in values], values))
    )
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(lambda value, _: number(value))
    axes.set_xlabel(f"{case.strength}: harder to the right →")


def _figure(case: Case, rows: list[Row], names: list[str]) -> tuple[Figure, str]:
    """The figure of a case and its note, from its rows; `names`: all phases."""
    limit = case.fails_above
    figure = Figure(figsize=(8.2, 4.4), layout="constrained")
    axes = figure.subplots()
    axes.set_yscale("log")
    floor, ceiling = _span(rows, limit)
    for place, r in enumerate(rows):
        look = names.index(r.phase)
        colour, marker = COLOURS[look % len(COLOURS)], MARKERS[look % len(MARKERS)]
        nested = 12 - 8 * place / max(1, len(rows) - 1)  # phases that agree stay visible, one in another
        points = [
            (s, ceiling if e is None else max(e, floor))
            for s, e, state in zip(r.strengths, r.errors, r.states, strict=True)
            if state != "refused"
        ]
        label = r.phase + (" (refuses)" if r.refused else "")
        drawn = {"color": colour, "marker": marker, "label": label, "lw": 0.6 + nested / 8}
        axes.plot(*zip(*points, strict=True) if points else ([], []), ms=nested, mfc="none", mew=1.4, **drawn)
    lost = _lost(axes, rows, ceiling)
    if limit > 0:
        axes.axhline(limit, color=BAD, lw=1.4, ls="--")
        axes.axhspan(limit, ceiling * 2, color=BAD, alpha=0.05)
    else:
        axes.axhspan(floor * 1.8, ceiling * 2, color=BAD, alpha=0.05)
    _strength_axis(axes, case)
    _error_axis(axes, floor, ceiling, lost)
    unit = f", {case.unit}" if case.unit and case.unit not in case.metric else ""
    axes.set_ylabel(textwrap.fill(f"{case.metric}{unit}", 44))
    figure.suptitle(f"{case.number}. {case.title}", x=0.01, ha="left", fontsize=11, fontweight="bold")
    handles, _ = axes.get_legend_handles_labels()
    if limit > 0:
        said = f"limit {number(limit)} {case.unit}".strip()
        handles.append(Line2D([], [], color=BAD, ls="--", label=said))
    figure.legend(handles=handles, loc="outside right upper", frameon=False, fontsize=9)
    fails = "fails" if limit > 0 else "fails (anything above 0)"
    return figure, f"Shaded: {fails}. Markers one in another: phases that agree."


def draw(case: Case, rows: list[Row], names: list[str], stem: Path) -> list[Path]:
    with matplotlib.rc_context(STYLE):
        figure, note = _figure(case, rows, names)
        return save(figure, stem, note)


def small(case: Case, rows: list[Row], names: list[str]) -> bytes:
    with matplotlib.rc_context(STYLE):
        return thumbnail(*_figure(case, rows, names))


def _lost(axes: Axes, rows: list[Row], ceiling: float) -> bool:
    """Says at the ceiling who gave no number there, and why; whether anybody did not."""
    said: dict[tuple[float, str], list[str]] = {}
    for r in rows:
        for strength, error, state in zip(r.strengths, r.errors, r.states, strict=True):
            if state in MARK and error is None:
                said.setdefault((strength, MARK[state]), []).append(r.phase)
    for line, ((strength, what), phases) in enumerate(said.items()):
        text = f"{what}: {', '.join(phases)}"
        axes.annotate(text, (strength, ceiling), (-9, 4 - 9 * line), textcoords="offset points",
                      ha="right", va="top", fontsize=7.5, color=BAD)  # fmt: skip
    return bool(said)


def _error_axis(axes: Axes, floor: float, ceiling: float, lost: bool) -> None:
    """Powers of ten, the floor called 0 and the ceiling 'none' (no number)."""
    low, high = round(math.log10(floor)), round(math.log10(ceiling))
    step = max(1, math.ceil((high - low) / 8))
    powers = list(range(low + 1, high, step))
    ticks = [floor, *(10.0**p for p in powers)] + [ceiling] * lost
    names = ["0", *(number(10.0**p) for p in powers)] + ["none"] * lost
    axes.yaxis.set_major_locator(FixedLocator(ticks))
    axes.yaxis.set_major_formatter(lambda _, place: "" if place is None else names[int(place)])
    axes.yaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.set_ylim(floor / 2, ceiling * (2 if lost else 0.3))
