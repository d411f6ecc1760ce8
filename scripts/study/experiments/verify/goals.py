"""The goals against baseline's pictures."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from study.experiments import goal
from study.numbers.analysis import Data


def reached(data: Data) -> Iterable[goal.Goal]:
    """The Mandelbulb's pictures against baseline's: 4×4 means and depths no further off than opt4's."""
    scene, base = "mandelbulb", "opt4"
    kinds: tuple[tuple[str, str, Callable[[goal.Row], float]], ...] = (
        ("antialiased_psnr_db", "PSNR of 4×4 means to baseline", lambda p: p["antialiased_psnr_db"]),
        ("depth_agree_fraction", "depth other than baseline's, ppm", goal.other_depth),
    )
    for key, name, value in kinds:
        pairs = [p for p in data.pairs if (p["scene"], p["reference"]) == (scene, "baseline")]
        pairs = [p for p in pairs if p.get(key) is not None and p["phase"] in goal.asked_with(base)]
        yield from goal.worst_rung(scene, base, name, {p["phase"]: value(p) for p in pairs})
