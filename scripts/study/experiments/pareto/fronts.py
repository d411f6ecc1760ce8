"""Speed against error: fronts, the fastest at each level, and the sentences that they support.

A row is a point of the grid (experiments.pareto.measure): its errors to ground truth (truth.truth), the
same for all points of a scene, and its time. Proved hits know nothing of hit distance and step cap; the
shadow estimator and the Mandelbulb, which ground truth marches, have the scene's own. The parameters are
changed for this study alone, and every point names its own. Only points that were timed in full stand on a
front or win a level.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from study.core import cli
from study.core.registry import BASE as BASE
from study.experiments.pareto.schema import Pareto

FILE = "pareto.json"
TRUTHS = {"psnr_db": "the paper's shadow", "psnr_ideal_db": "the ideal shadow"}
# What a front is drawn over: name, unit. The first two, of linear colours, are better when larger.
MEASURES = {
    "psnr_db": ("PSNR with the paper's shadow", "dB"),
    "psnr_ideal_db": ("PSNR with the ideal shadow", "dB"),
    "false_ppm": ("false hits and misses", "ppm"),
    "dt_p99": ("|Δt|, 99th percentile", "scene units"),
}
LEVELS = (40, 50, 60, 80)  # dB
FACTOR = 4  # of the averaged pictures of fractals, each way
WITHIN = 2  # times the time of a nearer point: farther from it none is timed again
Row = dict[str, Any]


def pace_of(row: Row) -> float:
    pace = row["ns_per_pixel"]
    return pace["value"] if isinstance(pace, dict) else pace.value


def level_of(row: Row, metric: str) -> float:
    """PSNR as a number: JSON's null is infinite; NaN, which reaches no level, where there is none.

    A picture that is not finite has none: its null was NaN.
    """
    value = row.get(metric, math.nan)
    if value is not None:
        return value
    return math.nan if row["non_finite"] else math.inf


def badness(row: Row, measure: str) -> float:
    """An error that is better when smaller, whatever the measure; NaN where there is none."""
    if row["non_finite"]:
        return math.nan
    if measure in TRUTHS:
        return -level_of(row, measure)
    value = row.get(measure)
    return math.nan if value is None else value


def timed(row: Row) -> bool:
    """Whether it was in the running after the first launch (files of before that rule: every row)."""
    return row.get("beaten_by") is None


def front(rows: Sequence[Row], measure: str) -> list[Row]:
    """Rows that no other is both faster and nearer than, from fast to near; none without a number."""
    best, made = math.inf, []
    able = [row for row in rows if timed(row) and not math.isnan(badness(row, measure))]
    for row in sorted(able, key=lambda row: (pace_of(row), badness(row, measure))):
        if badness(row, measure) < best:
            best = badness(row, measure)
            made.append(row)
    return made


def reaching(rows: Sequence[Row], metric: str, level: float) -> list[Row]:
    """The finite rows of at least `level` dB that were timed in full."""
    return [row for row in rows if timed(row) and -badness(row, metric) >= level]


def fastest(rows: Sequence[Row], metric: str, level: float) -> Row | None:
    """The fastest row of at least `level` dB."""
    return min(reaching(rows, metric, level), key=pace_of, default=None)


def ends_of(row: Row) -> tuple[float, float] | None:
    """95 % interval of the pace, ns/pixel; None of too few launches."""
    pace = row["ns_per_pixel"]
    low, high = (pace[end] if isinstance(pace, dict) else getattr(pace, end) for end in ("low", "high"))
    known = low is not None and high is not None and math.isfinite(low) and math.isfinite(high)
    return (low, high) if known else None


def rivals(rows: Sequence[Row], metric: str, level: float) -> list[str]:
    """Who else reaches the level in an interval that overlaps the fastest's, or without one; once each.

    None where the fastest itself has no interval: then nothing is told apart.
    """
    best = fastest(rows, metric, level)
    if best is None or (mine := ends_of(best)) is None:
        return []
    near = [
        row
        for row in reaching(rows, metric, level)
        if row is not best and ((other := ends_of(row)) is None or other[0] <= mine[1])
    ]
    itself = f"{best['phase']} by other parameters"
    return list(dict.fromkeys(itself if row["phase"] == best["phase"] else row["phase"] for row in near))


def winners(rows: Sequence[Row]) -> list[Row]:
    """The fastest program per scene, truth and level; None where nothing reaches it."""
    made = []
    for scene in dict.fromkeys(row["scene"] for row in rows):
        mine = [row for row in rows if row["scene"] == scene]
        for metric, about in TRUTHS.items():
            if not any(metric in row for row in mine):
                continue
            for level in LEVELS:
                best = fastest(mine, metric, level)
                about_it = {"scene": scene, "truth": about, "metric": metric, "level_db": level, "best": best}
                about_it["n"] = mine[0].get("n")
                made.append(about_it | {"not_told_apart_from": rivals(mine, metric, level)})
    return made


def sentence(winner: Row) -> str:
    """What a winner says: at 60 dB, opt4 is the fastest …"""
    best, where = winner["best"], f"{winner['scene']}, {winner['level_db']} dB to {winner['truth']}"
    where += f" at n = {winner['n']}" if winner.get("n") else ""
    if best is None:
        return f"{where}: no program reaches it"
    found = ends_of(best)
    ends = f" [{found[0]:.3g}, {found[1]:.3g}]" if found else ""
    doubt = "" if found else "; insufficient launches to tell it from others"
    if near := winner.get("not_told_apart_from"):
        doubt += f"; not told apart from {', '.join(near)}"
    how = (
        "the scene's own parameters"
        if best["own_parameters"]
        else (f"hit distance {best['hit_distance']:g}, {best['max_steps']} steps")
    )
    return (
        f"{where}: {best['phase']} is the fastest, {pace_of(best):.3g}{ends} ns/pixel ({how}; "
        f"{level_of(best, winner['metric']):.1f} dB){doubt}"
    )


def _either(winner: Row, order: Sequence[str]) -> str:
    """The fastest, and the other programs that were not told apart from it, in the ladder's order."""
    near = {winner["best"]["phase"], *winner["not_told_apart_from"]} & set(order)
    return " or ".join(name for name in order if name in near)


