"""Two modes of time, drift and warm-up: the dip against a linear program, and samples whose kind is known."""

import numpy as np
import pytest
from scipy.optimize import linprog

from study.numbers import modes, stats

RANDOM = 3


def by_linear_program(values: list[float]) -> float:
    """The least distance to a distribution that is convex up to a value, has an atom there or none, and is
    concave from it on. Unknown are the distribution at each value, at the mode before and after it, and the
    distance."""
    x = np.sort(values)
    n, best = len(x), np.inf
    above, below = np.arange(1, n + 1) / n, np.arange(n) / n
    for mode in range(n):
        places = [i for i in range(mode + 1)], [i + 1 for i in range(mode, n)]  # at the mode there are two
        rows, most = [], []

        def bound(coefficients: dict[int, float], limit: float, rows=rows, most=most) -> None:
            row = np.zeros(n + 2)
            for place, factor in coefficients.items():
                row[place] += factor
            rows.append(row)
            most.append(limit)

        for side, (some, bend) in enumerate(zip(places, (1, -1), strict=True)):
            xs = x[: mode + 1] if side == 0 else x[mode:]
            for i in range(len(some) - 1):
                bound({some[i]: 1, some[i + 1]: -1}, 0)
            for i in range(len(some) - 2):
                near, far = xs[i + 1] - xs[i], xs[i + 2] - xs[i + 1]
                slopes = {some[i]: -1 / near, some[i + 1]: 1 / near + 1 / far, some[i + 2]: -1 / far}
                bound({k: bend * v for k, v in slopes.items()}, 0)
            for i, place in enumerate(some):
                of = i if side == 0 else mode + i
                near_mode = of == mode
                for level, sign in ((above[of], 1), (below[of], 1)):
                    if near_mode and (level == above[of]) == (side == 0):
                        continue  # before the atom only the level before it counts, after it the other
                    bound({place: sign, n + 1: -1}, level)
                    bound({place: -sign, n + 1: -1}, -level)
        bound({mode: 1, mode + 1: -1}, 0)
        found = linprog(
            [0] * (n + 1) + [1], A_ub=np.array(rows), b_ub=most, bounds=[(0, 1)] * (n + 1) + [(0, 1)]
        )
        best = min(best, found.fun)
    return best


@pytest.mark.parametrize("count", [2, 3, 5, 12, 30])
@pytest.mark.parametrize("kind", ["even", "normal", "two"])
def test_the_dip_is_the_least_distance_to_one_mode(count, kind):
    random = np.random.default_rng([RANDOM, count])
    for _ in range(4):
        normal = random.normal(size=count)
        values = {
            "even": random.random(count),
            "normal": normal,
            "two": normal + 9 * (np.arange(count) < count / 2),
        }[kind]
        assert modes.dip(values) == pytest.approx(by_linear_program(list(values)), abs=1e-7)


def test_known_dips():
    assert modes.dip(range(10)) == pytest.approx(1 / 20)
    assert modes.dip([*np.arange(6), *1e9 + np.arange(6)]) == pytest.approx(1 / 4)


@pytest.mark.parametrize("count", [10, 30, 100])
def test_even_samples_seem_to_have_two_modes_in_5_percent_of_cases_normal_ones_hardly_ever(count):
    random = np.random.default_rng(RANDOM)
    found = [modes.modes(np.exp(random.random(count))) is not None for _ in range(600)]
    assert np.mean(found) == pytest.approx(0.05, abs=0.025)
    found = [modes.modes(np.exp(random.normal(size=count))) is not None for _ in range(600)]
    assert np.mean(found) <= 0.02


@pytest.mark.parametrize("share", [0.5, 0.3])
@pytest.mark.parametrize("gap", [0.1, 0.3])
def test_two_modes_are_found_and_described(share, gap):
    random = np.random.default_rng(RANDOM)
    slow = np.arange(60) < 60 * share
    found = modes.modes(10 * np.exp(gap * slow + 0.01 * random.normal(size=60)))
    assert found and (found.low_launches, found.high_launches) == (60 * (1 - share), 60 * share)
    assert [found.low, found.high] == pytest.approx([10, 10 * np.exp(gap)], rel=0.01)
    median = stats.Interval(10.5, 9.9, 10 * np.exp(gap), 60, True)
    assert found.split(median) and not found.split(stats.Interval(10, 9.9, 10.02, 60, True))
    assert f"({found.low_launches} launches)" in found.text()


@pytest.mark.parametrize("slow", [12, 30, 48])
def test_outliers_beside_two_modes_are_no_mode(slow):
    """Launches of 10 and 11 ms, and two that took six times as long."""
    random = np.random.default_rng(RANDOM)
    times = np.where(np.arange(60) < slow, 11, 10) * np.exp(0.005 * random.normal(size=60))
    found = modes.modes(np.append(times, [61, 62]))
    assert found and (found.low_launches, found.high_launches) == (60 - slow, slow + 2)


@pytest.mark.parametrize("kind", ["skewed", "outliers", "rounded", "near", "few", "equal"])
def test_one_mode_is_none_of_these(kind):
    random = np.random.default_rng(RANDOM)
    normal = random.normal(size=80)
    times = {
        "skewed": 10 + random.exponential(size=80),
        "outliers": np.append(10 + 0.1 * normal[:76], [30, 31, 32, 33]),
        "rounded": np.round(10 + 0.3 * normal, 1),
        "near": 10 + 0.001 * normal + 0.05 * (normal > 0),  # two, half a percent apart
        "few": np.array([10.0, 10, 10, 20, 20, 20]),
        "equal": np.full(80, 10.0),
    }[kind]
    assert modes.modes(times) is None


def test_a_drift_is_said_with_its_size_and_chance_makes_none():
    random = np.random.default_rng(RANDOM)
    noise = np.exp(0.02 * random.normal(size=(300, 40)))
    assert sum(modes.drift(one) is not None for one in noise) <= 2  # 1 in 1,000
    assert modes.drift(noise[0] * np.linspace(10, 12, 40)) == pytest.approx(0.17, abs=0.03)
    assert modes.drift(noise[0] * np.where(np.arange(40) < 20, 12, 10)) == pytest.approx(-1 / 6, abs=0.02)
    assert modes.drift([10.0] * 6) is None and modes.drift(10 + 0.001 * np.arange(40)) is None


def test_a_drift_of_many_launches_needs_no_matrix_of_them():
    assert modes.drift(np.linspace(10, 12, 100_000)) == pytest.approx(11.75 / 10.25 - 1, abs=0.001)
    assert modes.drift(10 + np.random.default_rng(RANDOM).random(100_000)) is None


def test_warm_up_ends_with_the_first_launch_that_is_no_faster():
    times = [30.0, 20, 15, 14.9, 15.1]
    assert [modes.warm(times[:n]) for n in range(6)] == [False, False, False, False, True, True]
