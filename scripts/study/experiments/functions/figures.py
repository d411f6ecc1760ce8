"""Figures of function approximations, made from functions.json alone."""

from collections.abc import Sequence
from functools import partial

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import NullFormatter

from study.core import show
from study.experiments.functions import measure
from study.experiments.functions.schema import Entry, Functions
from study.experiments.functions.tables import TITLES, judged
from study.pictures import draw
from study.pictures.draw import COLOURS, MARKERS, Drawing, plain_log

FAMILIES = ("libm", "instruction", "bit trick", "own", "libmvec", "SLEEF")
LOOKS = {name: (COLOURS[i], MARKERS[i]) for i, name in enumerate(FAMILIES)}
# What is on the axis of time, and how to read it.
TIMES = {"stream_ns": "ns per element, throughput", "latency_ns": "ns per call, latency"}
SIZES = {"scalar": 22, "SSE": 34, "NEON": 34, "AVX2": 52, "AVX-512": 80}


def _panel(axes: Axes, rows: Sequence[Entry], title: str, time: str) -> None:
    front = sorted((r for r in rows if measure.on_front(r, rows, time)), key=lambda r: r.ulp)
    for row in rows:
        colour, marker = LOOKS[row.family]
        filled = row in front
        style = {"facecolor": colour if filled else "white", "zorder": 4 if filled else 3, "linewidth": 1.1}
        axes.scatter(row.ulp, row.ns(time), s=SIZES[row.isa], marker=marker, edgecolor=colour, **style)
    style = {"color": "#555555", "linewidth": 1, "drawstyle": "steps-post", "zorder": 2}
    axes.plot([r.ulp for r in front], [r.ns(time) for r in front], **style)
    axes.set(title=title, xscale="log", yscale="log")
    axes.margins(0.12, 0.14)
    scalar = [r for r in rows if r.family == "libm" and r not in front]
    for row in [*front, *scalar]:
        draw.label(axes, row.ulp, row.ns(time), f"{row.name}, {row.isa}", "black", 6.5)
    plain_log(axes.yaxis)
    low, high = axes.get_xlim()
    if high / low < 1e5:  # beyond it powers of ten are shorter
        plain_log(axes.xaxis)
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.yaxis.set_minor_formatter(NullFormatter())


def figure(result: Functions, precision: str, time: str = "stream_ns") -> Figure:
    """A panel per function: largest error in ulp against time, the front filled and named."""
    made = Figure(figsize=(13.5, 11.5), layout="constrained")
    grid = made.subplots(3, 3)
    about = f"Functions in {precision}, {TIMES[time].partition(', ')[2]}: left is more exact, down is faster"
    made.suptitle(about, x=0.01, ha="left", fontsize=12)
    for axes, function in zip(grid.flat, measure.FUNCTIONS, strict=True):
        rows = judged(result.entries, (function, precision), time)
        if not rows:
            axes.set_axis_off()
            axes.set_title(f"{TITLES[function]}: no errors measured")
            continue
        _panel(axes, rows, TITLES[function], time)
    for axes in grid[-1]:
        axes.set_xlabel("largest error, ulp")
    for axes in grid[:, 0]:
        axes.set_ylabel(TIMES[time])
    seen = [r for f in measure.FUNCTIONS for r in judged(result.entries, (f, precision), time)]
    marks = [
        Line2D([], [], color=c, marker=m, linestyle="none", label=name)
        for name, (c, m) in LOOKS.items()
        if any(r.family == name for r in seen)
    ]
    marks += [
        Line2D([], [], color="#777777", marker="o", linestyle="none", markersize=size**0.5, label=isa)
        for isa, size in SIZES.items()
        if any(r.isa == isa for r in seen)  # no AVX-512 where the CPU has none
    ]
    marks.append(Line2D([], [], color="#555555", linewidth=1, label="front (filled marks)"))
    made.legend(handles=marks, loc="outside right upper", frameon=False, fontsize=9)
    return made


ABOUT = {
    "stream_ns": "Throughput: independent elements, however many at once.",
    "latency_ns": "Latency: a chain in which each call waits for the last, less the chain's own cost; a call "
    "of a vector is as long for all its lanes.",
}


def note(result: Functions, time: str = "stream_ns") -> str:
    how = (
        "a quick run, one float in thousands: the largest errors are lower bounds"
        if result.quick
        else "floats of one argument exhaustively; others by stratified samples (lower bounds)"
    )
    return (
        f"{result.machine}; median of {result.rounds} interleaved rounds on one thread, arrays in the L1 "
        f"cache. Errors: {how}. Doubles against MPFR. Ranges of arguments: common/functions/targets.c. "
        f"{ABOUT[time]}"
    )


def normalise_note(result: Functions) -> str:
    article = result.article
    largest = max(r.vectors for r in result.normalise)
    ours = [r for r in result.normalise if r.vectors == largest and r.name.endswith("+ 1")]
    named = "; ".join(
        f"{r.isa} {r.speedup.value:.3g}× (loads and stores alone take "
        f"{show.percent(r.share_of_memory)} of its time)"
        for r in ours
    )
    return (
        f"The article: {article.scalar_ms:g} ms against {article.sse_ms:g} ms, {article.speedup}×, for "
        f"{article.vectors:,} equal vectors on a {article.cpu}. Here, {largest:,} random ones, "
        f"scalar AoS over reciprocal root + 1 Newton step: {named}."
    )


def drawings(result: Functions) -> dict[str, Drawing]:
    """Name → figure, of throughput and of latency in each precision."""
    made = {}
    for time, word in (("stream_ns", ""), ("latency_ns", "-latency")):
        for precision in ("float", "double"):
            about = f"{precision.capitalize()}s: {TIMES[time]}, against the largest error"
            draw = partial(figure, result, precision, time)
            made[f"functions-{precision}{word}"] = Drawing(about, note(result, time), draw)
    return made
