"""Power laws whose answer is known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from study.core.cli import StudyError
from study.numbers import power_laws


def noisy(xs: list[float], exponent: float, seed: int, launches: int = 12, noise: float = 0.03) -> list:
    random = np.random.default_rng(seed)
    return [2.5 * x**exponent * np.exp(noise * random.standard_normal(launches)) for x in xs]


@pytest.mark.parametrize("exponent", [-1.0, 0.0, 0.5, 1.0, 2.0])
def test_a_law_without_noise_is_found_exactly(exponent: float) -> None:
    xs = [100, 200, 400, 1600]
    found = power_laws.fit(xs, [[7 * x**exponent] * 6 for x in xs])
    assert found.exponent.value == pytest.approx(exponent, abs=1e-12)
    assert found.factor == pytest.approx(7, rel=1e-9) and found.worst == pytest.approx(1)
    assert (found.exponent.low, found.exponent.high) == (pytest.approx(exponent), pytest.approx(exponent))
    assert found.holds is True and found.off == []


def test_the_interval_holds_the_true_exponent_about_as_often_as_it_says(monkeypatch) -> None:
    monkeypatch.setattr(power_laws, "RESAMPLES", 1000)
    xs = [1, 4, 16, 64, 256]
    held, widths = 0, []
    for seed in range(200):
        law = power_laws.fit(xs, noisy(xs, 1.3, seed), seed=seed).exponent
        held += law.low <= 1.3 <= law.high
        widths.append(law.high - law.low)
    assert 0.88 <= held / 200 <= 0.995  # of 95 %, which medians of twelve just miss
    # The interval of a least-squares slope through medians: 2·1.96·σ·√(π/2)/√launches/√Σ(x−x̄)², x = log 4^i.
    spread = math.sqrt(math.pi / 2) * 0.03 / math.sqrt(12) / math.sqrt(10 * math.log(4) ** 2)
    assert np.median(widths) == pytest.approx(2 * 1.96 * spread, rel=0.25)


def test_a_constant_below_a_law_is_no_power_law_and_the_places_are_said() -> None:
    xs = [1, 4, 16, 64, 256, 1024]
    found = power_laws.fit(xs, [[x + 20] * 6 for x in xs])
    assert found.holds is False and {1, 16} <= set(found.off)
    assert found.first.value == pytest.approx(math.log(24 / 21) / math.log(4))
    assert found.last.value == pytest.approx(math.log(1044 / 276) / math.log(4))
    slope, height = np.polyfit(np.log(xs), np.log(np.add(xs, 20)), 1)  # another least squares
    assert (found.exponent.value, found.factor) == (pytest.approx(slope), pytest.approx(math.exp(height)))
    residuals = np.exp(np.log(np.add(xs, 20)) - (slope * np.log(xs) + height))
    farthest = int(np.abs(np.log(residuals)).argmax())
    assert found.worst == pytest.approx(residuals[farthest]) and found.worst_x == xs[farthest]


def test_too_few_launches_have_no_interval_and_two_points_no_verdict() -> None:
    few = power_laws.fit([1, 2, 4], [[1] * 2, [2] * 6, [4] * 6])
    assert few.exponent.low is None and "insufficient" in power_laws.text(few.exponent)
    scattered = power_laws.fit([1, 2, 4], [[0.9, 1, 1.1], [2] * 6, [4] * 6]).exponent
    assert scattered.low < 1 < scattered.high
    assert power_laws.fit([1, 2], [[1] * 6, [2] * 6]).holds is None


@pytest.mark.parametrize(
    ("xs", "samples"),
    [
        ([1], [[1.0]]),
        ([1, 1], [[1.0], [2.0]]),
        ([1, 2], [[1.0], [0.0]]),
        ([1, 2], [[1.0], [math.nan]]),
    ],
)
def test_what_no_law_goes_through_is_refused(xs: list, samples: list) -> None:
    with pytest.raises(StudyError):
        power_laws.fit(xs, samples)
