"""The tables and the figure of further views, made from views.json alone."""

import math
from functools import partial
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from study.core import show
from study.core.show import Column
from study.experiments.section import Found, Part, left_out, part
from study.experiments.views.gains import ALONE, BASE, EVERYWHERE, MEDIAN
from study.experiments.views.schema import Furthest, Gain, Row, Views, decibels
from study.measuring.views import CLEAR, OWN
from study.numbers.schema import Interval
from study.pictures.draw import Drawing


def _text(found: Interval | None) -> str:
    return show.spread(found, 3, "×")


def _tuned(row: Gain) -> str:
    return "; ".join(f"{scene} {_text(found)}" for scene, found in row.tuned.items()) or show.NOTHING


def _worst(row: Gain) -> str:
    return f"{_text(row.worst)} {row.worst_scene} {row.worst_view}" if row.worst else show.NOTHING


def _db(low: Furthest | None) -> str:
    if low is None:
        return show.NOTHING
    if low.no_value:
        return f"not finite: {low.scene} {low.view}"
    own, parent = ("identical" if x is None else show.number(x) for x in (low.psnr_db, low.parent_db))
    beside = "its parent is the reference" if low.parent_is_reference else f"parent {parent}"
    return f"{own} ({beside}): {low.scene} {low.view}"


def _mark(row: Gain) -> str:
    text = row.verdict
    if text == ALONE or text.startswith("slower"):
        return "bad"
    return "good" if text == EVERYWHERE or (text.startswith(MEDIAN) and text.endswith("none")) else ""


OVER = "times as fast as its parent"
GAINS = [
    Column("", "phase", lambda r: r.phase),
    Column("", "parent", lambda r: r.parent),
    Column(OVER, "tuned views [95 %]", _tuned),
    Column(OVER, "median of the other views [95 %]", lambda r: _text(r.median)),
    Column(OVER, "worst case [95 %]", _worst),
    Column(OVER, "slower on", lambda r: f"{r.slower} of {r.views}"),
    Column(OVER, "of them by its parent's code", lambda r: str(r.general)),
    Column("", "verdict", lambda r: r.verdict, _mark),
    Column("lowest PSNR of all views, dB", "to ground truth", lambda r: _db(r.to_truth)),
    Column("lowest PSNR of all views, dB", f"to {BASE} (fractals: 4×4 averaged)", lambda r: _db(r.to_base)),
    Column("", "most wrong hits, ppm", show.plain("wrong_ppm")),
]


LOSES = 1.03  # a step takes no longer than that on a scene that it draws
LOSES_WHERE = "Where a step loses: time of each phase over its parent's, scene by scene"
LOSES_NOTE = f"✗: over {LOSES:g}×, and the whole interval is over 1. Each scene from its own view."
POINTS = [
    Column("", "program", lambda r: r.phase),
    Column("", "scene", show.picture),
    Column("", "view", lambda r: f"{r.view}: {r.change}"),
    Column("", "ms a frame [95 %]", show.spread_of("ms")),
    Column("", "× parent [95 %]", show.spread_of("ratio", "×")),
    Column("", "code", lambda r: r.general or ""),
    Column("error", "reference", lambda r: r.reference or "is it itself"),
    Column("error", "PSNR, dB", lambda r: show.number(r.level) if r.reference else show.NOTHING),
    Column("error", "ideal shadow, dB", lambda r: show.number(decibels(r.psnr_ideal_db, r.rmse_ideal))),
    Column("error", "wrong hit, ppm", show.plain("wrong_ppm")),
    Column("error", "depth agrees", lambda r: show.share(r.depth_agree_fraction)),
]


Line = dict[str, Row]  # of one scene, by phase


def _lost(phase: str, line: Line) -> str:
    row = line.get(phase)
    return "bad" if row and row.loses and 1 / row.ends[0] > LOSES else ""


def _over_parent(phase: str, line: Line) -> str:
    if phase not in line:
        return show.NOTHING
    value, low, high = (1 / end for end in line[phase].ends)
    text = show.spread({"value": value, "low": high, "high": low}, 3, "×")
    return f"{text} ✗" if _lost(phase, line) else text


def losses(result: Views) -> list[Part]:
    """Time of each phase over its parent's, scene by scene, each seen from its own place."""
    lines: dict[str, Line] = {}
    for row in result.rows:
        if row.view == OWN and row.ratio:
            lines.setdefault(row.scene, {})[row.phase] = row
    columns = [Column("", "scene", lambda line: show.picture(next(iter(line.values()))))]
    for gain in result.steps:
        told = partial(_over_parent, gain.phase), partial(_lost, gain.phase)
        columns.append(Column("time over its parent's", f"{gain.phase} [95\u00a0%]", *told))
    return part("views-losses", LOSES_WHERE, [*lines.values()], columns, LOSES_NOTE)


