"""A goal: what was asked, beside what a run has of it, judged by the whole interval.

Each experiment with goals has them in goals.py; "best" is the ladder's last rung, unless another is better by
intervals that do not overlap.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

from study.core import registry, show
from study.numbers import verdicts
from study.numbers.stats import Interval

DIGITS = 0.05  # dB: what is shown equal is taken to be equal
Row = dict[str, Any]


class Goal(NamedTuple):
    """`asked` in the figure's unit; `found` with the same; `what` is the phase, `beside` its error."""

    name: str
    asked: float
    found: Interval
    verdict: str
    what: str = ""
    unit: str = "×"
    beside: str = ""
    at_most: bool = False
    narrow: bool = False  # half of `asked` was asked, see NOTE
    of_phase: str = ""  # `asked` is what this phase has in the same run
    scenes: int = 0  # drawn at random, that it is a mean over
    ours: bool = False  # the interval is of our side alone: the value decides
    unchecked: bool = False  # over a baseline that was not held beside the paper's own program


def interval(row: Row, name: str, launches: str = "launches") -> Interval:
    ends = [math.nan if row.get(key) is None else row[key] for key in (name, f"{name}_low", f"{name}_high")]
    return Interval(*ends, launches=row.get(launches) or 0, sufficient=all(map(math.isfinite, ends)))


def given(found: Row) -> Interval:
    """Of a file, where NaN is null."""
    return Interval(**{key: math.nan if value is None else value for key, value in found.items()})


def exact(value: float) -> Interval:
    return Interval(value, value, value, 1, True)


def best(rows: Sequence[Row], name: str, value: Callable[[Row], Interval], least: bool = False) -> Row:
    """The last rung's row (`name`: the phase's key); another's only where it is better and told apart."""
    order = list(registry.ladder())
    last = max(rows, key=lambda r: order.index(r[name]) if r[name] in order else -1)
    held = value(last)
    if least:
        return min((r for r in rows if r is last or value(r).high < held.low), key=lambda r: value(r).value)
    return max((r for r in rows if r is last or value(r).low > held.high), key=lambda r: value(r).value)


def worst_rung(scene: str, base: str, name: str, values: dict[str, float]) -> Iterable[Goal]:
    """Of phase → dB, or ppm of the pixels: the worst of the rungs against `base`; of equals the last.

    A phase that draws the ideal shadow is not held to a picture with an estimate of it.
    """
    ppm = name.endswith("ppm")
    known, estimate = registry.ladder(), not ppm and "ideal" not in name
    rungs = [p for p in asked_with(base)[1:] if not (estimate and known[p].draws_ideal)]
    mine = {p: values[p] for p in reversed(rungs) if p in values}
    if not mine or math.isnan(values.get(base, math.nan)):
        return
    limit = values[base]
    worst = max(mine, key=lambda p: (math.isnan(mine[p]), mine[p] if ppm else -mine[p]))
    good = mine[worst] <= limit if ppm else mine[worst] >= limit - DIGITS
    unit = "" if ppm else " dB"
    yield Goal(
        f"{scene}, {name}: no rung beyond opt4 behind {base}" + ("" if ppm else f", to {DIGITS:g} dB"),
        limit, exact(mine[worst]), verdicts.MET if good else verdicts.MISSED, worst, unit,
        _apart(mine[worst], limit) or f"{base} {show.number(limit)}{unit}", at_most=ppm, of_phase=base,
    )  # fmt: skip


def asked_with(base: str) -> list[str]:
    """The rungs beyond opt4, and what they are held against."""
    phases = list(registry.ladder())
    return [base, *phases[phases.index("opt4") + 1 :]]


def other_depth(row: Row) -> float:
    """In ppm, from the share of pixels that agree in depth (images.DEPTH_AGREES); NaN: not known."""
    share = row.get("depth_agree_fraction")
    return math.nan if share is None else 1e6 * (1 - share)


def _apart(value: float, limit: float) -> str:
    """Of a value below its limit that three digits show equal: a digit more than tells them apart."""
    if not value < limit or show.number(value) != show.number(limit):
        return ""
    digits = next((n for n in range(1, 12) if f"{value:.{n}f}" != f"{limit:.{n}f}"), 12) + 1
    return f"{value:.{digits}f} of {limit:.{digits}f}"
