"""The chapter "Over time": this run's fastest phase in every run of machines of its kind."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import pandas as pd
from matplotlib.figure import Figure

from study.core.registry import BASE
from study.core.show import Column
from study.core.store import RESULTS, Run
from study.experiments.section import Section, part
from study.numbers import history
from study.numbers.analysis import Data
from study.numbers.history import Point
from study.pictures.draw import BAD, Drawing

COLUMNS = [Column("", title, lambda row, key=key: str(row[key])) for key, title in history.COLUMNS]
TITLE = "Over time"
NOTE = "Bars: 95 % intervals. Red rings: steps in time, of the same work on a machine of the same kind."
FOOT = (
    "A step is a change by 5 % or more of the same work on a machine of the same kind, whose 95 % interval "
    "excludes 1. Hosts and hours of such machines differ: × baseline is of one run, and moves less."
)


def _draw(points: Sequence[Point], phase: str) -> Figure:
    """× baseline of one run after another, a panel a scene; steps in red."""
    scenes = list(dict.fromkeys(point.scene for point in points))
    figure = Figure(figsize=(9, 2.6 * len(scenes) + 0.6), layout="constrained")
    figure.suptitle(f"{phase}: times as fast as baseline, run after run", x=0.01, ha="left", fontsize=12)
    for axes, scene in zip(figure.subplots(len(scenes), squeeze=False)[:, 0], scenes, strict=True):
        of_scene = [point for point in points if point.scene == scene]
        days = sorted({point.made for point in of_scene})
        for work in dict.fromkeys((point.size, point.lanes) for point in of_scene):
            some = [point for point in of_scene if (point.size, point.lanes) == work]
            label = work[0] + f", {work[1]} lanes" * bool(work[1])
            at = [days.index(point.made) for point in some]
            middle = [point.over_base.value for point in some if point.over_base]
            bars = [[], []]
            for point in some:
                if point.over_base:
                    bars[0].append(point.over_base.value - point.over_base.low)
                    bars[1].append(point.over_base.high - point.over_base.value)
            axes.errorbar(at, middle, yerr=bars, capsize=3, marker="o", label=label)
            for place, point in zip(at, some, strict=True):
                if point.step and point.over_base:
                    ring = {"mfc": "none", "mec": BAD, "markersize": 14, "mew": 2}
                    axes.plot(place, point.over_base.value, "o", **ring)
        axes.set_title(scene, fontsize=10)
        axes.set_xticks(range(len(days)), [day[:10] for day in days], fontsize=8)
        axes.set_ylabel("× baseline")
        axes.margins(y=0.2)
        axes.legend(frameon=False, fontsize=8, loc="center left", bbox_to_anchor=(1, 0.5))
    return figure


def _largest(points: Sequence[Point]) -> list[Point]:
    """Of each run its largest pictures, on one thread and with baseline beside them."""
    some = [point for point in points if point.threads == 1 and point.over_base]
    largest = {one.run: max(other.height for other in some if other.run == one.run) for one in some}
    return [point for point in some if point.height == largest[point.run]]


def over_time(data: Data, rows: pd.DataFrame) -> Section:
    """The fastest phase of this run that another run has timed, too: of the published runs and of those in
    results/, on machines of this kind. Empty where there is no other run."""
    timed = rows[(rows["threads"] == 1) & (rows["phase"] != BASE)] if len(rows) else rows
    own = Run(data.path)
    if not (data.path / "context.json").is_file():  # of a machine that is not known
        return Section("history", TITLE, "make study", [])
    others = [run for run in history.runs(RESULTS) if run.path.resolve() != data.path.resolve()]
    alike = [run for run in [*others, own] if history.machine(run) == history.machine(own)]
    by_speed = timed.sort_values("ns_per_pixel")["phase"].unique() if len(timed) and len(alike) > 1 else []
    for phase in map(str, by_speed):
        points = _largest(history.points(alike, phase, sorted(set(timed["scene"]))))
        runs = len({point.run for point in points})
        if runs < 2:
            continue
        steps = sum(point.step for point in points)
        many = "no step" if not steps else f"{steps} step{'s' * (steps > 1)}"
        answer = f"{phase} was timed in {runs} runs on machines of this kind; {many} of 5 % or more."
        parts = part("history", f"{phase} in each run", history.shown(points), COLUMNS, FOOT)
        drawn = {"history": Drawing("The fastest phase over time", NOTE, partial(_draw, points, phase))}
        made = {"answer": answer, "script": "scripts/stepwise report", "drawn": drawn}
        return Section("history", TITLE, "make study", parts, **made)
    return Section("history", TITLE, "make study", [])
