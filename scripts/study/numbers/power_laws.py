"""Power laws y = a·x^b through a series: exponents with intervals, and where the law does not hold.

Least squares in log y over log x through the medians of the launches; the 95 % interval is that of a
percentile bootstrap (Efron and Tibshirani 1993, chapter 13) which draws the launches of each point anew. It
holds the noise of the launches and nothing else: whether the points lie on a power law at all is for the
residuals to say, as no interval of an exponent can.
"""

import math
from collections.abc import Sequence
from typing import Annotated

import numpy as np

from study.core.cli import StudyError
from study.core.schema import Record, key
from study.numbers.schema import Range
from study.numbers.stats import ENOUGH, FEWEST, RESAMPLES

OFF = 1.10  # a point that far from the law, beyond its launches' noise, is not on it
LEAST = 3  # points: two are always on one law


class Law(Record, kw_only=True):
    """factor·x^exponent through the points; 95 % by bootstrap over launches."""

    exponent: Annotated[Range, key("", "of all points")]
    factor: Annotated[float | None, key("as the figure", "at x = 1")]
    points: Annotated[int, key("points", "fitted")]
    first_x: Annotated[float, key("`axes`", "least x")]
    last_x: Annotated[float, key("`axes`", "largest x")]
    first: Annotated[Range, key("", "exponent of the first two points alone")]
    last: Annotated[Range, key("", "exponent of the last two points alone")]
    worst: Annotated[float | None, key("×", "largest residual as a factor")]
    worst_x: Annotated[float | None, key("`axes`", "there")]
    off: Annotated[list[float], key("`axes`", "x over 10 % off the law and beyond their noise")]
    holds: Annotated[bool | None, key("", "none is; null: two points")]


def _medians(values: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Logarithms of the medians of RESAMPLES draws, shape (RESAMPLES,); of few values Student's t."""
    if len(values) < ENOUGH:
        logs = np.log(values)
        wide = logs.std(ddof=1) / math.sqrt(len(logs))
        return logs.mean() + wide * random.standard_t(len(logs) - 1, RESAMPLES)
    return np.log(np.median(values[random.integers(len(values), size=(RESAMPLES, len(values)))], axis=1))


def _exponent(value: float, resampled: np.ndarray | None) -> Range:
    """The exponent with its 95 % interval; null ends where a point has too few launches."""
    low, high = (None, None) if resampled is None else map(float, np.percentile(resampled, [2.5, 97.5]))
    return Range(value=float(value), low=low, high=high)


def fit(xs: Sequence[float], samples: Sequence[Sequence[float]], exact: bool = False, seed: int = 1) -> Law:
    """The law through x and the values of each point's launches, any unit. `exact`: counts, without noise.
    Raises StudyError for fewer than two points and for what has no logarithm."""
    points = [
        np.asarray(some, float) for _, some in sorted(zip(xs, samples, strict=True), key=lambda p: p[0])
    ]
    if len(set(xs)) < max(2, len(xs)) or min(xs) <= 0 or not all((some > 0).all() for some in points):
        raise StudyError(f"a power law goes through two or more x, each once, and y above 0; not {list(xs)}")
    x = np.log(np.sort(np.asarray(xs, float)))
    y = np.log([np.median(point) for point in points])
    slope_of = (x - x.mean()) / ((x - x.mean()) ** 2).sum()  # slope = slope_of · y
    drawn: np.ndarray | None = None
    if exact:
        drawn = np.tile(y, (2, 1))
    elif min(len(point) for point in points) >= FEWEST:
        random = np.random.default_rng(seed)
        drawn = np.stack([_medians(point, random) for point in points], axis=1)

    def between(i: int, j: int) -> Range:
        step = x[j] - x[i]
        return _exponent((y[j] - y[i]) / step, None if drawn is None else (drawn[:, j] - drawn[:, i]) / step)

    def residuals(values: np.ndarray) -> np.ndarray:
        about = values - values.mean(axis=-1, keepdims=True)
        return about - np.multiply.outer(about @ slope_of, x - x.mean())

    left = residuals(y)
    farthest = int(np.abs(left).argmax())
    sure = np.abs(left) > math.log(OFF)
    if drawn is not None:
        low, high = np.percentile(residuals(drawn), [2.5, 97.5], axis=0)
        sure &= ~((low <= 0) & (high >= 0))
    off = [round(float(v), 9) for v in np.exp(x[sure])]
    slope = float(slope_of @ y)
    return Law(
        exponent=_exponent(slope, None if drawn is None else drawn @ slope_of),
        factor=float(np.exp(y.mean() - slope * x.mean())),
        points=len(x),
        first_x=float(min(xs)),
        last_x=float(max(xs)),
        first=between(0, 1),
        last=between(len(x) - 2, len(x) - 1),
        worst=float(np.exp(left[farthest])),
        worst_x=round(float(np.exp(x[farthest])), 9),
        off=off,
        holds=None if len(x) < LEAST else not off,
    )


def text(exponent: Range) -> str:
    """`0.98 [0.97, 0.99]`; `0.98 (insufficient launches)`."""
    if exponent.low is None or exponent.high is None:
        return f"{exponent.value:.2f} (insufficient launches)"
    if exponent.low == exponent.high:
        return f"{exponent.value:.2f}"  # a count
    return f"{exponent.value:.2f} [{exponent.low:.2f},\u00a0{exponent.high:.2f}]"
