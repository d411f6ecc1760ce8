"""The throttle's choices as a table, from throttle.json alone."""

from __future__ import annotations

from pathlib import Path

from study.core import show
from study.core.show import Column
from study.experiments.flight.schema import THROTTLE, Large, Setting, Throttle
from study.experiments.section import Part, System, part
from study.measuring.hit_tables import gain, ms, to_truth, verdict, within


def words_of(row: Setting | None) -> str:
    """A setting for people."""
    if row is None:
        return "none is within the error"
    one = dict(word.split("=") for word in row.settings.split())
    steps, finish = (
        f"at most {one[key]} steps" if one[key] != "0" else "the scene's cap of steps"
        for key in ("steps", "finish")
    )
    return f"rods of {one['size']} to {one['least']} pixels by {steps}, each pixel finished by {finish}"


def apart(row: Large) -> str:
    """Two pictures of one scene."""
    psnr = "identical" if row.psnr_db is None else f"{show.number(row.psnr_db)} dB"
    return f"{'not finite' if row.non_finite else psnr}, {row.other_ppm:,.0f} ppm other hits"


TIME, EVALUATIONS, LARGER = "ms a frame [95 %]", "evaluations a pixel", "larger"
COLUMNS = [
    Column("", "scene", show.picture),
    Column("", "error allowed", lambda r: f"≥ {r.psnr_db:.4g} dB, ≤ {r.wrong_ppm:.4g} ppm"),
    Column("", "within it", lambda r: f"{r.within} of {r.tried - 1}"),
    Column("", "the throttle's choice", lambda r: words_of(r.chosen)),
    *within("chosen", [Column(TIME, "rods first", ms)]),
    *within("plain", [Column(TIME, "packets alone", ms)]),
    Column("", "gain [95 %]", gain),
    Column("", "verdict", verdict),
    *within(
        "large",
        [
            Column(LARGER, "size", lambda r: f"{r.width}×{r.n}"),
            Column(LARGER, "gain [95 %]", gain),
            Column(LARGER, "verdict", verdict),
            Column(LARGER, "against packets alone", apart),
        ],
    ),
    *within("chosen", [Column(EVALUATIONS, "rods first", show.plain("evaluations"))]),
    *within("plain", [Column(EVALUATIONS, "packets alone", show.plain("evaluations"))]),
    *within("chosen", to_truth("psnr", "wrong hits", group="rods first, to ground truth")),
    *within("plain", to_truth("psnr", "wrong hits", group="packets alone, to ground truth")),
]
FOOT = (
    "A choice is the fastest of several finalists, whose times thereby say too much: gains are of launches "
    "after it was made."
)


def parts(result: Throttle) -> list[Part]:
    caption = "Rods, then packets: the throttle's choice of each scene"
    return part("throttle", caption, result.rows, COLUMNS, FOOT)


def system(run: Path) -> System | None:
    """What a run has of it. The article proposes it and has no figure of it."""
    result = Throttle.load_if_there(run / THROTTLE)
    return System([], parts(result)) if result else None
