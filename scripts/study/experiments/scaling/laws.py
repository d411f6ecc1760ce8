"""What is read from the rows of scaling.json: fits beside the law of the paper, many shapes beside few."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from study.experiments.scaling.schema import Crowd, Fit, Row
from study.experiments.scaling.series import Series
from study.numbers import power_laws, stats
from study.numbers.power_laws import Law
from study.numbers.schema import Interval

FEW, MANY = 16, 4096  # shapes
CROWD, SCATTERED = "crowd", "shapes-scattered"  # the series that have them
NEAR = 0.05  # exponents that close are the same


def law(points: Sequence[tuple[float, Sequence[float]]], exact: bool = False) -> Law:
    xs, samples = zip(*points, strict=True)
    return power_laws.fit(xs, samples, exact=exact)


def fits(rows: Sequence[Row], known: Iterable[Series]) -> list[Fit]:
    """Per series and program with at least two points: the laws of time and of evaluations."""
    made = []
    for series in known:
        if not series.kept:
            continue  # two points: their ratio is in a table of its own
        mine = [row for row in rows if row.series == series.name]
        for phase in dict.fromkeys(row.phase for row in mine):
            points = [row for row in mine if row.phase == phase]
            counted = [(row.x, [row.evals_per_ray]) for row in points if row.evals_per_ray]
            if len(points) < 2:
                continue
            time = law([(row.x, row.ns) for row in points])
            made.append(
                Fit(
                    series=series.name,
                    title=series.title,
                    phase=phase,
                    paper=series.paper,
                    time=time,
                    evals=law(counted, exact=True) if len(counted) > 1 else None,
                    verdict=verdict(time, series.paper),
                )
            )
    return made


def verdict(found: Law, paper: float | None) -> str:
    """What the measured law is beside the paper's exponent, an upper bound."""
    value, low, high = found.exponent.value or 0, found.exponent.low, found.exponent.high
    if found.holds is None:
        return "two points: any law goes through them"
    if not found.holds:
        return "no power law: off at " + ", ".join(f"{x:,g}" for x in found.off)
    if paper is None:
        return "a power law"
    if low is None or high is None:
        return "too few launches"
    if abs(value - paper) <= NEAR or low <= paper <= high:
        return "as the paper's law"
    return "grows slower than the paper's bound" if value < paper else "grows faster than the paper's law"


def crowds(rows: Sequence[Row], phases: Sequence[str]) -> list[Crowd]:
    """4,096 scattered shapes against 16 at equal coverage, per program."""
    made = []
    for phase in phases:
        own = [row for row in rows if row.phase == phase]
        mine = {row.x: row for row in own if row.series == CROWD}
        if not {FEW, MANY} <= mine.keys():
            mine = {row.x: row for row in own if row.series == SCATTERED}
        most = max(mine, default=0)
        few, many = mine.get(FEW), mine.get(most if most > FEW else MANY)
        if few is None or many is None:
            continue
        crowd = Crowd(phase=phase, n=many.n, shapes=int(most), ratio=over(many, few))
        crowd.scenes = [one.scenes or 1 for one in (few, many)]
        crowd.coverage = [covered(own, x) for x in (FEW, most)]
        if few.scenes and many.scenes:
            crowd.mean_ms = [float(np.mean(one.ns)) * 1e-6 for one in (few, many)]
            crowd.by_medians = Interval.of(stats.ratio_interval(many.ns, few.ns, rounds=False))
        made.append(crowd)
    return made


def over(many: Row, few: Row) -> Interval:
    """Time over time: of one scene each by their medians, since what disturbs a launch is no part of it; of a
    scene for every launch by their means, since what a scene costs is."""
    ratio = stats.mean_ratio_interval if many.scenes and few.scenes else stats.ratio_interval
    return Interval.of(ratio(many.ns, few.ns))


def covered(rows: Sequence[Row], shapes: float) -> float | None:
    """Share of pixels hit of that many scattered shapes, from whichever picture was kept."""
    some = (row.coverage for row in rows if row.scene.startswith(f"scattered-{shapes:.0f}-"))
    return next((share for share in some if share is not None), None)
