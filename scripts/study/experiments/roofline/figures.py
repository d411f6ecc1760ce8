"""Figures of the roofline: the roofs with every timed program, and performance against picture height."""

import math
from collections.abc import Sequence
from functools import partial

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from study.bounds import roof, roof_shares
from study.bounds.ceilings import LEVELS, Ceilings
from study.bounds.roof import Point
from study.core import machine, show
from study.experiments.roofline.tables import FOREIGN, counted_by
from study.numbers.analysis import Data
from study.pictures import draw, ladder
from study.pictures.draw import RING, Drawing, bars_of, legend, look, panels, plain_log

CAPTIONS = {
    "roofline": "Every phase below the measured roofs of one core, by bytes as the core sees them; the dash "
    "above a point is the lower of its own operations' roof and of L1's by accesses of its own width",
    "performance": "Flop per core cycle against picture height n (the paper's Fig. 6 in form)",
}
ROOF = "#444444"
LABEL = 1.17  # the height of a roof's label, as a factor

# Solid, dashed, dotted …: levels are told apart without colour.
LEVEL_LINES = dict(zip(LEVELS, ("-", (0, (6, 2)), (0, (3, 2)), (0, (1, 1.5))), strict=True))


def arithmetic_roofs(limits: Ceilings, points: Sequence[Point]) -> list[tuple[float, str]]:
    """Value and label of the FMA and the add or mul roof of each precision and width that a phase uses.

    Roofs within 3 % of each other share a label.
    """
    found: list[tuple[float, list[str]]] = []
    for precision, bits in dict.fromkeys((one.precision, one.bits) for one in points):
        width = "scalar" if bits == roof_shares.ELEMENT[precision] else f"{bits} bits"
        add = np.fmax(limits.flops("add", precision, bits), limits.flops("mul", precision, bits))
        for kind, value in (("FMA", limits.flops("fma", precision, bits)), ("add, mul", float(add))):
            if not value > 0:
                continue
            label = f"{kind} {precision} {width}"
            same = next((several for other, several in found if abs(other / value - 1) < 0.03), None)
            if same is None:
                found.append((value, [label]))
            else:
                same.append(label)
    return [(value, ",\n".join(several) + f": {show.number(value)}") for value, several in sorted(found)]


def slopes(limits: Ceilings, points: Sequence[Point]) -> list[tuple[str, float, str]]:
    """Level, byte/core cycle and label: L1 by each width that a phase uses, the others by their best."""
    near, *others = LEVELS
    found = [
        (near, limits.bandwidth_by(near, bits), f"{near} by {bits} bits")
        for bits in sorted({one.bits for one in points})
    ]
    found += [(level, limits.bandwidth(level), level) for level in others]
    return [
        (level, speed, f"{name}: {show.number(speed)} byte/core cycle")
        for level, speed, name in found
        if speed > 0
    ]


def draw_roofs(
    axes: Axes, levels: list[tuple[str, float, str]], roofs: list[tuple[float, str]], right: float
) -> None:
    """Slopes of the levels up to the highest arithmetic roof, and those roofs."""
    left, top = axes.get_xlim()[0], roofs[-1][0]
    for level, speed, label in levels:
        x = np.array([left, top / speed])
        axes.plot(x, x * speed, color=ROOF, linewidth=1.4, linestyle=LEVEL_LINES[level], label=label)
        heights = max(axes.get_ylim()[0] * 1.8, 1.8 * left * speed) * 1.1 ** np.arange(30)
        along = {"rotation": math.degrees(math.atan(speed)), "rotation_mode": "anchor"}
        name = label.split(":")[0].replace(" by", "").replace(" bits", "")
        place = heights[0] / speed, heights[0]
        made = draw.label(axes, *place, name, ROOF, 7, transform_rotates_text=True, **along)
        made.spots = np.stack([heights / speed, heights], axis=-1)
    first, beside = min((top / speed for _, speed, _ in levels), default=left), 0.0
    for value, label in roofs:
        beside = max(value, beside * LABEL)  # labels of roofs that are close stand apart
        start = first * value / top  # where the fastest level reaches it
        axes.plot(
            [max(start, left), right], [value, value], color=ROOF, linewidth=1.0 if value < top else 1.6
        )
        axes.text(right * 1.04, beside, label, fontsize=7, va="center", color=ROOF)