def parts(result: Views) -> list[Part]:
    size = f"times at n = {result.n}, errors at n = {result.error_n}"
    caption = f"Each phase against its parent, on views it was not tuned on; {size}"
    return [
        *part("views", caption, result.steps, GAINS),
        *losses(result),
        *part("views-points", "Every program on every view", result.rows, POINTS),
        *left_out("views-left-out", [*result.failures, *result.left_out]),
    ]


def ratios(result: Views) -> Figure:
    """A column a phase: a mark for each view, the median of the others as a bar."""
    found = result.steps
    figure = Figure(figsize=(max(8, 1.5 * len(found) + 2.6), 4.4), layout="constrained")
    title = "Gain of each phase over its parent, view by view; by name: the view of least gain (scene, place)"
    figure.suptitle(title, x=0.01, ha="left", fontsize=12)
    axes = figure.subplots()
    axes.axhline(1, color="#888888", linewidth=1)
    line = {"color": "black", "linewidth": 2, "zorder": 4}
    dots: dict[str, Any] = {"s": 16, "color": "#56B4E9", "linewidth": 0, "zorder": 2}
    marks: dict[str, Any] = {"s": 46, "marker": "D", "color": "#D55E00", "zorder": 3}
    for place, gain in enumerate(found):
        named = (lambda text: text) if place == 0 else (lambda text: "")  # for the legend, once
        mine = [row for row in result.rows if row.phase == gain.phase and row.ratio]
        others, tuned = ([row.ends[0] for row in mine if row.tuned is flag] for flag in (False, True))
        aside = place + 0.5 * (np.arange(len(others)) / max(1, len(others) - 1) - 0.5)
        axes.scatter(aside, others, **dots, label=named("another view"))
        beside = place - 0.36 + 0.08 * np.arange(len(tuned))
        axes.scatter(beside, tuned, **marks, label=named("a tuned view"))
        middle = gain.median.ends[0] if gain.median else math.nan
        label = named("median of the other views")
        axes.plot([place - 0.3, place + 0.3], [middle] * 2, label=label, **line)
        if gain.worst:
            box = {"facecolor": "white", "edgecolor": "none", "pad": 1, "alpha": 0.85}
            under: dict[str, Any] = {"textcoords": "offset points", "ha": "center", "va": "top", "bbox": box}
            text = f"{gain.worst_scene}\n{gain.worst_view}"
            axes.annotate(text, (place, min(others)), (0, -5), fontsize=7.5, **under)
    axes.set_xticks(range(len(found)), [f"{one.phase}\nover {one.parent}" for one in found], fontsize=8.5)
    axes.set(yscale="log", ylabel=OVER, xlim=(-0.6, len(found) - 0.4))
    low, high = axes.get_ylim()
    axes.set_ylim(min(low, 0.9) / (high / low) ** 0.12, max(high, 1.12))  # room for the worst one's name
    few = high / low < 6
    axes.yaxis.set_major_locator(LogLocator(subs=(1, 1.25, 1.5, 2, 3, 5, 7) if few else (1, 2, 5)))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.10g}×"))
    axes.yaxis.set_minor_formatter(NullFormatter())
    figure.legend(loc="outside right upper", frameon=False, fontsize=9)
    return figure


def drawings(result: Views) -> dict[str, Drawing]:
    caption = "Gain of each phase over its parent on every view"
    drawn = Drawing(caption, note(result), lambda: ratios(result))
    return {"views-ratios": drawn} if result.steps else {}


def answer(result: Views) -> str:
    """How many phases gain in the median of views that nothing was tuned on, and the least of all gains."""
    found = [(one.median.ends, one) for one in result.steps if one.median]
    found = [(ends, one) for ends, one in found if math.isfinite(ends[1])]
    if not found:
        return ""
    least = min(found, key=lambda pair: pair[0][0])[1]
    gaining = sum(ends[1] > 1 for ends, _ in found)
    return (
        f"{gaining} of {len(found)} phases are faster than their parent in the median of views that nothing "
        f"was tuned on; the least gain is {least.phase}'s, {_text(least.median)}."
    )


def note(result: Views) -> str:
    return (
        f"{result.machine}; one thread, n = {result.n}, median of {result.launches} interleaved launches. "
        "Constants may be tuned on the own views of scene0 and mandelbulb; the others are only measured. "
        "Each scene is also seen after 40° round the mean distance of its shapes to either side, and from "
        f"0.6 of that distance (less where a shape would be within {CLEAR:g} of the way). Errors: pictures "
        f"at n = {result.error_n}, linear RGB, to ground truth while the time lasts, else to {BASE}. "
        "A phase that generates kernels runs its parent's code where it has none: no gain, and in no median."
    )


def found(result: Views) -> Found:
    return Found(parts(result), answer(result), drawings(result))
