"""The packet ray tracer as figures, from packets.json alone."""

from __future__ import annotations

from matplotlib.figure import Figure

from study.experiments.packets.measure import EMBREE, ENOUGH_DB
from study.experiments.packets.schema import Packets, Rate, Rays
from study.pictures.draw import COLOURS, HATCHES, MARKERS, Drawing, plain_log

FIGURE, EQUAL = "packets-rays", "packets-equal-error"
BARS = {
    "4 lanes": "here, 4 lanes (SSE2)",
    "8 lanes": "here, 8 lanes (AVX2)",
    "kd-tree": "here, kd-tree",
    "own": "here, BVH, {} lanes",
    "embree16": "Embree, packets of 16",
    "embree1": "Embree, single rays",
    "embree_stream": "Embree, 256 rays a call",
}


def variant(row: Rays, name: str) -> Rate | None:
    """One of ours by its name; None where it was not timed."""
    return next((one for one in row.variants if one.name == name), None)


def draw_rays(result: Packets) -> Figure:
    """Million rays a second of ours and Embree's, a panel a scene."""
    names = list(dict.fromkeys(row.scene for row in result.rays))
    figure = Figure(figsize=(11, 4.4), layout="constrained")
    panels = figure.subplots(1, len(names), squeeze=False, sharey=True)[0]
    made = {
        bar: [getattr(row, bar) if bar in EMBREE else variant(row, bar) for row in result.rays]
        for bar in BARS
    }
    bars = [bar for bar in BARS if any(made[bar])]  # without AVX-512 eight lanes are the widest
    widest = next(one.lanes for one in result.rays[0].variants if one.name == "own")
    wide = 1 / (len(bars) + 1)
    for panel, name in zip(panels, names, strict=True):
        rows = [i for i, row in enumerate(result.rays) if row.scene == name]
        for i, bar in enumerate(bars):
            there = [(at, one.mrays) for at, row in enumerate(rows) if (one := made[bar][row])]
            places = [at + (i - (len(bars) - 1) / 2) * wide for at, _ in there]
            style = {"color": COLOURS[(i + 1) % len(COLOURS)], "hatch": HATCHES[i], "edgecolor": "white"}
            label = BARS[bar].format(widest)
            panel.bar(places, [mrays for _, mrays in there], wide, label=label, **style)
        panel.set(yscale="log", title=name)
        panel.set_xticks(range(len(rows)), [result.rays[row].kind for row in rows], fontsize=9)
        plain_log(panel.yaxis)
    panels[0].set_ylabel("million rays a second, one thread")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=4, frameon=False, fontsize=9)
    return figure


def draw_equal(result: Packets) -> Figure:
    """Time on one thread against error to ground truth, a panel a scene."""
    figure = Figure(figsize=(11, 4.2), layout="constrained")
    panels = figure.subplots(1, len(result.drawn), squeeze=False)[0]
    names = list(dict.fromkeys(row.phase for drawn in result.drawn for row in drawn.rows))
    for panel, drawn in zip(panels, result.drawn, strict=True):
        for row in drawn.rows:
            if row.non_finite:  # no PSNR for another reason than 160 dB's
                continue
            i, traced = names.index(row.phase), row.phase == "packets"
            style = {
                "marker": "*" if traced else MARKERS[i % len(MARKERS)],
                "markersize": 14 if traced else 7,
            }
            style["color"] = COLOURS[4] if traced else COLOURS[(0, 1, 2, 3, 5, 6)[i % 6]]
            point = [row.threads[0].ms], [160 if row.psnr_db is None else row.psnr_db]
            panel.plot(*point, linestyle="none", label=row.phase, **style)
        panel.axhline(ENOUGH_DB, color="#888888", linestyle=":", linewidth=1)
        panel.set(xscale="log", title=drawn.scene, xlabel="ms a frame, one thread", ylim=(20, 165))
        panel.margins(x=0.25)
        plain_log(panel.xaxis)
    panels[0].set_ylabel("PSNR to ground truth, dB (dotted: nobody sees more)")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=len(names), frameon=False, fontsize=9)
    return figure


def drawings(result: Packets) -> dict[str, Drawing]:
    found = {
        FIGURE: Drawing(
            "Rays a second: the packet ray tracer by lanes and tree, and Embree (higher is better)",
            "The same rays, one thread; scattered: from the hits in any direction, in no order.",
            lambda: draw_rays(result),
        )
    }
    if result.drawn:
        found[EQUAL] = Drawing(
            "Ray tracing (star) against sphere tracing: time and error (upper left is better)",
            "Each marching phase by the hit distance and step cap with which it is fastest at equal error.",
            lambda: draw_equal(result),
        )
    return found
