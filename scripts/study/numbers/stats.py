"""Medians, ratios of medians and of means, with 95 % intervals. The sample is the process launch.

Median: order statistics, W. J. Conover, Practical Nonparametric Statistics, 3rd ed. (1999), section 3.2.
Ratio: percentile bootstrap of pairs, Efron & Tibshirani, An Introduction to the Bootstrap (1993), ch. 9, 13.
Of three to five launches: Student's t of the logarithms, B. L. Welch's for a ratio (Biometrika 34, 1947).
"""

import functools
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from scipy.special import bdtr, stdtrit

COVER = 0.95  # of every interval
PERCENTILES = [50 * (1 - COVER), 50 * (1 + COVER)]
RESAMPLES = 10_000
ENOUGH = 6  # launches: of five the least and the greatest hold the true median in 93.75 % of cases only
FEWEST = 3  # from here on Student's t has an interval: three launches of a minute cost more than it gives up


@dataclass(frozen=True)
class Interval:
    """A figure and its 95 % interval, in the figure's unit; NaN ends when launches are too few. `launches`:
    of two samples the smaller count."""

    value: float
    low: float
    high: float
    launches: int
    sufficient: bool

    @property
    def ends(self) -> tuple[float, float, float]:
        return self.value, self.low, self.high

    @property
    def excludes_one(self) -> bool:
        """Whether a ratio's launches tell the two apart; too few tell nothing."""
        return self.sufficient and (self.low > 1 or self.high < 1)

    def text(self, form: str = ".3g") -> str:
        """`12.3 [12.1, 12.6]` or `12.3 (insufficient)`."""
        ends = f"[{self.low:{form}}, {self.high:{form}}]" if self.sufficient else "(insufficient)"
        return f"{self.value:{form}} {ends}"


UNKNOWN = Interval(math.nan, math.nan, math.nan, 0, False)


def together(many: int) -> float:
    """The cover of each of so many intervals of which all hold in COVER of cases or more, by C. E.
    Bonferroni's inequality: O. J. Dunn, Journal of the American Statistical Association 56 (1961), 52-64."""
    return 1 - (1 - COVER) / max(many, 1)


def rank(count: int, cover: float = COVER) -> int:
    """The greatest k for which the k-th least and the k-th greatest of `count` values hold the true median in
    95 % of cases or more, whatever their distribution; 0: there is none. At 6 launches they do in 96.9 %."""
    k = 0
    while 2 * k < count and held_by(k + 1, count) >= cover:
        k += 1
    return k


def held_by(k: int, count: int) -> float:
    """Probability that the k-th least and the k-th greatest of `count` values hold the true median."""
    return 1 - 2 * float(bdtr(k - 1, count, 0.5))


def methods() -> dict[str, str]:
    """How the intervals of medians and of their ratios are made, in sentences for the report."""
    few, more = (f"{100 * held_by(rank(n), n):.1f} % of cases at {n}" for n in (ENOUGH, 10))
    order = f"between two of the launches (order statistics). It holds the true median in {few} launches and"
    order += f" in {more.replace('of cases ', '')}, whatever the distribution."
    drawn = f"by percentile bootstrap; {RESAMPLES:,} resamples, in which the launches of both programs in one"
    said = {"median": order, "ratio": f"{drawn} round are drawn together."}
    least = (
        f"Of {FEWEST} to {ENOUGH - 1} launches it is Student's t of the times' logarithms, which takes them"
    )
    least += f" for normal. Fewer than {FEWEST}: “insufficient”."
    return {name: f"{100 * COVER:.3g} % interval {text} {least}" for name, text in said.items()}


def _of_few(value: float, *samples: np.ndarray, cover: float = COVER) -> Interval:
    """The t interval of a sample's median `value`; of the first's over the second's; of that ratio over the
    third's over the fourth's."""
    count = min(map(len, samples))
    if not all((one > 0).all() for one in samples):
        return Interval(value, np.nan, np.nan, count, False)
    logs = [np.log(one) for one in samples]
    middle = sum(sign * one.mean() for sign, one in zip((1, -1, -1, 1), logs, strict=False))
    wide = _welch([(one.var(ddof=1) / len(one), len(one)) for one in logs], cover)
    return Interval(value, math.exp(middle - wide), math.exp(middle + wide), count, True)


def _welch(parts: list[tuple[float, int]], cover: float = COVER) -> float:
    """Half of the interval of a sum of means, from each mean's variance and sample size."""
    variance = sum(part for part, _ in parts)
    shares = sum(part**2 / (count - 1) for part, count in parts)
    return float(stdtrit(variance**2 / shares, (1 + cover) / 2)) * math.sqrt(variance) if shares > 0 else 0.0


def median_interval(values: ArrayLike, cover: float = COVER) -> Interval:
    """Median over launches, between two of them. `values`: shape (launches,), any unit. NaN: no launch."""
    values = np.sort(np.asarray(values, float).ravel())
    value = float(np.median(values)) if len(values) else np.nan
    if len(values) < FEWEST or not np.isfinite(values).all():
        return Interval(value, np.nan, np.nan, len(values), False)
    if not (k := rank(len(values), cover)):
        return _of_few(value, values, cover=cover)
    return Interval(value, float(values[k - 1]), float(values[-k]), len(values), True)


