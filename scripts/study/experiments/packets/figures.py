"""Ray tracing against sphere tracing as a figure, from packets.json alone."""

from __future__ import annotations

from matplotlib.figure import Figure

from study.experiments.packets.measure import ENOUGH_DB
from study.experiments.packets.schema import Packets
from study.pictures.draw import COLOURS, MARKERS, Drawing, plain_log


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
    title = "Ray tracing (star) against sphere tracing: time and error (upper left is better)"
    note = "Each marching phase by the hit distance and step cap with which it is fastest at equal error."
    drawn = Drawing(title, note, lambda: draw_equal(result))
    return {"packets-equal-error": drawn} if result.drawn else {}
