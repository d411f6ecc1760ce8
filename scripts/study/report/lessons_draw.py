"""Draws the data of `lessons.figure`: an SVG on white ground, so that a light and a dark page can hold it."""

import io
import math
import re

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from study.pictures.draw import PASSES, STYLE, plain_log
from study.report import lessons
from study.report.lessons import Panel, Value

WIDTH, ROW, EDGES = 7.5, 0.24, 0.9  # inches: of the figure, of a row, of a panel without its rows
BEFORE, AFTER, OTHER = "#8c8c8c", "#0072b2", "#c77700"
LINES_HIGH = 2.6


def number(value: float) -> str:
    """Three digits that matter: 1,230 or 0.0123."""
    if abs(value) >= 100:
        return f"{value:,.0f}"
    return f"{value:.{max(0, 2 - math.floor(math.log10(abs(value))))}f}" if value else "0"


def _ends(value: Value) -> tuple[float, float]:
    middle = value.value or 0.0
    return middle - (middle if value.low is None else value.low), (value.high or middle) - middle


def _pairs(axes: Axes, panel: Panel) -> None:
    """Rows on a logarithmic axis: a hollow mark before, a full one after, both values and their ratio."""
    beside = {"transform": axes.get_yaxis_transform(), "va": "center", "fontsize": 8}
    for place, row in enumerate(panel.rows):
        before, after = row.values
        axes.plot([before.value, after.value], [place] * 2, color="#bbbbbb", linewidth=1.5, zorder=1)
        for value, colour, fill in ((before, BEFORE, "white"), (after, AFTER, AFTER)):
            if value.low is not None:
                axes.plot([value.low, value.high], [place] * 2, color=colour, linewidth=4)
            axes.plot([value.value], [place], "o", color=colour, markerfacecolor=fill, markersize=6)
        first, second = before.value or math.nan, after.value or math.nan
        ratio = first / second if panel.unit == "ms" else second / first
        axes.text(1.02, place, f"{number(ratio)}×", **beside, fontweight="bold")
        axes.text(1.13, place, f"{number(first)} → {number(second)}", **beside)
    axes.set_xscale("log")
    axes.margins(x=0.06)
    plain_log(axes.xaxis)


def _bars(axes: Axes, panel: Panel) -> None:
    """A bar a row and series from 0 on, its value beside it."""
    series, high = len(panel.series), 0.8 / len(panel.series)
    for index, colour in enumerate((AFTER,) if series == 1 else (BEFORE, AFTER)):
        for place, row in enumerate(panel.rows):
            value, at = row.values[index], place + high * (index - (series - 1) / 2)
            if value.value is None:
                axes.text(0, at, " infinite", va="center", fontsize=8)
                continue
            low, up = _ends(value)
            axes.barh(
                at, value.value, high * 0.9, color=colour, xerr=[[low], [up]], error_kw={"linewidth": 1}
            )
            axes.text(value.value + up, at, f"  {number(value.value)}", va="center", fontsize=8)
    axes.margins(x=0.12)


def _lines(axes: Axes, panel: Panel) -> None:
    """A curve a series over the rows' labels, which are numbers."""
    across = [float(row.label) for row in panel.rows]
    for index, colour in zip(range(len(panel.series)), (BEFORE, OTHER, AFTER), strict=False):
        heights = [row.values[index].value for row in panel.rows]
        axes.plot(across, [math.nan if y is None else y for y in heights], "o-", color=colour, markersize=5)
    axes.set_ylim(0, None)
    axes.set_xticks(across)


CLIP = re.compile(r"\bp[0-9a-f]{10}\b")
KINDS = {"pairs": _pairs, "bars": _bars, "lines": _lines}


def _high(panel: Panel) -> float:
    of_row = ROW * (len(panel.series) if panel.kind == "bars" else 1) + 0.04
    return EDGES + (LINES_HIGH if panel.kind == "lines" else of_row * len(panel.rows))


def draw(lesson: lessons.Figure) -> Figure:
    heights = [_high(panel) for panel in lesson.panels]
    figure = Figure(figsize=(WIDTH, sum(heights) + 0.7), layout="constrained", facecolor="white")
    figure.suptitle(f"{lesson.phase}: {lesson.title}", x=0.01, ha="left", fontsize=12, fontweight="bold")
    grid = figure.subplots(len(heights), 1, squeeze=False, height_ratios=heights)[:, 0]
    right = 1.4 if any(panel.kind == "pairs" for panel in lesson.panels) else 1  # their values stand there
    for axes, panel in zip(grid, lesson.panels, strict=True):
        KINDS[panel.kind](axes, panel)
        axes.set_title(f"{panel.title} ({panel.unit})", loc="left", fontsize=9.5, fontweight="bold")
        if panel.kind != "lines":
            axes.set_yticks(range(len(panel.rows)), [row.label for row in panel.rows], fontsize=8.5)
            axes.set_ylim(len(panel.rows) - 0.4, -0.6)
            axes.grid(False, axis="y")
        axes.tick_params(labelsize=8.5)
        if len(panel.series) > 1:
            colours = (BEFORE, OTHER, AFTER) if panel.kind == "lines" else (BEFORE, AFTER)
            for name, colour in zip(panel.series, colours, strict=False):
                hollow = "white" if panel.kind == "pairs" and colour == BEFORE else colour
                axes.plot([], [], "o", color=colour, markerfacecolor=hollow, label=name)
            above = {"loc": "lower right", "bbox_to_anchor": (right, 1), "ncols": 2, "borderpad": 0}
            place = {"loc": "upper left"} if panel.kind == "lines" else above
            axes.legend(**place, frameon=False, fontsize=8, handletextpad=0.1, columnspacing=1)
    figure.supxlabel(lesson.caption, x=0.01, ha="left", fontsize=7.5, color="#555555")
    for _ in range(PASSES):
        figure.draw_without_rendering()
    return figure


def svg(lesson: lessons.Figure) -> str:
    """The same bytes for the same data. matplotlib names a clip path after the last bits of its place."""
    made = io.StringIO()
    with matplotlib.rc_context(STYLE):
        draw(lesson).savefig(made, format="svg", metadata={"Date": None})
    names: dict[str, str] = {}
    return CLIP.sub(lambda found: names.setdefault(found[0], f"clip{len(names)}"), made.getvalue())
