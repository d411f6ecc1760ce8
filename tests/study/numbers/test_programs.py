"""Times and ratios of programs: launches that other processes interrupted are left out."""

import numpy as np
import pandas as pd
import pytest

from study.core.run_schema import Plan, Program
from study.numbers import noise, programs, sequential
from study.numbers.analysis import Cell, Facts
from study.numbers.programs import ENOUGH, UNSURE

BUSY = 2_000_000.0  # ns
SLICE = 3_000_000.0  # ns, of a neighbour that takes turns on the CPU


def launches(times: np.ndarray, interruptions: np.ndarray) -> pd.DataFrame:
    """On one CPU, of which others have what a launch takes longer than BUSY."""
    more = {"user_ns": BUSY, "system_ns": 0.0, "unused_ns": times - BUSY}
    more |= {"ctx_involuntary": interruptions, "ctx_voluntary": 1}
    return pd.DataFrame({"ns": times, **more})


@pytest.mark.parametrize("calm, used", [(30, 30), (ENOUGH, ENOUGH), (ENOUGH - 1, 100), (100, 100)])
def test_interrupted_launches_are_left_out_where_enough_others_are_there(calm, used):
    taken = (np.arange(100) >= calm).astype(int)
    found = programs.calm(launches(BUSY + SLICE * taken, taken)).ns
    assert len(found) == used and found.max() == BUSY + SLICE * (used > calm)


def test_a_ratio_is_of_rounds_in_which_neither_was_interrupted():
    """Two programs 2 % apart; from the 60th round on a neighbour takes slices from either."""
    random = np.random.default_rng(5)
    own = np.exp(random.normal(size=(2, 200)) * 0.002) * BUSY * [[1.02], [1]]
    taken = random.integers(0, 3, (2, 200)) * (np.arange(200) >= 60)
    first, second = (launches(ns + SLICE * n, n) for ns, n in zip(own, taken, strict=True))
    found = programs.ratios(first, second)
    assert [*found.index] == [*np.flatnonzero(~taken.any(axis=0))] and not found.disturbed.any()
    interval = sequential.median_interval(found.ratio)
    assert interval.low <= 1.02 <= interval.high and interval.high < 1.03


def test_few_interruptions_of_a_long_launch_are_none():
    long = launches(np.full(40, 1e9), np.full(40, 20))
    assert len(programs.calm(long)) == 40
    rare = long.assign(ctx_involuntary=[21] * 20 + [20] * 20)
    assert [*programs.calm(rare).index] == [*range(20, 40)]


def test_a_program_s_own_threads_interrupt_nothing():
    """They take turns on the one CPU, and all of its time is theirs: 1 % and .2 ms are the launcher's."""
    own = launches(np.full(40, 1.01 * BUSY + 200_000), np.arange(40))
    assert not noise.interrupted(own).any() and noise.others(own) == []
    others = own.assign(unused_ns=own.unused_ns + 1)
    assert noise.interrupted(others).sum() == 39 and len(noise.others(others)) == 1


@pytest.mark.parametrize("waits, taken, interrupted", [(2, 1, 0), (2, 2, 40), (1, 1, 40)])
def test_a_program_that_waits_is_switched_out_once_by_its_launcher(waits, taken, interrupted):
    """10 ms, of which it uses 2: as `sleep` on an idle machine, which is switched out once in each launch."""
    some = launches(np.full(40, 5 * BUSY), np.full(40, taken)).assign(ctx_voluntary=waits)
    assert noise.interrupted(some).sum() == interrupted and len(noise.others(some)) == bool(interrupted)


@pytest.mark.parametrize(
    "interruptions, left_out, disturbed, said", [(0, 0, 0, "the same within 5 %"), (1, 0, 40, UNSURE)]
)
def test_a_ratio_of_rounds_that_are_all_interrupted_is_not_called_the_same(
    interruptions, left_out, disturbed, said
):
    taken = np.full(40, interruptions)
    both = [launches(BUSY + SLICE * taken + np.arange(40), taken) for _ in range(2)]
    cells = [Cell(name, name, 1, 1, 1, Facts(), one) for name, one in zip("ab", both, strict=True)]
    plan = Plan(programs=[Program(name=name, case=name, command=[name]) for name in "ab"], precision=0.05)
    _, row = programs.rows(cells, plan)
    assert (row.left_out, row.disturbed, row.verdict) == (left_out, disturbed, said)
    assert len(programs.remarks([row])) == bool(disturbed)


def test_figures_are_of_the_launches_that_count():
    """Interrupted launches take 9 J, the others 1."""
    taken = (np.arange(40) >= 20).astype(int)
    values = launches(BUSY + SLICE * taken, taken).assign(joules=1 + 8.0 * taken, user_ns=BUSY * (1 + taken))
    plan = Plan(programs=[Program(name="a", case="", command=["a"])], precision=0.05)
    (row,) = programs.rows([Cell("", "a", 1, 1, 1, Facts(), values)], plan)
    assert (row.launches, row.left_out, row.joules, row.cpu_ms) == (20, 20, 1, BUSY / 1e6)


