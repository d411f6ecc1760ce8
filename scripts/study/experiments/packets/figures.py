"""The packet ray tracer as figures: from packets.json alone."""

from __future__ import annotations

from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from study.experiments.packets.measure import EMBREE, ENOUGH_DB, Row
from study.experiments.packets.tables import WAYS, variant
from study.pictures.draw import COLOURS, HATCHES, MARKERS, Drawing, plain_log

FIGURE, EQUAL = "packets-rays", "packets-equal-error"


def _timed(row: Row, bar: str) -> Row | None:
    """Of a row of rays: one of Embree's ways, or a variant of ours; None where it was not timed."""
    found: Row | None = row.get(bar) if bar.startswith("embree") else variant(row, bar)
    return found


def draw_rays(result: Row) -> Figure:
    """Million rays a second of ours and Embree's, a panel a scene."""
    names = list(dict.fromkeys(r["scene"] for r in result["rays"]))
    figure = Figure(figsize=(11, 4.4), layout="constrained")
    panels = figure.subplots(1, len(names), squeeze=False, sharey=True)[0]
    every = ("4 lanes", "8 lanes", "kd-tree", "own", *EMBREE)
    # Without AVX-512 eight lanes are the widest, and no row beside it.
    made = {bar: [_timed(r, bar) for r in result["rays"]] for bar in every}
    bars = [bar for bar in every if any(made[bar])]
    widest = "/".join(sorted({str(one["lanes"]) for one in made["own"] if one and one.get("lanes")}, key=int))
    labels = {
        "4 lanes": "here, 4 lanes (SSE2)",
        "8 lanes": "here, 8 lanes (AVX2)",
        "kd-tree": "here, kd-tree",
        "own": f"here, BVH, {widest or 'widest'} lanes",
        **{way: f"Embree, {text}" for way, text in WAYS.items()},
    }
    for panel, name in zip(panels, names, strict=True):
        rows = [r for r in result["rays"] if r["scene"] == name]
        for i, bar in enumerate(bars):
            found = [_timed(r, bar) for r in rows]
            at = [
                place + (i - (len(bars) - 1) / 2) / (len(bars) + 1) for place, one in enumerate(found) if one
            ]
            panel.bar(
                at,
                [one["mrays"] for one in found if one],
                1 / (len(bars) + 1),
                color=COLOURS[(i + 1) % len(COLOURS)],
                hatch=HATCHES[i],
                edgecolor="white",
            )
        panel.set(yscale="log", title=name)
        panel.set_xticks(range(len(rows)), [r["kind"] for r in rows], fontsize=9)
        plain_log(panel.yaxis)
    panels[0].set_ylabel("million rays a second, one thread")
    marks = [
        Patch(
            facecolor=COLOURS[(i + 1) % len(COLOURS)], hatch=HATCHES[i], edgecolor="white", label=labels[bar]
        )
        for i, bar in enumerate(bars)
    ]
    figure.legend(handles=marks, loc="outside upper center", ncols=6, frameon=False, fontsize=9)
    return figure


def draw_equal(result: Row) -> Figure:
    """Time on one thread against error to ground truth, a panel a scene."""
    figure = Figure(figsize=(11, 4.2), layout="constrained")
    panels = figure.subplots(1, len(result["drawn"]), squeeze=False)[0]
    names = list(dict.fromkeys(row["phase"] for d in result["drawn"] for row in d["rows"]))
    looks = {
        name: {
            "marker": "*" if name == "packets" else MARKERS[i % len(MARKERS)],
            "color": COLOURS[4] if name == "packets" else COLOURS[(0, 1, 2, 3, 5, 6)[i % 6]],
            "markersize": 14 if name == "packets" else 7,
            "linestyle": "none",
        }
        for i, name in enumerate(names)
    }
    for panel, drawn in zip(panels, result["drawn"], strict=True):
        for row in drawn["rows"]:
            if row["non_finite"]:  # no PSNR for another reason than 160 dB's
                continue
            shown = 160 if row["psnr_db"] is None else row["psnr_db"]
            ms = row["threads"][0]["ms"]
            panel.plot([ms], [shown], **looks[row["phase"]])
        panel.axhline(ENOUGH_DB, color="#888888", linestyle=":", linewidth=1)
        panel.set(xscale="log", title=drawn["scene"], xlabel="ms a frame, one thread", ylim=(20, 165))
        panel.margins(x=0.25)
        plain_log(panel.xaxis)
    panels[0].set_ylabel("PSNR to ground truth, dB (dotted: nobody sees more)")
    marks = [Line2D([], [], label=name, **looks[name]) for name in names]
    figure.legend(handles=marks, loc="outside upper center", ncols=len(names), frameon=False, fontsize=9)
    return figure


def drawings(result: Row) -> dict[str, Drawing]:
    """What packets.json suffices for."""
    if not result["rays"]:
        return {}
    found = {
        FIGURE: Drawing(
            "Rays a second: the packet ray tracer by lanes and tree, and Embree (higher is better)",
            "The same rays, one thread; scattered: from the hits in any direction, in no order.",
            lambda: draw_rays(result),
        )
    }
    if result["drawn"]:
        found[EQUAL] = Drawing(
            "Ray tracing (star) against sphere tracing: time and error (upper left is better)",
            "Each marching phase by the hit distance and step cap with which it is fastest at equal error.",
            lambda: draw_equal(result),
        )
    return found
