"""Intervals of a median that hold at every look: against exact probabilities, and by simulated measurings."""

import math
from operator import attrgetter

import numpy as np
import pandas as pd
import pytest
from scipy.special import comb, gamma

from study.numbers import sequential, stats

LOOKS = 3000


@pytest.mark.parametrize("n", [*range(1, 40), 200])
def test_the_bounds_are_the_mixture_s(n):
    """k of n launches are below the median with a likelihood of 2^-n each; by a share p that is drawn from
    Beta(2, 2) they have Γ(4) Γ(k + 2) Γ(n - k + 2) / Γ(n + 4). Bounds are where the second is 20 times the
    first (Ville's inequality)."""
    mixture = [
        6 * math.exp(math.lgamma(k + 2) + math.lgamma(n - k + 2) - math.lgamma(n + 4)) for k in range(n)
    ]
    refused = [k for k in range((n + 1) // 2) if mixture[k] * 2.0**n >= 20]
    assert sequential.rank(n) == len(refused)
    rarer = [k for k in range((n + 1) // 2) if mixture[k] * 2.0**n >= 60]
    assert sequential.rank(n, stats.together(3)) == len(rarer)
    assert gamma(4) == 6 and sequential.rank(8) == 0 and sequential.rank(9) == 1
    if k := len(refused):
        found = sequential.median_interval(pd.Series(np.random.default_rng(n).permutation(n) + 1.0))
        assert (found.value, found.low, found.high) == ((n + 1) / 2, k, n + 1 - k)


def test_of_all_looks_one_misses_the_median_in_5_percent_of_runs_at_most():
    """Exactly, by the walk's probabilities: those that have not yet crossed, launch by launch."""
    alive = np.array([1.0])  # by the number of launches below the median
    for n in range(1, LOOKS + 1):
        alive = 0.5 * (np.append(alive, 0) + np.append(0, alive))
        k = sequential.rank(n)
        alive[:k] = 0
        alive[n + 1 - k :] = 0
    missed = 1 - alive.sum()
    assert 0.02 < missed <= 0.05
    at_each = [1 - 2 * sum(comb(n, k) for k in range(stats.rank(n))) / 2.0**n for n in (20, 100)]
    assert min(at_each) >= 0.95  # the interval of a fixed number holds for one look


def measured(random: np.random.Generator, ratio: float, rounds: int) -> tuple[np.ndarray, np.ndarray]:
    """Times of two programs: rounds share noise, a neighbour begins in mid-run, some launches are off."""
    shared = random.normal(size=rounds) * 0.05 + 0.3 * (np.arange(rounds) > random.integers(rounds))
    own = random.normal(size=(2, rounds)) * 0.015 + 0.5 * (random.random((2, rounds)) < 0.03)
    return tuple(np.exp(shared + own) * [[ratio], [1]])


def stopped(random, ratio: float, stop, most: int = 200, fixed: bool = False) -> stats.Interval:
    """The interval at the first look at which `stop` is satisfied, or of `most` rounds."""
    base, other = measured(random, ratio, most)
    found = stats.UNKNOWN
    for n in range(9, most + 1):
        rounds = pd.Series(base[:n] / other[:n])
        found = sequential.median_interval(rounds, not fixed)
        if stop(found):
            break
    return found


@pytest.mark.slow
@pytest.mark.parametrize("ratio", [1.0, 1.02])
def test_stopping_by_the_width_costs_no_coverage(ratio):
    """400 measurings that stop at ±1 %: 95 % hold the true ratio, or more; few err about which is faster."""
    random = np.random.default_rng(11)
    found = [stopped(random, ratio, lambda one: sequential.within(one, 0.01)) for _ in range(400)]
    assert np.mean([one.low <= ratio <= one.high for one in found]) >= 0.95
    assert np.mean([one.launches < 200 for one in found]) > 0.9  # they did stop
    assert np.mean([one.high < 1 for one in found]) <= 0.025


@pytest.mark.slow
def test_stopping_at_the_first_difference_costs_no_coverage_where_a_fixed_interval_fails():
    """Equal programs are looked at after every round until one seems faster."""
    random = np.random.default_rng(12)
    differs = attrgetter("excludes_one")
    assert np.mean([differs(stopped(random, 1, differs, 80)) for _ in range(200)]) <= 0.05
    assert np.mean([differs(stopped(random, 1, differs, 80, fixed=True)) for _ in range(200)]) > 0.15


def test_the_ratio_is_of_rounds_that_both_have():
    base = pd.Series([10.0, 20, 30, 40] * 5)
    other = pd.Series([5.0, 10, 15, 20] * 5)
    assert [*sequential.ratios(base, other)] == [2] * 20
    assert [*sequential.ratios(base, other[3:]).index] == [*range(3, 20)]


def test_within_is_of_the_value_and_of_an_interval_that_there_is():
    assert sequential.within(stats.Interval(100, 99, 101, 9, True), 0.01)
    assert not sequential.within(stats.Interval(100, 98.9, 100, 9, True), 0.01)
    assert not sequential.within(stats.Interval(100, 100, 101.1, 9, True), 0.01)
    assert not sequential.within(stats.Interval(100, 100, 100, 3, False), 0.01)
