"""The figures of further views, made from views.json and the thumbnails beside it alone."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from study.core import machine, show
from study.experiments.views.gains import ends
from study.experiments.views.measure import BASE, Row
from study.measuring.views import CLEAR
from study.numbers.stats import Interval
from study.pictures.draw import Drawing, thumbnails
from study.pictures.hover import tell

SHEET, RATIOS = "views-sheet", "views-ratios"


def _said(row: Row) -> str:
    value, low, high = ends(row)
    gain = show.interval({"v": value, "v_low": low, "v_high": high}, "v", 3, "×")
    return f"{row['phase']}, {row['scene']}, {row['view']}: {gain} its parent's speed"


def ratios(result: Row) -> Figure:
    """A column a phase: a mark for each view, the median of the others as a bar."""
    found = result["rungs"]
    figure = Figure(figsize=(max(8, 1.5 * len(found) + 2.6), 4.4), layout="constrained")
    title = "Gain of each phase over its parent, view by view; by name: the view of least gain (scene, place)"
    figure.suptitle(title, x=0.01, ha="left", fontsize=12)
    axes = figure.subplots()
    axes.axhline(1, color="#888888", linewidth=1)
    for place, rung in enumerate(found):
        mine = [r for r in result["rows"] if r["phase"] == rung["phase"] and r["ratio"]]
        others, tuned = ([r for r in mine if r["tuned"] is flag] for flag in (False, True))
        aside = place + 0.5 * (np.arange(len(others)) / max(1, len(others) - 1) - 0.5)
        dots = {"s": 16, "color": "#56B4E9", "linewidth": 0, "zorder": 2}
        dots["label"] = "" if place else "another view"
        drawn = axes.scatter(aside, [ends(r)[0] for r in others], **dots)
        tell(drawn, [_said(r) for r in others])
        marks = {"s": 46, "marker": "D", "color": "#D55E00", "zorder": 3}
        where = [place - 0.36 + 0.08 * i for i in range(len(tuned))]
        marks["label"] = "" if place else "a tuned view"
        drawn = axes.scatter(where, [ends(r)[0] for r in tuned], **marks)
        tell(drawn, [_said(r) for r in tuned])
        middle = rung["median"]
        value = middle.value if isinstance(middle, Interval) else middle["value"]
        axes.plot([place - 0.3, place + 0.3], [value] * 2, color="black", linewidth=2, zorder=4,
                  label="" if place else "median of the other views")  # fmt: skip
        if rung["worst"]:
            text = f"{rung['worst_scene']}\n{rung['worst_view']}"
            low = min(ends(r)[0] for r in others)
            box = {"facecolor": "white", "edgecolor": "none", "pad": 1, "alpha": 0.85}
            under = {"textcoords": "offset points", "ha": "center", "va": "top", "bbox": box}
            axes.annotate(text, (place, low), (0, -5), fontsize=7.5, **under)
    axes.set_xticks(range(len(found)), [f"{r['phase']}\nover {r['parent']}" for r in found], fontsize=8.5)
    axes.set(yscale="log", ylabel="times as fast as its parent", xlim=(-0.6, len(found) - 0.4))
    low, high = axes.get_ylim()
    axes.set_ylim(min(low, 0.9) / (high / low) ** 0.12, max(high, 1.12))  # room for the worst one's name
    few = high / low < 6
    axes.yaxis.set_major_locator(LogLocator(subs=(1, 1.25, 1.5, 2, 3, 5, 7) if few else (1, 2, 5)))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.10g}×"))
    axes.yaxis.set_minor_formatter(NullFormatter())
    figure.legend(loc="outside right upper", frameon=False, fontsize=9)
    return figure


def sheet(result: Row, folder: Path) -> Figure | None:
    """The views as they were rendered: a row per scene."""
    lines: dict[str, dict[Path, str]] = {}
    for one in result.get("thumbnails", ()):
        about = f"{one['scene']}, {one['view']}: {one['change']}" + (" (tuned)" if one["tuned"] else "")
        lines.setdefault(one["scene"], {})[folder / one["picture"]] = about
    return thumbnails("Every scene from four places", [*lines.values()], (0.4, 0.8))


def figures(result: Row, folder: Path) -> dict[str, Figure]:
    """Every figure that there is something for. `folder`: of the run, where the thumbnails are."""
    return {name: drawing.make() for name, drawing in drawings(result, folder).items()}


def drawings(result: Row, folder: Path) -> dict[str, Drawing]:
    """What views.json suffices for, and the sheet where the run's folder has its thumbnails."""
    made = {}
    if result["rungs"]:
        about = "Gain of each phase over its parent on every view"
        made[RATIOS] = Drawing(about, note(result), lambda: ratios(result))
    if any((folder / one["picture"]).is_file() for one in result.get("thumbnails", ())):
        about = "The views: each scene's own and three further ones"
        made[SHEET] = Drawing(about, note(result), lambda: sheet(result, folder), True)
    return made


def answer(result: Row) -> str:
    """How many phases gain in the median of views that nothing was tuned on, and the least of all gains."""
    gains = [(ends({"ratio": one["median"]}), one) for one in result["rungs"]]
    found = [one for one in gains if math.isfinite(one[0][1])]
    if not found:
        return ""
    wins = [one for one in found if one[0][1] > 1]
    least = min(found, key=lambda one: one[0][0])[1]
    return (
        f"{len(wins)} of {len(found)} phases are faster than their parent in the median of views that "
        f"nothing was tuned on; the least gain is {least['phase']}'s, {show.spread(least['median'], 3, '×')}."
    )


def note(result: Row) -> str:
    cpu = machine.name(result.get("context"))
    return (
        f"{cpu}; one thread, n = {result['n']}, median of {result['launches']} interleaved launches. "
        "Constants may be tuned on the own views of scene0 and mandelbulb; the others are only measured. "
        "Each scene is also seen after 40° round the mean distance of its shapes to either side, and from "
        f"0.6 of that distance (less where a shape would be within {CLEAR:g} of the way). Errors: pictures "
        f"at n = {result['error_n']}, linear RGB, to ground truth while the time lasts, else to {BASE}. "
        "A phase that generates kernels runs its parent's code where it has none: no gain, and in no median."
    )
