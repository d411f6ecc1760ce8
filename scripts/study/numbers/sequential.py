"""Intervals of a median that may be looked at after every launch: the chance that one of all of them ever
misses the true median is 5 % at most, however it is decided when to stop.

Median of launches: below it a launch lies with probability 1/2, so that the number of launches below is a
walk whose steps are known. The walk is held in the bounds of the beta-binomial mixture martingale, and the
values that the bounds leave open are between two of the launches: S. R. Howard and A. Ramdas, "Sequential
estimation of quantiles with applications to A/B testing and best-arm identification", Bernoulli 28 (2022);
the mixture is H. Robbins's (Annals of Mathematical Statistics 41, 1970). Nothing is assumed of the
distribution. Of two programs the ratio is taken round by round: what slows a round slows both.
"""

import functools
import math

import numpy as np
import pandas as pd
from scipy.special import betaln

from study.numbers import stats
from study.numbers.stats import COVER, Interval

MIX = 2.0  # both parameters of the beta distribution: bounds are narrowest at some 30 launches


@functools.cache
def rank(count: int, cover: float = COVER) -> int:
    """The greatest k for which the k-th least and the k-th greatest of `count` launches hold the true median
    at every look; 0: there is none."""
    k = 0
    enough = -math.log(1 - cover) + betaln(MIX, MIX) - count * math.log(2)
    while 2 * k < count and betaln(k + MIX, count - k + MIX) >= enough:
        k += 1
    return k


def median_interval(values: pd.Series, stopped: bool = True, cover: float = COVER) -> Interval:
    """Median and its interval; NaN ends where the launches are too few for one. Not `stopped`: how many
    launches there are was fixed before, for which a narrower interval holds (stats.median_interval)."""
    if not stopped:
        return stats.median_interval(values, cover)
    found = np.sort(np.asarray(values, float))
    value, k = float(np.median(found)) if len(found) else math.nan, rank(len(found), cover)
    if not k or not np.isfinite(found).all():
        return Interval(value, math.nan, math.nan, len(found), False)
    return Interval(value, float(found[k - 1]), float(found[-k]), len(found), True)


def ratios(base: pd.Series, other: pd.Series) -> pd.Series:
    """base / other of each round that launched both; the index of both is the round."""
    return (base / other).dropna()


def within(found: Interval, precision: float) -> bool:
    """Whether the interval is no wider than ±`precision` of its value."""
    return (
        found.sufficient
        and (1 - precision) * found.value <= found.low <= found.high <= (1 + precision) * found.value
    )