@pytest.mark.parametrize("slope", [0, 0.1])
def test_launches_that_change_their_mode_drift_only_within_it(slope):
    """The first 20 of 40 are mostly of 2 ms, the others mostly of 3."""
    place = np.arange(40)
    ns = (
        BUSY
        * np.where((place >= 20) ^ (place % 13 == 5), 1.5, 1)
        * (1 + slope * place / 40 + place * 17 % 40 * 1e-5)
    )
    plan = Plan(programs=[Program(name="a", case="", command=["a"])], precision=0.05)
    (row,) = programs.rows([Cell("", "a", 1, 1, 1, Facts(), pd.DataFrame({"ns": ns}))], plan)
    assert row.modes and (0.2 * slope < row.drift < slope if slope else row.drift is None)


@pytest.mark.parametrize(
    "ms, other, verdict",
    [(30, 29, UNSURE), (30, 33, "slower"), (30, 30, UNSURE), (900, 901, "the same within 1 %")],
)
def test_no_difference_is_told_that_is_within_the_step_of_a_clock(ms, other, verdict):
    """Of 1 ms: each tenth launch has one more."""
    both = [pd.DataFrame({"ns": 1e6 * (n + (np.arange(40) % 10 == 9))}) for n in (ms, other)]
    cells = [Cell("", name, 1, 1, 1, Facts(), one) for name, one in zip("ab", both, strict=True)]
    plan = Plan(programs=[Program(name=name, case="", command=["x"]) for name in "ab"], precision=0.01)
    one, two = programs.rows(cells, plan)
    assert (one.step, two.verdict) == (pytest.approx(1 / ms), verdict)


def gate(random: np.random.Generator, factors: list[float], rounds: int) -> list[str]:
    """What a gate names of programs that take so many times as long as the first."""
    cells = []
    for place, factor in enumerate([1, *factors]):
        ns = BUSY * factor * np.exp(0.02 * random.normal(size=rounds))
        cells.append(Cell("", str(place), 1, 1, 1, Facts(), pd.DataFrame({"ns": ns})))
    plan = Plan(programs=[Program(name=one.spec, case="", command=["a"]) for one in cells])
    return programs.slower(programs.rows(cells, plan), 0)


def test_a_gate_of_many_equal_programs_fails_no_oftener_than_one_of_two():
    """20 gates of 19 verdicts each, of which 2.5 % fail; each verdict by itself would fail a fifth."""
    random = np.random.default_rng(5)
    assert sum(bool(gate(random, [1] * 19, 20)) for _ in range(20)) <= 1
    assert [line.split()[1] for line in gate(random, [1] * 18 + [1.2], 20)] == ["19"]
    assert len(gate(random, [1, 1], 2)) == 2 and not gate(random, [1, 1], 6)  # two are too few


def test_runs_of_other_tools_tell_no_interruption():
    read = pd.DataFrame({"ns": [1.0, 2, 3]})
    assert [*programs.calm(read).ns] == [1, 2, 3] and [*programs.ratios(read, read).ratio] == [1, 1, 1]


def beside_a_neighbour(random: np.random.Generator, own_ms: float, asleep_ms: float = 0) -> pd.DataFrame:
    """40 launches that take turns of 3 ms with another process on their CPU, but not while they sleep."""
    ran = own_ms * np.exp(0.003 * random.normal(size=40))
    taken = ran // 3 + (random.random(40) < 0.5)
    some = launches(1e6 * (ran + 3 * taken * np.exp(0.05 * random.normal(size=40)) + asleep_ms), taken)
    return some.assign(user_ns=1e6 * ran, unused_ns=some.ns - 1e6 * ran)


def called(random: np.random.Generator, first: tuple[float, float], other: tuple[float, float]) -> str:
    rounds = programs.ratios(*(beside_a_neighbour(random, *one) for one in (first, other)))
    assert len(rounds) == 40 and rounds.disturbed.sum() > 30
    found = sequential.median_interval(rounds.ratio)
    return programs.verdict(found, found, rounds.ratio, None)


@pytest.mark.slow
def test_a_verdict_of_interrupted_launches_is_not_wrong_of_programs_that_only_compute():
    """100 pairs of equal programs, and 100 of which one takes 5 % longer; sleeping is another matter."""
    random = np.random.default_rng(7)
    equal = [called(random, (13, 0), (13, 0)) for _ in range(100)]
    assert equal.count(programs.FASTER) + equal.count(programs.SLOWER) <= 5
    longer = [called(random, (13, 0), (13.65, 0)) for _ in range(100)]
    assert longer.count(programs.FASTER) <= 2
    assert called(random, (9, 0), (1, 9)) == programs.FASTER  # though it takes 10 ms alone, and the first 9
