"""Whether launches of one program take longer than those of another: exact rank tests, and their correction.

H. B. Mann and D. R. Whitney, Annals of Mathematical Statistics 18 (1947), 50-60: the test is exact whatever
the distribution of times, two modes and outliers too. Y. Benjamini and Y. Hochberg, Journal of the Royal
Statistical Society B 57 (1995), 289-300: its correction where several programs are judged at once.
"""

from collections.abc import Sequence
from math import comb

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from scipy.stats import false_discovery_control, mannwhitneyu

from study.numbers import stats

LEVEL = (1 - stats.COVER) / 2  # of slower, and of faster
EXACT = 50  # launches: of more the normal approximation does


def longer(base: ArrayLike, other: ArrayLike, least: float = 0.0) -> float:
    """P-value against "`other` takes no more than 1 + `least` times as long as `base`": arrays of
    launches, in one unit. Two equal values count half."""
    first, second = (np.asarray(one, float).ravel() for one in (base, other))
    first = first * (1 + least)
    both = np.concatenate([first, second])
    method = "exact" if len(both) <= 2 * EXACT and len(np.unique(both)) == len(both) else "asymptotic"
    return float(mannwhitneyu(second, first, alternative="greater", method=method).pvalue)


def corrected(p_values: Sequence[float]) -> list[float]:
    """P-values of one family by Benjamini and Hochberg. Where none of the family is slower, one or more is
    under LEVEL with a probability of at most LEVEL; of those that are under it, at most LEVEL are wrong on
    average."""
    return [float(p) for p in false_discovery_control(p_values)] if p_values else []


def family(launches: int) -> int:
    """The most programs of which a single slower one can be told by so many launches of each run."""
    return int(LEVEL * comb(2 * launches, launches))


def by_round(time: pd.Series, base: pd.Series) -> np.ndarray:
    """`time` over `base`, by launches of one round; without rounds in common over the median of `base`."""
    mine, others = stats.pairs_of(time, base, True)
    if len(mine):
        return time.to_numpy(float)[mine] / base.to_numpy(float)[others]
    return time.to_numpy(float) / float(np.median(base))
