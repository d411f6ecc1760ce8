"""The goals beside Dr.Jit."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from study.core import registry, show
from study.experiments import goal
from study.experiments.drjit import measure as drjit_measure
from study.numbers import verdicts
from study.numbers.analysis import Data


def reached(data: Data) -> Iterable[goal.Goal]:
    rows = drjit_measure.read(data.path / drjit_measure.FILE)["rows"]
    alone = [r for r in rows if r["threads"] == 1]
    theirs = {r["scene"]: r for r in alone if r["program"] == drjit_measure.DRJIT}
    asked = [r for r in alone if r["verdict"]]
    for scene in dict.fromkeys(r["scene"] for r in asked):
        mine = [r for r in asked if r["scene"] == scene]
        marching = [r for r in mine if not registry.is_exact(r["program"])]
        for some, which in ((mine, ""), (marching, ", the best that marches")):
            if some:
                row = goal.best(some, "program", lambda r: goal.given(r["ratio"]))
                name = f"{scene} over Dr.Jit, ours by the scene's own limits, one thread{which}"
                error = f"{show.number(row['psnr_db'])} dB to {row['reference']}{_limits(theirs.get(scene))}"
                yield goal.Goal(
                    name, row["goal"], goal.given(row["ratio"]), row["verdict"], row["program"], "×", error
                )
        if scene in theirs:
            yield from _by_its_limits(alone, theirs[scene], mine[0]["goal"])


def _by_its_limits(rows: Sequence[goal.Row], theirs: goal.Row, asked: float) -> Iterable[goal.Goal]:
    """Both by Dr.Jit's hit distance and steps, beside how far that is from the scene's own picture."""
    scene, limits = theirs["scene"], theirs["limits"]
    mine = [r for r in rows if (r["scene"], r["limits"]) == (scene, limits) and r is not theirs]
    if mine and all(r["to_own"] for r in (theirs, *mine)):
        row = goal.best(mine, "program", lambda r: goal.given(r["ratio"]))
        ours, other = (show.number(r["to_own"]["psnr_db"]) for r in (row, theirs))
        yield goal.Goal(
            f"{scene} over Dr.Jit, both by its limits, {limits}, one thread", asked, goal.given(row["ratio"]),
            verdicts.goal(goal.given(row["ratio"]), asked), row["program"], "×",
            f"{ours} dB to {row['reference']} by the scene's own limits, Dr.Jit {other} dB",
        )  # fmt: skip


def _limits(row: goal.Row | None) -> str:
    """Dr.Jit's own limits, and the error that they give it."""
    return f"; Dr.Jit by {row['limits']}: {show.number(row['psnr_db'])} dB" if row else ""
