"""The goals against ground truth."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from study.experiments import goal
from study.numbers import accuracy
from study.numbers.analysis import Data


def reached(data: Data) -> Iterable[goal.Goal]:
    """Against truth, of the worst rung: scene0's colours and hits no further off than baseline's, the
    Mandelbulb's 4×4 means and depths no further than opt4's.
    """
    every = accuracy.read(data.path)["rows"]
    kinds: tuple[tuple[str, str, str, Callable[[goal.Row], float]], ...] = (
        ("scene0", "baseline", "PSNR to truth", lambda r: r["psnr_db"]),
        ("scene0", "baseline", "PSNR to truth with ideal shadows", lambda r: r["psnr_ideal_db"]),
        ("scene0", "baseline", "wrong hits, ppm", _wrong),
        ("mandelbulb", "opt4", "PSNR of 4×4 means to truth", lambda r: r["antialiased"]["psnr_db"]),
        ("mandelbulb", "opt4", "depth other than truth's, ppm", goal.other_depth),
    )
    for scene, base, name, value in kinds:
        rows = [r for r in every if r["scene"] == scene and r["phase"] in goal.asked_with(base)]
        yield from goal.worst_rung(scene, base, name, {r["phase"]: value(r) for r in rows})


def _wrong(row: goal.Row) -> float:
    return sum(row[name] for name in ("false_hits_ppm", "false_misses_ppm", "wrong_shape_ppm"))
