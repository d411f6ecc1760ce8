"""The chapter "Over time": this run's fastest phase in every run of machines of its kind."""

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
from study.pictures import dots
from study.pictures.draw import Drawing

COLUMNS = [Column("", title, lambda row, key=key: str(row[key])) for key, title in history.COLUMNS]
TITLE = "Over time"
NOTE = "Bars: 95 % intervals. Red: steps in time, of the same work on a machine of the same kind."
FOOT = (
    "A step is a change by 5 % or more of the same work on a machine of the same kind, whose 95 % interval "
    "excludes 1. Hosts and hours of such machines differ: × baseline is of one run, and moves less."
)


def _draw(points: Sequence[Point], phase: str) -> Figure:
    """× baseline of one run after another, a panel a scene; steps in red."""
    rows = []
    for one in sorted(points, key=lambda point: point.made):
        if found := one.over_base:
            label = f"{one.made[:10]}, {one.size}" + f", {one.lanes} lanes" * bool(one.lanes)
            colour = dots.LESS if one.step else dots.FINE
            rows.append(dots.Dot(one.scene, label, found.value, found.low, found.high, colour=colour))
    return dots.draw(rows, f"{phase}: times as fast as baseline, run after run", "× baseline")


def _largest(points: Sequence[Point]) -> list[Point]:
    """The largest pictures of each run, on one thread and with baseline beside them."""
    some = [point for point in points if point.threads == 1 and point.over_base]
    largest = {one.run: max(other.height for other in some if other.run == one.run) for one in some}
    return [point for point in some if point.height == largest[point.run]]


def over_time(data: Data, rows: pd.DataFrame) -> Section:
    """The fastest phase of this run that another run has timed, too: of the published runs and of those in
    results/, on machines of this kind. Empty where there is no other run."""
    timed = rows[(rows.threads == 1) & (rows.phase != BASE)] if len(rows) else rows
    own = Run(data.path)
    if not (data.path / "context.json").is_file():  # of a machine that is not known
        return Section("history", TITLE, "make study", [])
    others = [run for run in history.runs(RESULTS) if run.path.resolve() != data.path.resolve()]
    alike = [run for run in [*others, own] if history.machine(run) == history.machine(own)]
    by_speed = timed.sort_values("ns_per_pixel").phase.unique() if len(timed) and len(alike) > 1 else []
    for phase in map(str, by_speed):
        points = _largest(history.points(alike, phase, sorted(set(timed.scene))))
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
