"""Times and ratios of programs: launches that other processes interrupted are left out."""

import numpy as np
import pandas as pd
import pytest

from study.numbers import programs, sequential
from study.numbers.programs import ENOUGH

BUSY = 2_000_000.0  # ns
SLICE = 3_000_000.0  # ns, of a neighbour that takes turns on the CPU


def launches(times: np.ndarray, interruptions: np.ndarray) -> pd.DataFrame:
    more = {"user_ns": BUSY, "system_ns": 0.0, "ctx_involuntary": interruptions}
    return pd.DataFrame({"ns": times, **more})


@pytest.mark.parametrize("calm, used", [(30, 30), (ENOUGH, ENOUGH), (ENOUGH - 1, 100), (100, 100)])
def test_interrupted_launches_are_left_out_where_enough_others_are_there(calm, used):
    taken = (np.arange(100) >= calm).astype(int)
    found = programs.times(launches(BUSY + SLICE * taken, taken))
    assert len(found) == used and found.max() == BUSY + SLICE * (used > calm)


def test_a_ratio_is_of_rounds_in_which_neither_was_interrupted():
    """Two programs 2 % apart; from the 60th round on a neighbour takes slices from either."""
    random = np.random.default_rng(5)
    own = np.exp(random.normal(size=(2, 200)) * 0.002) * BUSY * [[1.02], [1]]
    taken = random.integers(0, 3, (2, 200)) * (np.arange(200) >= 60)
    first, second = (launches(ns + SLICE * n, n) for ns, n in zip(own, taken, strict=True))
    found = programs.ratios(first, second)
    assert [*found.index] == [*np.flatnonzero(~taken.any(axis=0))]
    interval = sequential.median_interval(found)
    assert interval.low <= 1.02 <= interval.high and interval.high < 1.03


def test_few_interruptions_of_a_long_launch_are_none():
    long = launches(np.full(40, 1e9), np.full(40, 20))
    assert len(programs.times(long.assign(ns=np.arange(40) + 1e9))) == 40
    rare = long.assign(ctx_involuntary=[21] * 20 + [20] * 20)
    assert [*programs.times(rare).index] == [*range(20, 40)]


def test_runs_of_other_tools_tell_no_interruption():
    read = pd.DataFrame({"ns": [1.0, 2, 3]})
    assert [*programs.times(read)] == [1, 2, 3] and [*programs.ratios(read, read)] == [1, 1, 1]
