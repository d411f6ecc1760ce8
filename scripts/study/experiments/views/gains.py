"""What the times of further views say of a rung: median and worst gain over its parent, and a verdict."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from study.experiments.views.measure import BASE, Row
from study.measuring.views import OWN
from study.numbers import stats
from study.numbers.stats import Interval

NO_KERNEL = "no kernel: its parent's code"
EVERYWHERE, MEDIAN = "wins on every view", "wins in the median"
ALONE, SCENE_ALONE = "wins on the tuned views alone", "wins on its own view alone"
FEW = "too few launches"
RESAMPLES = 2000


def level(row: Row, name: str = "psnr_db") -> float:
    """PSNR in dB: JSON's null is infinite where the RMSE is a number, else NaN."""
    value, rmse = row.get(name), row.get(name.replace("psnr", "rmse").removesuffix("_db"))
    return float(value) if value is not None else math.nan if rmse is None else math.inf


def ends(row: Row) -> tuple[float, float, float]:
    """The ratio to the parent and its interval; NaN for what is not there."""
    found = row["ratio"]
    some = vars(found) if isinstance(found, Interval) else found
    return tuple(math.nan if some[key] is None else some[key] for key in ("value", "low", "high"))


def general(row: Row) -> bool:
    """Whether it ran its general code, its parent's: a ratio beside 1 is noise then, and no gain."""
    return bool(row.get("general"))


def wins(row: Row) -> bool:
    return not general(row) and ends(row)[1] > 1


def loses(row: Row) -> bool:
    return ends(row)[2] < 1


def median_ratio(pairs: Sequence[tuple[Sequence[float], Sequence[float]]], seed: int = 1) -> Interval:
    """Median over views of median(parent) / median(rung), each view's rounds resampled. NaN of none."""
    if not pairs:
        return Interval(math.nan, math.nan, math.nan, 0, False)
    value = float(np.median([np.median(base) / np.median(own) for base, own in pairs]))
    launches = min(len(some) for pair in pairs for some in pair)
    if launches < stats.ENOUGH:
        return Interval(value, math.nan, math.nan, launches, False)
    random = np.random.default_rng(seed)
    drawn = np.median([stats.resampled_ratios(*pair, random, RESAMPLES) for pair in pairs], axis=0)
    return Interval(value, *map(float, np.percentile(drawn, [2.5, 97.5])), launches, True)


def verdict(tuned: Sequence[Row], others: Sequence[Row], median: Interval, slower: int | None = None) -> str:
    """In words, with the intervals asked: what a rung's gain is elsewhere than where it was tuned.

    `slower`: on how many views, those of its general code among them; default: of `others`.
    """
    if not tuned or not others:
        return "tuned views not measured" if others else "other views not measured"
    if not median.sufficient:
        return FEW
    slower = sum(map(loses, others)) if slower is None else slower
    if median.low > 1:
        if all(map(wins, [*tuned, *others])):
            return EVERYWHERE
        faster = f"{MEDIAN}: faster on {sum(map(wins, others))} of {len(others)}"
        return f"{faster}, slower on {slower}" if slower else f"{faster}, shown slower on none"
    if any(map(wins, tuned)):
        return ALONE
    return "slower in the median" if median.high < 1 else "no gain"


def rungs(rows: Sequence[Row]) -> list[Row]:
    """One row a rung: tuned views' ratios, median and worst of the others, errors beside the parent's."""
    times = {(r["phase"], r["scene"], r["view"]): r for r in rows}
    made = []
    for phase in dict.fromkeys(r["phase"] for r in rows if r["parent"]):
        mine = [r for r in rows if r["phase"] == phase and r["ratio"]]
        if not mine:
            continue
        tuned, others = [r for r in mine if r["tuned"]], [r for r in mine if not r["tuned"]]
        own = [r for r in others if not general(r)]
        pairs = [(times[r["parent"], r["scene"], r["view"]]["ns"], r["ns"]) for r in own]
        median = median_ratio(pairs)
        worst = min([r for r in others if not general(r) or loses(r)], key=lambda r: ends(r)[0], default=None)
        made.append(
            {
                **{"phase": phase, "parent": mine[0]["parent"], "views": len(others)},
                "tuned": {r["scene"]: r["ratio"] for r in tuned},
                "median": median,
                **{"worst": worst and worst["ratio"], "worst_scene": worst and worst["scene"]},
                **{"worst_view": worst and worst["view"], "slower": sum(map(loses, others))},
                "to_truth": _lowest(mine, times, "truth"),
                "to_base": _lowest(mine, times, BASE),
                "wrong_ppm": max(
                    (r["wrong_ppm"] for r in mine if r.get("wrong_ppm") is not None), default=None
                ),
                "general": len(others) - len(own),
                "verdict": verdict(tuned, own, median, sum(map(loses, others))),
            }
        )
    return made


def _lowest(rows: Sequence[Row], times: dict[tuple, Row], reference: str) -> Row | None:
    """Where a rung is furthest from the reference: PSNR (null: identical), its parent's there, which view."""
    some = [r for r in rows if r.get("reference") == reference]
    bad = [r for r in some if math.isnan(level(r))]
    low = bad[0] if bad else min(some, key=level, default=None)
    if low is None:
        return None
    parent = times[low["parent"], low["scene"], low["view"]]
    same = parent.get("reference") == reference
    return {
        **{"scene": low["scene"], "view": low["view"], "no_value": bool(bad), "psnr_db": level(low)},
        "parent_db": level(parent) if same else None,
        "parent_is_reference": not same,
    }


def by_scene(rows: Sequence[Row]) -> list[Row]:
    """One row a rung and scene: the ratio of every view, and whether its own view is the only one gained."""
    made = []
    for phase, scene in dict.fromkeys((r["phase"], r["scene"]) for r in rows if r["ratio"]):
        mine = {r["view"]: r for r in rows if (r["phase"], r["scene"]) == (phase, scene) and r["ratio"]}
        others = [row for name, row in mine.items() if name != OWN]
        own = mine.get(OWN)
        alone = own is not None and others and wins(own) and not any(map(wins, others))
        first = next(iter(mine.values()))
        made.append(
            {
                **{"phase": phase, "parent": first["parent"], "scene": scene},
                "views": {name: row["ratio"] for name, row in mine.items()},
                "psnr": {name: None if math.isinf(level(row)) else level(row) for name, row in mine.items()},
                "general": [name for name, row in mine.items() if general(row)],
                "verdict": _scene_verdict(mine, bool(alone)),
            }
        )
    return made


def _scene_verdict(views: dict[str, Row], alone: bool) -> str:
    slower, without = _names(views), [name for name, row in views.items() if general(row)]
    said = [SCENE_ALONE] if alone else [f"slower on {slower}"] if slower else []
    if without:
        said.append(NO_KERNEL + ("" if len(without) == len(views) else f" on {', '.join(without)}"))
    return "; ".join(said)


def _names(views: dict[str, Row]) -> str:
    return ", ".join(name for name, row in views.items() if loses(row))