def roofline(points: Sequence[Point], limits: Ceilings) -> Figure:
    """One panel per scene, log-log. `points`: one per scene and phase; whiskers: the 95 % interval."""
    roofs, table = arithmetic_roofs(limits, points), pd.DataFrame(points)
    columns = min(2, len({one.scene for one in points}))
    figure, grid = panels(table, 6.0, 7.6, columns)
    title = (
        "What one core can do (lines, measured in this run) and what each phase does "
        "of it (marks, with flop per core cycle): a roofline.\n"
        "A slanted line is the most that a cache or memory can feed, a level one the most that arithmetic "
        "can do. The dash above a mark:\n"
        "the phase's own limit, the lower of its operations' (div, sqrt, min/max … at their own rate) and "
        "of L1's by its width of access."
    )
    figure.suptitle(title, x=0.01, ha="left", fontsize=10.5)
    looks = look(table)
    ends = [(one.flops_per_core_cycle, one.flops_per_core_cycle_low) for one in points]
    bottom = min(end for pair in ends for end in pair if not math.isnan(end)) / 2
    top = roofs[-1][0] * 1.6 if roofs else max(speed for speed, _ in ends) * 2
    left, right = min(one.intensity for one in points) / 3, max(one.intensity for one in points) * 3
    levels = slopes(limits, points)
    if speeds_of := [speed for _, speed, _ in levels]:
        left, right = min(left, top / max(speeds_of) / 30), max(right, 1.6 * top / min(speeds_of))
    for scene, axes in grid.items():
        axes.set(xscale="log", yscale="log", xlim=(left, right), ylim=(bottom, top), title=scene)
        axes.set(xlabel="operational intensity: flop per byte loaded or stored", ylabel="flop per core cycle")
        mine = [one for one in points if one.scene == scene]
        if roofs:
            draw_roofs(axes, levels, roofs, right)
        for one in mine:
            style = looks[one.phase, one.threads]
            draw_point(axes, one, style)
            speed = one.flops_per_core_cycle
            name = f"{style['label']} {show.number(speed)}"
            draw.label(axes, one.intensity, speed, name, style["color"])
        plain_log(axes.xaxis)
        plain_log(axes.yaxis)
    dash = Line2D([], [], color="black", marker="_", markersize=14, mew=2.2, linestyle="none")
    dash.set_label("roof of its own operations, or of L1")
    above = any(max_share(one) > 1 for one in points)
    ring = [Line2D([], [], label="above its roof: see below", **RING)] if above else []
    legend(figure, grid, (dash, *ring))
    return figure


def max_share(point: Point) -> float:
    return float(np.fmax(point.share_of_fma_roof, point.share_of_mix_roof))


def draw_point(axes: Axes, point: Point, style: dict) -> None:
    """A phase, its whisker, its own least roof above."""
    x, y, least, colour = point.intensity, point.flops_per_core_cycle, point.least_roof, style["color"]
    if least > 0:
        axes.plot([x, x], [y, least], color=colour, linewidth=0.8, linestyle=":")
        axes.plot(x, least, marker="_", color=colour, markersize=14, mew=2.2)
    ends = bars_of(pd.DataFrame([point]), "flops_per_core_cycle")
    drawn = {"color": colour, "markerfacecolor": style["markerfacecolor"], "linestyle": "none"}
    axes.errorbar(x, y, yerr=ends, color=colour, capsize=3, linestyle="none")
    axes.plot(x, y, marker=style["marker"], label=style["label"], markersize=9, zorder=5, **drawn)
    if max_share(point) > 1:
        axes.plot(x, y, **RING)


def performance(points: Sequence[Point]) -> Figure:
    """The paper's Fig. 6 in form: flop per core cycle against n; its own values as stars on the right."""
    title = "Performance against picture height; stars: the paper's own (i7-7700, its convention)"
    table = pd.DataFrame(points)
    figure = ladder.against_n(table, "flops_per_core_cycle", "flop per core cycle", title)
    looks = look(table)
    for axes, scene in zip(figure.axes, dict.fromkeys(one.scene for one in points), strict=False):
        for one in points:
            if one.scene != scene or not one.paper_flops_per_cycle > 0:
                continue
            star = {"color": looks[one.phase, one.threads]["color"], "markeredgecolor": "black"}
            at = {"transform": axes.get_yaxis_transform(), "clip_on": False, "markersize": 11}
            axes.plot(1.02, one.paper_flops_per_cycle, marker="*", linestyle="none", **star, **at)
        plain_log(axes.yaxis)
    return figure


def caption(data: Data, points: Sequence[Point], limits: Ceilings | None) -> str:
    """Machine, clock, what counted, and what the roofs (where there are any) and whiskers are."""
    every = (counted_by(one).removesuffix(FOREIGN) for one in points)  # told below
    text = (
        f"{machine.name(data.context)}; one thread. FLOPs by the machine's convention (an FMA is two), "
        f"counted by {'; '.join(dict.fromkeys(every))}. Points: median over process launches; whiskers: its "
        "95 % interval (none where launches are fewer than 3)."
    )
    if limits:
        text += (
            f" Roofs: the best that build/ceilings saw three times, core {limits.core_hz / 1e9:.2f} "
            "GHz; bandwidth: the most of load, store and copy."
        )
    return "\n".join([text, *roof.remarks(points), *(limits.remarks() if limits else [])])


def drawings(data: Data, points: Sequence[Point], limits: Ceilings | None) -> dict[str, Drawing]:
    """Each figure that the run has data for: a roofline needs ceilings and counted bytes."""
    made = {}
    shown = roof.headline(one for one in points if one.intensity > 0)
    if limits and shown:
        about = caption(data, shown, limits)
        made["roofline"] = Drawing(CAPTIONS["roofline"], about, partial(roofline, shown, limits))
    if points:
        about = caption(data, points, None)
        made["performance"] = Drawing(CAPTIONS["performance"], about, partial(performance, points))
    return made
