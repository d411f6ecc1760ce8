"""What the times of further views say of a phase: median and worst gain over its parent, and a verdict."""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from study.experiments.views.schema import Furthest, Gain, Row
from study.numbers import stats
from study.numbers.schema import Interval

BASE = "baseline"  # the reference where truth would take too long
EVERYWHERE, MEDIAN = "wins on every view", "wins in the median"
ALONE = "wins on the tuned views alone"
FEW = "too few launches"
RESAMPLES = 2000
Known = Mapping[tuple[str | None, str, str], Row]  # by phase, scene and view


def median_ratio(pairs: Sequence[tuple[Sequence[float], Sequence[float]]], seed: int = 1) -> stats.Interval:
    """Median over views of median(parent) / median(phase), each view's rounds resampled. NaN of none."""
    if not pairs:
        return stats.Interval(math.nan, math.nan, math.nan, 0, False)
    value = float(np.median([np.median(base) / np.median(own) for base, own in pairs]))
    launches = min(len(some) for pair in pairs for some in pair)
    if launches < stats.ENOUGH:
        return stats.Interval(value, math.nan, math.nan, launches, False)
    random = np.random.default_rng(seed)
    drawn = np.median([stats.resampled_ratios(*pair, random, RESAMPLES) for pair in pairs], axis=0)
    low, high = np.percentile(drawn, [2.5, 97.5])
    return stats.Interval(value, float(low), float(high), launches, True)


def verdict(tuned: Sequence[Row], others: Sequence[Row], median: stats.Interval, slower: int) -> str:
    """Tells, by intervals, what a phase's gain is elsewhere than where it was tuned. `slower`:
    on how many views, those of its general code among them."""
    if not tuned or not others:
        return "tuned views not measured" if others else "other views not measured"
    if not median.sufficient:
        return FEW
    if median.low > 1:
        if all(row.wins for row in (*tuned, *others)):
            return EVERYWHERE
        faster = f"{MEDIAN}: faster on {sum(row.wins for row in others)} of {len(others)}"
        return f"{faster}, slower on {slower}" if slower else f"{faster}, shown slower on none"
    if any(row.wins for row in tuned):
        return ALONE
    return "slower in the median" if median.high < 1 else "no gain"


def over_views(rows: Sequence[Row]) -> list[Gain]:
    """One row a phase: tuned views' ratios, median and worst of the others, errors beside the parent's."""
    known: Known = {(row.phase, row.scene, row.view): row for row in rows}
    made = []
    for phase in dict.fromkeys(row.phase for row in rows if row.ratio):
        mine = [row for row in rows if row.phase == phase and row.ratio]
        tuned, others = [row for row in mine if row.tuned], [row for row in mine if not row.tuned]
        own = [row for row in others if not row.general]
        median = median_ratio([(known[row.parent, row.scene, row.view].ns, row.ns) for row in own])
        bad = [row for row in others if not row.general or row.loses]
        worst = min(bad, key=lambda row: row.ends[0], default=None)
        slower = sum(row.loses for row in others)
        made.append(
            Gain(
                phase=phase,
                parent=mine[0].parent or "",
                views=len(others),
                tuned={row.scene: row.ratio for row in tuned},
                median=Interval.of(median),
                worst=worst.ratio if worst else None,
                worst_scene=worst.scene if worst else None,
                worst_view=worst.view if worst else None,
                slower=slower,
                to_truth=_lowest(mine, known, "truth"),
                to_base=_lowest(mine, known, BASE),
                wrong_ppm=max((row.wrong_ppm for row in mine if row.wrong_ppm is not None), default=None),
                general=len(others) - len(own),
                verdict=verdict(tuned, own, median, slower),
            )
        )
    return made


def _lowest(rows: Sequence[Row], known: Known, reference: str) -> Furthest | None:
    """Where a phase is furthest from the reference, and its parent there; PSNR is null where identical."""
    some = [row for row in rows if row.reference == reference]
    bad = [row for row in some if math.isnan(row.level)]
    low = bad[0] if bad else min(some, key=lambda row: row.level, default=None)
    if low is None:
        return None
    parent = known[low.parent, low.scene, low.view]
    same = parent.reference == reference
    return Furthest(
        scene=low.scene,
        view=low.view,
        no_value=bool(bad),
        psnr_db=low.psnr_db,
        parent_db=parent.psnr_db if same else None,
        parent_is_reference=not same,
    )
