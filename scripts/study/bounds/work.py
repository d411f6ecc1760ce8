"""The phases beside one another, a line each: how fast, for how much work, in how full lanes, how near the
roof of their own operations, how far from truth. All of it is in other tables; here it is joined.

Evaluations are those of one solid or Mandelbulb, of all rays of a picture: distances, estimates, and entries
in closed form; a plane's, which is a product of vectors, is counted in none. Lane efficiency: FLOPs of lanes
whose result is used over FLOPs executed, of the whole phase (costs.def times what a counting build ran); of a
phase that declares none, active lanes over all lanes of the calls that it counts.
"""

import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass

import pandas as pd

from study.bounds.roof import Point
from study.core import show
from study.core.show import Column, picture, plain, word
from study.counting.schema import Declared, Function
from study.numbers import ladder

DISTANCES = "sdf_"  # functions: one solid's distance
PLANE = "sdf_plane"
# Where a phase's Mandelbulb has functions of its own, these count its estimates: one that ends, of any ray.
ESTIMATES = ("bulb_end", "bulb_estimate")
ESTIMATED = "sdf_mandelbulb"  # is one of those, or calls it
ENTRIES = "enter"  # a ray's entry into one solid, in closed form
# Calls that phases without declared FLOPs have beside estimates and entries: a distance to one shape each.
STEPS = ("packet_distance", "group_shape", "solid_step", "candidate_awake", "candidate_active", "widest_step")
TIMED = ("scene", "width", "height", "phase", "ms", "speedup", "speedup_low", "speedup_high", "ns_per_pixel")
GENERAL = "of its general code"
NOTE = (
    "Evaluations: distances of one solid, estimates of one Mandelbulb and entries in closed form, of all "
    "rays of a picture; a plane's is counted in none.\n"
    "Lane efficiency: FLOPs of lanes whose result is used over FLOPs executed.\n"
    f"“{GENERAL}”: a counting build generates no kernel; the kernel does the same on fewer operations.\n"
    "“counted at n = …”: of a picture of that height, the nearest counted, not of the row's."
)


@dataclass(frozen=True, kw_only=True)
class Work:
    """Work of the picture counted nearest in height (`counted_at`); `counts_of`: another code's name."""

    evals_per_pixel: float = math.nan
    lane_efficiency: float = math.nan
    counted_at: int | None = None
    counts_of: str = ""


@dataclass(frozen=True, kw_only=True)
class Row(Work):
    scene: str
    width: int
    height: int
    phase: str
    ms: float
    speedup: float
    speedup_low: float
    speedup_high: float
    ns_per_pixel: float
    truth_own_db: float | None
    truth_wrong_ppm: float | None
    share_of_mix_roof: float
    roof_counted_at: int | None


def evaluations(by_function: Mapping[str, Function]) -> float:
    """Evaluations of one solid or Mandelbulb, over all rays of a picture; NaN where none is counted."""
    lanes = {name: one.lanes for name, one in by_function.items()}
    solids = [n for f, n in lanes.items() if f.startswith(DISTANCES) and f not in (PLANE, ESTIMATED)]
    bulbs = next((lanes[name] for name in ESTIMATES if name in lanes), lanes.get(ESTIMATED))
    if not solids and bulbs is not None:
        solids = [lanes[name] for name in STEPS if name in lanes]
    return float(sum([*solids, bulbs or 0, lanes.get(ENTRIES, 0)])) or math.nan


def efficiency(one: Declared) -> float:
    """Useful share of the FLOPs; of a phase that declares none, of its calls' lanes. NaN for neither."""
    if one.executed:
        return one.useful / one.executed
    calls = sum(function.calls for function in one.by_function.values()) * one.lanes
    return sum(function.lanes for function in one.by_function.values()) / calls if calls else math.nan


def counted(declared: Iterable[Declared], phase: str, scene: str, height: int) -> Work | None:
    mine = [one for one in declared if (one.phase, one.scene) == (phase, scene)]
    if not mine:
        return None
    one = min(mine, key=lambda one: abs(math.log(one.height / height)))
    return Work(
        evals_per_pixel=evaluations(one.by_function) / (one.width * one.height),
        lane_efficiency=efficiency(one),
        counted_at=one.height,
        counts_of=GENERAL if one.kernel else "",
    )


def rows(
    table: pd.DataFrame, declared: Sequence[Declared], points: Iterable[Point], names: Collection[str]
) -> list[Row]:
    """One per scene and phase of `names`, of the ladder's headline on one thread."""
    roofs = {(one.phase, one.scene, one.height): one for one in points}
    made = []
    for one in table.itertuples():
        if not one.headline or one.threads != 1 or one.phase not in names:
            continue
        near = roofs.get((one.phase, one.scene, one.height))
        work = counted(declared, one.phase, one.scene, one.height) or Work()
        made.append(
            Row(
                **vars(work),
                **{name: getattr(one, name) for name in TIMED},
                truth_own_db=getattr(one, "truth_own_db", None),
                truth_wrong_ppm=getattr(one, "truth_wrong_ppm", None),
                share_of_mix_roof=near.share_of_mix_roof if near else math.nan,
                roof_counted_at=near.scaled_from_n if near else None,
            )
        )
    return made


def _work(name: str, text: Callable[[float], str], height: str = "counted_at") -> Callable[[Row], str]:
    """A cell, with what it was counted of where that is another code or (key `height`) another size."""

    def shown(row: Row) -> str:
        value, at = getattr(row, name), getattr(row, height)
        if math.isnan(value):
            return show.NOTHING
        of = [row.counts_of] if row.counts_of else []
        if at and at != row.height:
            of.append(f"counted at n = {at}")
        return text(value) + (f" ({'; '.join(of)})" if of else "")

    return shown


def _percent(value: float) -> str:
    return f"{100 * value:.1f} %"


COLUMNS = [
    Column("", "scene", picture),
    Column("", "phase", word("phase")),
    Column(
        "",
        "× baseline [95 %]",
        lambda row: "base" if row.phase == ladder.BASE else show.interval(row, "speedup", 3, "×"),
    ),
    Column("", "ns/pixel", plain("ns_per_pixel")),
    Column("", "evaluations/pixel", _work("evals_per_pixel", show.number)),
    Column("", "lane efficiency", _work("lane_efficiency", _percent)),
    Column(
        "", "share of the roof of its own operations", _work("share_of_mix_roof", _percent, "roof_counted_at")
    ),
    Column("to ground truth", "PSNR, dB", plain("truth_own_db")),
    Column("to ground truth", "wrong hits, ppm", plain("truth_wrong_ppm")),
]