def pairs_of(base: ArrayLike, other: ArrayLike, rounds: bool) -> tuple[np.ndarray, np.ndarray]:
    """Places in `base` and in `other` of the launches that were of one round, in its order. Of two Series
    their index tells the round (NaN: unknown), of others their place. None without `rounds`."""
    known = [some.index for some in (base, other) if isinstance(some, pd.Series) and not some.index.hasnans]
    if rounds and len(known) == 2:
        mine, others = map(np.asarray, known)
        return np.intersect1d(mine, others, return_indices=True)[1:]
    together = np.arange(np.size(base) if rounds and np.size(base) == np.size(other) else 0)
    return together, together


def resampled_ratios(
    base: ArrayLike, other: ArrayLike, random: np.random.Generator, count: int, pairs: Any = None
) -> np.ndarray:
    """Ratios of medians of `count` draws with replacement, shape (count,). Each draw has as many launches of
    both as there are: `pairs` (pairs_of) together, launches that the other has none beside by themselves."""
    pairs = pairs or pairs_of(base, other, True)

    def draws(places: np.ndarray) -> np.ndarray:
        if not len(places):
            return np.empty((count, 0), int)
        return places[random.integers(len(places), size=(count, len(places)))]

    drawn = draws(np.arange(len(pairs[0])))
    medians = []
    for values, places in zip((base, other), pairs, strict=True):
        alone = draws(np.setdiff1d(np.arange(np.size(values)), places))
        taken = np.concatenate([places[drawn], alone], axis=1)
        medians.append(np.median(np.asarray(values, float).ravel()[taken], axis=1))
    return medians[0] / medians[1]


@functools.lru_cache(maxsize=1 << 14)
def _ratio_ends(
    base: bytes, other: bytes, pairs: tuple[bytes, bytes], seed: int, count: int
) -> tuple[float, float]:
    """Ends, kept by the arrays' bytes: a report's chapters ask for the same ratios often, 5 ms each."""
    times = [np.frombuffer(one) for one in (base, other)]
    places = tuple(np.frombuffer(one, int) for one in pairs)
    low, high = np.percentile(
        resampled_ratios(*times, np.random.default_rng(seed), count, places), PERCENTILES
    )
    return float(low), float(high)


def ratio_interval(base: ArrayLike, other: ArrayLike, seed: int = 1, rounds: bool = True) -> Interval:
    """median(base) / median(other): the speed-up of `other` when both are times. `rounds`: they are of one
    interleaved run, and what slows a round of it slows both: launches of one round are drawn together. Of
    other runs, and beside a launch that was lost, each by itself."""
    launches = min(np.size(base), np.size(other))
    times = [np.asarray(one, float).ravel() for one in (base, other)]
    known = all((np.isfinite(one) & (one > 0)).all() for one in times)  # of a time of 0 there is no ratio
    value = float(np.median(base) / np.median(other)) if launches and known else np.nan
    if launches < FEWEST or not known:
        return Interval(value, np.nan, np.nan, launches, False)
    if launches < ENOUGH:
        return _of_few(value, *times)
    first, second = (np.asarray(places, int).tobytes() for places in pairs_of(base, other, rounds))
    packed = (one.tobytes() for one in times)
    return Interval(value, *_ratio_ends(*packed, (first, second), seed, RESAMPLES), launches, True)


def change_interval(
    before: tuple[ArrayLike, ArrayLike], after: tuple[ArrayLike, ArrayLike], seed: int = 1
) -> Interval:
    """The ratio median / median of `after` over that of `before`, two runs, each (of the one, of the other).
    Launches of one round are drawn together, the two runs each by itself: what slows a run slows both."""
    both = before, after
    launches = min(np.size(one) for pair in both for one in pair)
    ratios = [float(np.median(one) / np.median(other)) if launches else np.nan for one, other in both]
    value = ratios[1] / ratios[0]
    if launches < FEWEST or not all(np.isfinite(one).all() for pair in both for one in pair):
        return Interval(value, np.nan, np.nan, launches, False)
    if launches < ENOUGH:
        return _of_few(value, *(np.asarray(one, float) for pair in (after, before) for one in pair))
    random = np.random.default_rng(seed)
    first, second = (resampled_ratios(*pair, random, RESAMPLES) for pair in both)
    low, high = np.percentile(second / first, PERCENTILES)
    return Interval(value, float(low), float(high), launches, True)


def mean_ratio_interval(many: ArrayLike, few: ArrayLike) -> Interval:
    """mean(many) / mean(few) of two samples drawn apart from one another, such as scenes.

    A cost is summarized by its arithmetic mean (T. Hoefler and R. Belli, "Scientific Benchmarking of Parallel
    Computing Systems", SC 2015, rule 3). The interval is B. L. Welch's (Biometrika 34, 1947) of the means'
    logarithms, by the delta method: of simulated samples, one with a scatter of 40 % and skewed to the right
    as scenes of few shapes are, it holds the true ratio in 94 % of cases, of 6 scenes as of 48.
    """
    samples = [np.asarray(some, float).ravel() for some in (many, few)]
    count = min(map(len, samples))
    means = [some.mean() if count else np.nan for some in samples]
    value = float(means[0] / means[1])
    if count < ENOUGH or not all(np.isfinite(some).all() for some in samples):
        return Interval(value, np.nan, np.nan, count, False)
    both = zip(samples, means, strict=True)
    wide = _welch([(some.var(ddof=1) / (len(some) * mean**2), len(some)) for some, mean in both])
    return Interval(value, value * math.exp(-wide), value * math.exp(wide), count, True)
