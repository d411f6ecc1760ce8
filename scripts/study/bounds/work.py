"""The phases beside one another, a line each: how fast, for how much work, in how full lanes, how near the
roof of their own operations, how far from truth. All of it is in other tables; here it is joined.

Evaluations are those of one solid or Mandelbulb, of all rays of a picture: distances, estimates, and entries
in closed form; a plane's, which is a product of vectors, is counted in none. Lane efficiency: FLOPs of lanes
whose result is used over FLOPs executed, of the whole phase (costs.def times what a counting build ran).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd

from study.core import show
from study.core.show import Column
from study.numbers import ladder

DISTANCES = "sdf_"  # functions: one solid's distance
PLANE = "sdf_plane"
# Where a phase's Mandelbulb has functions of its own, these count its estimates: one that ends, of any ray.
ESTIMATES = ("bulb_end", "bulb_estimate")
ESTIMATED = "sdf_mandelbulb"  # is one of those, or calls it
ENTRIES = "enter"  # a ray's entry into one solid, in closed form
GENERAL = "of its general code"
NOTE = (
    "Evaluations: distances of one solid, estimates of one Mandelbulb and entries in closed form, of all "
    "rays of a picture; a plane's is counted in none.\n"
    "Lane efficiency: FLOPs of lanes whose result is used over FLOPs executed.\n"
    f"“{GENERAL}”: a counting build generates no kernel; the kernel does the same on fewer operations.\n"
    "“counted at n = …”: of a picture of that height, the nearest counted, not of the row's."
)
Row = dict[str, Any]


def evaluations(by_function: Mapping[str, Mapping[str, Any]]) -> float:
    """Of one solid or Mandelbulb, over all rays of a picture; NaN where no function of these is known."""
    lanes = {name: one["lanes"] for name, one in by_function.items()}
    solids = [n for f, n in lanes.items() if f.startswith(DISTANCES) and f not in (PLANE, ESTIMATED)]
    bulbs = next((lanes[name] for name in ESTIMATES if name in lanes), lanes.get(ESTIMATED))
    some = [*solids, *([] if bulbs is None else [bulbs]), *([lanes[ENTRIES]] if ENTRIES in lanes else [])]
    return float(sum(some)) if some else math.nan


def counted(declared: Sequence[Mapping[str, Any]], phase: str, scene: str, height: int) -> Row:
    """Evaluations a pixel and lane efficiency, of the picture counted nearest in height; {} without one."""
    mine = [one for one in declared if (one["phase"], one["scene"]) == (phase, scene)]
    if not mine:
        return {}
    one = min(mine, key=lambda one: abs(math.log(one["height"] / height)))
    executed = one.get("executed") or 0
    return {
        "evals_per_pixel": evaluations(one["by_function"]) / (one["width"] * one["height"]),
        "lane_efficiency": one["useful"] / executed if executed else math.nan,
        "counted_at": one["height"],
        "counts_of": GENERAL if one.get("kernel") else "",
    }


def _height(scaled_from: float | None) -> int | None:
    """Of a picture whose counts the roofline scaled; None where they are the row's own."""
    return None if scaled_from is None or math.isnan(scaled_from) else int(scaled_from)


def rows(
    table: pd.DataFrame, declared: Sequence[Mapping[str, Any]], roofs: pd.DataFrame, names: Sequence[str]
) -> list[Row]:
    """One per scene and rung of `names`, of the ladder's headline on one thread."""
    made = []
    for one in table.to_dict("records") if not table.empty else []:
        if not one["headline"] or one["threads"] != 1 or one["phase"] not in names:
            continue
        near = (
            roofs
            if roofs.empty
            else roofs[
                (roofs["phase"] == one["phase"])
                & (roofs["scene"] == one["scene"])
                & (roofs["height"] == one["height"])
                & (roofs["threads"] == 1)
            ]
        )
        made.append(
            {
                **{key: one[key] for key in ("scene", "width", "height", "phase", "ms")},
                **{key: one[key] for key in ("speedup", "speedup_low", "speedup_high", "ns_per_pixel")},
                **{"truth_own_db": one.get("truth_own_db"), "truth_wrong_ppm": one.get("truth_wrong_ppm")},
                "share_of_mix_roof": math.nan if near.empty else float(near.iloc[0]["share_of_mix_roof"]),
                "roof_counted_at": None if near.empty else _height(near.iloc[0].get("scaled_from_n")),
                **counted(declared, one["phase"], one["scene"], one["height"]),
            }
        )
    return made


def _work(name: str, text: Any, height: str = "counted_at") -> Any:
    """A cell, with what it was counted of where that is another code or (key `height`) another size."""

    def shown(row: Row) -> str:
        value = row.get(name)
        if value is None or math.isnan(value):
            return show.NOTHING
        of = [GENERAL] if row.get("counts_of") else []
        if (row.get(height) or row["height"]) != row["height"]:
            of.append(f"counted at n = {row[height]}")
        return text(value) + (f" ({'; '.join(of)})" if of else "")

    return shown


def _plain(name: str) -> Any:
    def shown(row: Row) -> str:
        value = row.get(name)
        return show.NOTHING if value is None or math.isnan(value) else show.number(value)

    return shown


COLUMNS = [
    Column("", "scene", lambda r: f"{r['scene']}, {r['width']}×{r['height']}"),
    Column("", "phase", lambda r: r["phase"]),
    Column(
        "",
        "× baseline [95 %]",
        lambda r: "base" if r["phase"] == ladder.BASE else show.interval(r, "speedup", 3, "×"),
    ),
    Column("", "ns/pixel", _plain("ns_per_pixel")),
    Column("", "evaluations/pixel", _work("evals_per_pixel", show.number)),
    Column("", "lane efficiency", _work("lane_efficiency", lambda v: f"{100 * v:.1f} %")),
    Column(
        "",
        "share of the roof of its own operations",
        _work("share_of_mix_roof", lambda v: f"{100 * v:.1f} %", "roof_counted_at"),
    ),
    Column("to ground truth", "PSNR, dB", _plain("truth_own_db")),
    Column("to ground truth", "wrong hits, ppm", _plain("truth_wrong_ppm")),
]
