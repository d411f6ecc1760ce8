"""Launches in two modes of time, and launches that drift.

Two modes: the dip, the greatest distance of the launches' distribution to the nearest with one mode: J. A.
Hartigan and P. M. Hartigan, "The dip test of unimodality", Annals of Statistics 13 (1985). It is held against
the dips of uniform samples, the hardest case; skewed times and a few outliers have one mode. Drift: H. B.
Mann's test of a trend (Econometrica 13, 1945), by Kendall's tau.

Warm-up cannot be taken for granted, nor its length (E. Barrett et al., "Virtual machine warmup blows hot and
cold", OOPSLA 2017): it is looked for in every run, among launches that are then left out.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from study.numbers.stats import Interval

# 95 % quantile of √n times the dip of n uniform values, by simulation (100,000 samples of each n).
COUNTS, DIPS = (8, 10, 20, 50, 100, 200, 500), (0.435, 0.441, 0.470, 0.496, 0.512, 0.521, 0.529)
CHANCE = 0.001  # of a drift where there is none
MOST = 1000  # launches by which a drift is told: of more, every second, third …
LEAST = 0.01  # relative: modes that are nearer to one another, and smaller drifts, are not worth a word


def _minorant(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Places of the corners of the greatest convex function below the points, x ascending."""
    corners: list[int] = []
    for i in range(len(x)):
        while len(corners) > 1:
            a, b = corners[-2:]
            if (y[b] - y[a]) * (x[i] - x[a]) < (y[i] - y[a]) * (x[b] - x[a]):
                break
            corners.pop()
        corners.append(i)
    return np.array(corners)


def dip(values: ArrayLike) -> float:
    """The dip of n values, no two equal: from 1 / (2 n), one mode, to 1/4, two equal modes of no width."""
    x = np.sort(np.asarray(values, float))
    first, last, found = 0, len(x) - 1, 1 / len(x)
    above = np.arange(1, len(x) + 1) / len(x)  # the distribution after each value, and before it
    below = above - found
    while last > first:
        some = slice(first, last + 1)
        here, high, low = x[some], above[some], below[some]
        convex = _minorant(here, low)
        concave = _minorant(-here[::-1], -high[::-1])
        concave = len(here) - 1 - concave[::-1]
        gcm = np.interp(here, here[convex], low[convex])
        lcm = np.interp(here, here[concave], high[concave])
        gaps = [(lcm - gcm)[corners].max() for corners in (convex, concave)]
        widest = max(gaps)
        if widest <= found:
            break
        # The modal interval: from the corner with the widest gap to the next one of the other function.
        if gaps[0] >= gaps[1]:
            left = int(convex[np.argmax((lcm - gcm)[convex])])
            right = int(concave[concave >= left][0])
        else:
            right = int(concave[len(concave) - 1 - np.argmax((lcm - gcm)[concave][::-1])])
            left = int(convex[convex <= right][-1])
        found = max(found, (high - gcm)[: left + 1].max(), (lcm - low)[right:].max())
        if (left, right) == (0, len(here) - 1):
            break
        first, last = first + left, first + right
    return float(found) / 2


def _unrounded(found: np.ndarray) -> np.ndarray:
    """Equal values, which a program printed with few digits, spread over what was rounded away; ascending."""
    _, places, counts = np.unique(found, return_inverse=True, return_counts=True)
    step = np.diff(np.unique(found)).min()
    nth = np.arange(len(found)) - (np.cumsum(counts) - counts)[places]
    return found + step * ((nth + 0.5) / counts[places] - 0.5)


@dataclass(frozen=True)
class Modes:
    """Two modes of launches: the median of each, in the launches' unit, and how many launches it has.
    `between`: the greatest value of the lower one and the least of the upper one."""

    low: float
    high: float
    low_launches: int
    high_launches: int
    between: tuple[float, float]

    def split(self, found: Interval) -> bool:
        """Whether a median is no more the one mode's than the other's: its interval reaches both."""
        return found.low <= self.between[0] and found.high >= self.between[1]

    def within(self, values: ArrayLike) -> np.ndarray:
        """Each value over its mode's median: launches that change between modes have no trend by that."""
        found = np.asarray(values, float)
        return found / np.where(found <= self.between[0], self.low, self.high)

    def text(self, form: str = ".4g", unit: str = "") -> str:
        low, high = f"{self.low:{form}}{unit}", f"{self.high:{form}}{unit}"
        return f"{low} ({self.low_launches} launches) and {high} ({self.high_launches})"


def modes(values: ArrayLike) -> Modes | None:
    """None where the launches do not show two that are LEAST or more apart. All are above 0."""
    found = np.sort(np.asarray(values, float))
    count = len(found)
    if count < COUNTS[0] or not np.isfinite(found).all() or found[0] == found[-1]:
        return None
    logs = np.log(_unrounded(found))
    if dip(logs) * math.sqrt(count) <= np.interp(count, COUNTS, DIPS):
        return None
    # Where both halves scatter least about their means (N. Otsu, IEEE Trans. SMC 9, 1979), but for the outer
    # twentieth on each side: outliers would be a half of their own.
    cut = -(-count // 20)
    inner = logs[cut : count - cut]
    lengths = np.arange(1, len(inner))
    sums = np.cumsum(inner)
    means = sums[:-1] / lengths, (sums[-1] - sums[:-1]) / lengths[::-1]
    at = cut + int(np.argmax(lengths * lengths[::-1] * (means[1] - means[0]) ** 2)) + 1
    low, high = float(np.median(found[:at])), float(np.median(found[at:]))
    if high < (1 + LEAST) * low:
        return None
    return Modes(low, high, at, count - at, (float(found[at - 1]), float(found[at])))


def drift(values: ArrayLike) -> float | None:
    """How much the last quarter's median is off the first quarter's, relative, where the launches in
    their order have a trend; else None."""
    found = np.asarray(values, float)
    found = found[:: -(-len(found) // MOST) or 1]
    count, quarter = len(found), len(found) // 4
    if quarter < 2 or not np.isfinite(found).all():
        return None
    rises = np.sign(np.triu(found[None, :] - found[:, None])).sum()
    chance = math.erfc(abs(rises) / math.sqrt(count * (count - 1) * (2 * count + 5) / 9))
    change = float(np.median(found[-quarter:]) / np.median(found[:quarter])) - 1
    return change if chance < CHANCE and abs(change) >= LEAST else None


def warm(times: ArrayLike) -> bool:
    """Whether a program's warm-up is over: its last launch was no more than LEAST faster than the fastest
    before it. It is a rule for when to stop that sees only the launches of the warm-up."""
    found = np.asarray(times, float)
    return len(found) > 1 and bool(found[-1] >= (1 - LEAST) * found[:-1].min())