def summary(winners: Sequence[Row], rows: Sequence[Row]) -> list[str]:
    """One sentence per truth and level for all scenes: at 60 dB, the fastest is …"""
    order = list(dict.fromkeys(row["phase"] for row in rows))
    sizes = {row.get("n") for row in rows} - {None}
    size = f" at n = {', '.join(map(str, sorted(sizes)))}" if sizes else ""
    made = []
    for metric, about in TRUTHS.items():
        for level in LEVELS:
            mine = [w for w in winners if w["metric"] == metric and w["level_db"] == level]
            groups: dict[str, list[str]] = {}
            for winner in mine:
                if winner["best"]:
                    pace = f"{winner['scene']} ({pace_of(winner['best']):,.0f} ns/pixel)"
                    groups.setdefault(_either(winner, order), []).append(pace)
            parts = [f"{names} on {', '.join(scenes)}" for names, scenes in groups.items()]
            lacking = ", ".join(w["scene"] for w in mine if not w["best"])
            if lacking and parts:
                parts.append(f"nothing reaches it on {lacking}")
            if parts:
                made.append(f"At {level} dB to {about}{size} the fastest is: {'; '.join(parts)}.")
            elif lacking:
                made.append(f"Nothing reaches {level} dB to {about}{size} on {lacking}.")
    return made


def answer(winners: Sequence[Row], level: int = 50) -> str:
    """The fastest of each scene at that level to the paper's shadow; the highest level that any reaches."""
    metric = next(iter(TRUTHS))
    reached = [w for w in winners if w["metric"] == metric and w["best"]]
    if not reached:
        return ""
    at = min((w["level_db"] for w in reached), key=lambda one: (abs(one - level), one))
    said = []
    for one in (w for w in reached if w["level_db"] == at):
        ends = ends_of(one["best"])
        spread = f" [{ends[0]:.3g}, {ends[1]:.3g}]" if ends else ""
        said.append(
            f"on {one['scene']} {one['best']['phase']} ({pace_of(one['best']):.3g}{spread} ns per pixel, "
            f"{level_of(one['best'], metric):.1f} dB)"
        )
    size = f" at n = {reached[0]['n']}" if reached[0].get("n") else ""
    return (
        f"The fastest at {at} dB or more to ground truth with the paper's shadow{size}: {'; '.join(said)}. "
        "PSNR depends on the size of the picture: single pixels at edges decide it."
    )


def left_out(rows: Sequence[Row]) -> str:
    """How many points were launched once only, and by which rule."""
    few = sum(not timed(row) for row in rows)
    if not few:
        return "Every point was timed in full."
    return (
        f"{few} of {len(rows)} points are faint: they were launched once only, clearly beaten, and not "
        f"timed again. Another point of no larger error, by any measure, took less than 1/{WITHIN} of their "
        "time, or their picture was not finite."
    )


def read(path: Path) -> dict[str, Any]:
    """A run's pareto.json; without that file no row. Raises StudyError for another thing's JSON."""
    if not path.exists():
        return {"rows": [], "skipped": []}
    return Pareto.read(path)


def shown(rows: Sequence[Row]) -> list[Row]:
    """Winners as people read them."""
    return [
        {**row, "program": row["best"]["phase"] if row["best"] else "none", "sentence": sentence(row)}
        for row in rows
    ]


def say_missing(skipped: Iterable[Row]) -> None:
    for item in {(s["phase"], s["scene"], s["reason"]): s for s in skipped}.values():
        cli.say(f"skipped {item['phase']} on {item['scene']}: {item['reason']}")
