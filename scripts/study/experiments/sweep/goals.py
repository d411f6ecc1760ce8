"""The goals of the ladder: speed-ups over baseline, and two threads over one.

They were asked of a CPU with AVX-512 at 1280×720; of one with AVX2 alone (8 lanes), half of each.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from study.core import registry, show
from study.experiments import goal
from study.experiments.original import measure as original
from study.numbers import ladder, verdicts
from study.numbers.analysis import Data

HEIGHT = 720  # of the goals' pictures
WIDE = 16  # lanes from which the whole goal is asked
SPEEDUPS = {  # over a baseline of 15.7 s (scene0) and 16.7 s, as it is on the machine that they were set on
    "opt6_wide": {"scene0": 150.0, "mandelbulb": 27.0},
    "opt7_tiles": {"scene0": 320.0, "mandelbulb": 40.0},
    "opt8_streams": {"scene0": 530.0, "mandelbulb": 80.0},
    "best": {"scene0": 3000.0, "mandelbulb": 130.0},
}
TWO_THREADS = 1.9


def _error(row: goal.Row) -> str:
    """Of a row of the ladder: PSNR to the picture that the phase draws, a fractal's of 4×4 means."""
    found = row.get("truth_own_db")
    if found is None or math.isnan(found):
        return ""
    means = ", 4×4" if show.yes(row.get("truth_converged_only")) else ""
    picture = "the ideal picture" if show.yes(row.get("truth_draws_ideal")) else "ground truth"
    return f"{show.number(found)} dB to {picture}{means}"


def _speed(
    rows: Sequence[goal.Row], rung: str, scene: str, asked: float, unchecked: bool = False
) -> Iterable[goal.Goal]:
    """The rung's speed-up over baseline; of "best" see _best."""
    mine = [r for r in rows if r["scene"] == scene and r["threads"] == 1 and math.isfinite(r["speedup"])]
    mine = [r for r in mine if r["phase"] == rung or (rung == "best" and r["phase"] in registry.ladder())]
    if not mine:
        return
    row = goal.best(mine, "phase", lambda r: goal.interval(r, "speedup"))
    narrow = (row["lanes"] or 0) < WIDE
    least, found = asked / 2 if narrow else asked, goal.interval(row, "speedup")
    beside = "; ".join(text for text in (_error(row), f"{show.number(row['ms'])} ms") if text)
    yield goal.Goal(
        f"{rung} on {scene} over baseline, 1280×720, one thread", asked, found, verdicts.goal(found, least),
        row["phase"] if rung == "best" else "", beside=beside, narrow=narrow,
        unchecked=unchecked,
    )  # fmt: skip


def _two(rows: Sequence[goal.Row], scene: str) -> Iterable[goal.Goal]:
    """Two threads over one: opt5_threads, and the best."""
    mine = [r for r in rows if r["scene"] == scene and r["threads"] == 2]
    mine = [r for r in mine if math.isfinite(r["over_one_thread"])]
    own = [r for r in mine if r["phase"] == "opt5_threads"]
    for name, some in (("opt5_threads", own), ("best", mine)):
        if some:
            row = goal.best(some, "phase", lambda r: goal.interval(r, "ms"), least=True)
            found = goal.interval(row, "over_one_thread")
            verdict = verdicts.goal(found, TWO_THREADS)
            what = row["phase"] if name == "best" else ""
            yield goal.Goal(f"{name} on {scene}, two threads over one", TWO_THREADS, found, verdict, what)


def reached(data: Data) -> Iterable[goal.Goal]:
    table = ladder.rows(data)
    rows = [] if table.empty else [r for r in table.to_dict("records") if r["height"] == HEIGHT]
    unchecked = not original.held_beside(data.path)
    for rung, scenes in SPEEDUPS.items():
        for scene, asked in scenes.items():
            yield from _speed(rows, rung, scene, asked, unchecked)
    for scene in ("scene0", "mandelbulb"):
        yield from _two(rows, scene)
