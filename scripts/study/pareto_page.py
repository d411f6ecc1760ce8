"""The figure and the tables of speed against error, made from pareto.json alone."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import pandas as pd
from matplotlib.figure import Figure

from study import paper, pareto, show
from study.draw import legend, look, panels, plain_log
from study.pareto import Row
from study.show import Column

TOP = 120  # dB: what is nearer is drawn here; floats of a colour near 1 hold no more than 150
PAPER = {"marker": "*", "s": 170, "color": "#d62728", "edgecolor": "black", "zorder": 6}


def paper_point(scene: str, rows: Sequence[Row]) -> tuple[float, float] | None:
    """(ns/pixel, dB) of the paper's opt4: baseline's time here over its program's speed-up, run again.

    Its error is against its own baseline, in display space, as its program gives it.
    """
    base = [r for r in rows if r["phase"] == pareto.BASE and r["own_parameters"]]
    theirs = paper.ladder().set_index(["scene", "phase"])
    if not base or (scene, "opt4") not in theirs.index:
        return None
    row = theirs.loc[(scene, "opt4")]
    return pareto.pace_of(base[0]) / row["rerun"], row["rerun_psnr_display_db"]


def figure(rows: Sequence[Row], metric: str = "psnr_db") -> Figure:
    """A panel per scene: ns per pixel against PSNR to truth; large marks have the scene's own parameters."""
    frame = pd.DataFrame([{"scene": r["scene"], "phase": r["phase"], "threads": 1} for r in rows])
    # A switch looks like its phase, drawn hollow: the shape says which rung it stands on.
    looks = look(frame.assign(phase=frame["phase"].str.partition("+")[0]))
    made, grid = panels(frame, 3.9)
    made.suptitle(
        "Speed against error: left is faster, up is nearer to the truth", x=0.01, ha="left", fontsize=12
    )
    for scene, axes in grid.items():
        mine = [r for r in rows if r["scene"] == scene and pareto.level_of(r, metric) > 0]
        for name in dict.fromkeys(r["phase"] for r in mine):
            style = looks[name.partition("+")[0], 1]
            points = [r for r in mine if r["phase"] == name]
            for big in (False, True):
                chosen = [r for r in points if r["own_parameters"] == big]
                hollow = "+" in name
                axes.scatter(
                    [pareto.pace_of(r) for r in chosen],
                    [min(pareto.level_of(r, metric), TOP) for r in chosen],
                    s=75 if big else 16,
                    marker=style["marker"],
                    facecolor="white" if hollow else style["color"],
                    edgecolor=style["color"] if hollow or not big else "black",
                    linewidth=1.2,
                    alpha=1 if big else 0.65,
                    zorder=4 if big else 3,
                    label=name if big else None,
                )
        for row in mine:  # two switches of a phase have one mark: a word beside each
            if "+" in row["phase"]:
                place = pareto.pace_of(row), min(pareto.level_of(row, metric), TOP)
                word = row["phase"].partition("+")[2]
                axes.annotate(word, place, (6, -9), textcoords="offset points", fontsize=7, zorder=5)
        line = pareto.front(mine, metric)
        axes.plot(
            [pareto.pace_of(r) for r in line],
            [min(pareto.level_of(r, metric), TOP) for r in line],
            color="#555555",
            linewidth=1.2,
            drawstyle="steps-post",
            zorder=2,
            label="front: nothing is faster and nearer",
        )
        if there := paper_point(scene, mine):
            axes.scatter(*there, **PAPER, label="the paper's opt4, to its own baseline")
        axes.set(title=scene, xscale="log", xlabel="ns per pixel", ylabel="PSNR to truth, dB (linear)")
        if any(r["converged_only"] for r in mine):
            axes.set_title(f"{scene} (4×4 averaged)")
        plain_log(axes.xaxis)
    legend(made, grid)
    return made


def note(result: dict[str, Any]) -> str:
    cpu = ((result.get("context") or {}).get("cpu") or {}).get("model") or "unknown CPU"
    return (
        f"{cpu}; n = {result['n']}, median of {result['launches']} interleaved launches, one thread. Small "
        "marks: other hit distances and step caps; large: the scene's own; hollow: an approximated root. "
        "Truth: proved hits, analytic normals, the paper's shadow estimator in exact arithmetic; the "
        "Mandelbulb's, in double-double (104 bits, about 31 digits), is converged only, by the scene's own "
        "hit distance and steps. "
        "The star is the paper's program run again: baseline's time here over its speed-up, its error "
        "against its own baseline in display space."
    )


def _decibels(name: str):
    def text(row: Row) -> str:
        if name not in row:
            return show.NOTHING
        level = pareto.level_of(row, name)
        if row["non_finite"] and not math.isfinite(level):
            return "not finite"
        return "∞" if level == math.inf else show.number(level)

    return text


def _ns(row: Row) -> str:
    pace = row["ns_per_pixel"]
    flat = {"p": pace["value"], "p_low": pace["low"], "p_high": pace["high"]}
    return show.interval({k: math.nan if v is None else v for k, v in flat.items()}, "p")


POINTS = [
    Column("", "scene", lambda r: r["scene"]),
    Column("", "program", lambda r: r["phase"]),
    Column("", "hit distance", lambda r: f"{r['hit_distance']:g}"),
    Column("", "step cap", lambda r: str(r["max_steps"])),
    Column("", "ns/pixel [95 %]", _ns),
    Column("work", "evaluations per ray", lambda r: show.number(r["evals_per_ray"])),
    Column("work", "ns per evaluation", lambda r: show.number(r["ns_per_eval"])),
    Column("error to truth", "false hits, ppm", lambda r: show.number(r.get("false_hits_ppm"))),
    Column("error to truth", "false misses, ppm", lambda r: show.number(r.get("false_misses_ppm"))),
    Column("error to truth", "|Δt| p99", lambda r: show.number(r.get("dt_p99"))),
    Column("error to truth", "PSNR dB, estimator", _decibels("psnr_db")),
    Column("error to truth", "PSNR dB, ideal", _decibels("psnr_ideal_db")),
]
WINNERS = [
    Column("", "scene", lambda r: r["scene"]),
    Column("", "truth", lambda r: r["truth"]),
    Column("", "at least, dB", lambda r: str(r["level_db"])),
    Column("", "fastest", lambda r: r["best"]["phase"] if r["best"] else "none reaches it"),
    Column("", "ns/pixel [95 %]", lambda r: _ns(r["best"]) if r["best"] else show.NOTHING),
    Column(
        "", "not told apart from", lambda r: ", ".join(r.get("not_told_apart_from") or ()) or show.NOTHING
    ),
    Column("", "hit distance", lambda r: f"{r['best']['hit_distance']:g}" if r["best"] else show.NOTHING),
    Column("", "step cap", lambda r: str(r["best"]["max_steps"]) if r["best"] else show.NOTHING),
    Column("", "its PSNR, dB", lambda r: _decibels(r["metric"])(r["best"]) if r["best"] else show.NOTHING),
]
