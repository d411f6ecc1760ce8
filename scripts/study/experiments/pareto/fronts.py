"""Speed against error: fronts, the fastest at each level, and the sentences that they support.

A row is a point of the grid: its errors to ground truth, the same for all points of a scene, and its time.
Ground truth has the scene's own parameters where it marches. Only points that were timed in full stand on a
front or win a level.
"""

import math
from collections.abc import Sequence
from operator import attrgetter

from study.experiments.pareto.schema import TRUTHS, Row, Winner

# What a front is drawn over: name, unit. The first two, of linear colours, are better when larger.
MEASURES = {
    "psnr_db": ("PSNR with the paper's shadow", "dB"),
    "psnr_ideal_db": ("PSNR with the ideal shadow", "dB"),
    "false_ppm": ("false hits and misses", "ppm"),
    "dt_p99": ("|Δt|, 99th percentile", "scene units"),
}
LEVELS = (40, 50, 60, 80)  # dB
WITHIN = 2  # times the time of a nearer point: farther from it none is timed again


def front(rows: Sequence[Row], measure: str) -> list[Row]:
    """Rows that no other is both faster and nearer than, from fast to near; none without a number."""
    best, made = math.inf, []
    able = [row for row in rows if row.timed and not math.isnan(row.badness(measure))]
    for row in sorted(able, key=lambda row: (row.pace, row.badness(measure))):
        if row.badness(measure) < best:
            best = row.badness(measure)
            made.append(row)
    return made


def reaching(rows: Sequence[Row], metric: str, level: float) -> list[Row]:
    """The finite rows of at least `level` dB that were timed in full, the fastest first."""
    able = (row for row in rows if row.timed and -row.badness(metric) >= level)
    return sorted(able, key=attrgetter("pace"))


def rivals(able: Sequence[Row]) -> list[str]:
    """Who else reaches the level in an interval that overlaps the fastest's, or without one; once each. None
    where the fastest itself has no interval: then nothing is told apart."""
    if not able or (mine := able[0].ends) is None:
        return []
    near = [row.phase for row in able[1:] if row.ends is None or row.ends[0] <= mine[1]]
    itself = able[0].phase
    return list(dict.fromkeys(f"{itself} by other parameters" if name == itself else name for name in near))


def winners(rows: Sequence[Row]) -> list[Winner]:
    """The fastest program per scene, truth and level; None where nothing reaches it."""
    made = []
    for scene in dict.fromkeys(row.scene for row in rows):
        mine = [row for row in rows if row.scene == scene]
        for metric, about in TRUTHS.items():
            if all(math.isnan(getattr(row, metric)) for row in mine):
                continue
            for level in LEVELS:
                able = reaching(mine, metric, level)
                won = Winner(scene=scene, truth=about, metric=metric, level_db=level, best=None)
                won.best, won.n, won.not_told_apart_from = next(iter(able), None), mine[0].n, rivals(able)
                made.append(won)
    return made


def answer(winners: Sequence[Winner], level: int = 50) -> str:
    """The fastest of each scene at that level to the paper's shadow; the highest level that any reaches."""
    metric = next(iter(TRUTHS))
    reached = [(w, w.best) for w in winners if w.metric == metric and w.best]
    if not reached:
        return ""
    at = min((w.level_db for w, _ in reached), key=lambda one: (abs(one - level), one))
    said = []
    for one, best in reached:
        if one.level_db == at:
            spread = f" [{best.ends[0]:.3g}, {best.ends[1]:.3g}]" if best.ends else ""
            pace = f"{best.pace:.3g}{spread} ns per pixel"
            said.append(f"on {one.scene} {best.phase} ({pace}, {getattr(best, metric):.1f} dB)")
    size = f" at n = {reached[0][0].n}" if reached[0][0].n else ""
    return (
        f"The fastest at {at:g} dB or more to ground truth with the paper's shadow{size}: {'; '.join(said)}. "
        "PSNR depends on the size of the picture: single pixels at edges decide it."
    )


def left_out(rows: Sequence[Row]) -> str:
    """How many points were launched once only, and by which rule."""
    if not (few := sum(not row.timed for row in rows)):
        return "Every point was timed in full."
    return (
        f"{few} of {len(rows)} points are faint: they were launched once only, clearly beaten, and not "
        f"timed again. Another point of no larger error, by any measure, took less than 1/{WITHIN} of their "
        "time, or their picture was not finite."
    )
