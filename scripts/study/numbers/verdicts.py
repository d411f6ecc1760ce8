"""The words in which a paper's statement is judged here, and the rules of judging.

results/paper/README.md says what each word means.
"""

import math
import re
from collections.abc import Iterable
from typing import NamedTuple

from study.numbers.stats import Interval

HOLDS, PART, FAILS, OPEN = "holds here", "holds in part", "does not hold here", "not measured"
NEVER, UNSURE = "cannot be tested here", "cannot be told here"
FEW, WITHIN = f"{UNSURE}: too few launches", f"{UNSURE}: the stated figure is within the interval"
WORDS = (HOLDS, PART, FAILS, UNSURE, OPEN, NEVER)
TOO_FEW = "too few launches"
NO_GAIN = 1.05  # a step that gains no more than this gains nothing worth its trouble
NEAR = 1.10  # a figure within 10 % of the stated one is taken to be it


class Found(NamedTuple):
    """What came out here, in words and as a figure in the claim's own unit with its 95 % interval (NaN:
    none). `n`: the largest size tried (picture height, or vectors), None where none plays a part."""

    here: str
    verdict: str
    why: str = ""
    value: float = math.nan
    low: float = math.nan
    high: float = math.nan
    n: int | None = None


def missing(what: str) -> Found:
    """Not measured, since this run lacks `what`."""
    return Found("", OPEN, f"this run has no {what}")


def figure(ratio: Interval, text: str, verdict: str, why: str = "", n: int | None = None) -> Found:
    """A figure with its interval; too few launches for one decide nothing."""
    if not ratio.sufficient:
        verdict, why = UNSURE, f"{ratio.launches} launches are too few for an interval"
    return Found(text, verdict, why, ratio.value, ratio.low, ratio.high, n)


def timed(found: Found) -> Found:
    """A figure of times whose interval is in it: without one, of too few launches, it decides nothing."""
    if math.isfinite(found.low) and math.isfinite(found.high):
        return found
    return found._replace(verdict=UNSURE, why="too few launches for an interval")


def reached(ratio: Interval, stated: float) -> tuple[str, str]:
    """Verdict and reason: whether all, none or a part of the interval reaches the stated figure."""
    if ratio.low >= stated:
        return HOLDS, f"all of the interval reaches {stated:g}"
    if ratio.high < stated:
        return FAILS, f"all of the interval is below {stated:g}"
    return UNSURE, f"{stated:g} is within the interval"


def judged(here: float, stated: float) -> tuple[str, str]:
    """Near the stated figure, or beyond it: holds. In part while it points the same way from 1."""
    if here >= stated / NEAR:
        return HOLDS, f"within 10 % of {stated:g}, or beyond it"
    if here > 1 and stated > 1:
        return PART, f"the same way, and less than {stated:g}"
    return FAILS, f"no gain, where {stated:g} is stated"


def near(here: float, stated: float) -> tuple[str, str]:
    """Judges figures that should be met and not beaten; NaN fails."""
    if stated / NEAR <= here <= stated * NEAR:
        return HOLDS, f"within 10 % of {stated:g}"
    return FAILS, f"more than 10 % off {stated:g}"


def sized(found: Found, stated: float, every: str = "", unit: str = "n = ") -> Found:
    """What was not tried up to the size that a statement is about holds in part at most, and says so.
    `stated`: that size, NaN where a statement names none. `every`: the sizes that were tried, in words."""
    if found.verdict not in (HOLDS, PART, FAILS, UNSURE) or math.isnan(stated):
        return found
    if found.n is not None and found.n >= stated:
        return found
    tried = every or ("at a size that is not known" if found.n is None else f"at {unit}{found.n:,}")
    why = f"{found.why}; " if found.why else ""
    verdict = PART if found.verdict == HOLDS else found.verdict
    return found._replace(verdict=verdict, why=f"{why}tried {tried}, stated for up to {unit}{stated:,.0f}")


def stated(claim: str) -> float | None:
    match = re.match(r"(\d+(?:\.\d+)?)×", claim)
    return float(match[1]) if match else None


def held(claim: str, gain: Interval, failed: Iterable[str]) -> tuple[str, str]:
    """Verdict ("" for no claim) and reason. `claim`: a patch's `paper` line."""
    value = stated(claim)
    if value is None and not claim.startswith(("no gain", "not satisfying")):
        return "", ""
    if not gain.sufficient:
        return UNSURE, f"{gain.launches} launches are too few for an interval"
    if value is not None:
        return reached(gain, value)
    if claim.startswith("not satisfying") and list(failed):  # what the paper gave up: too wrong, or no faster
        return HOLDS, "too wrong a picture"
    if gain.high <= NO_GAIN:
        return HOLDS, f"no gain: all of the interval is below {NO_GAIN:g}"
    if gain.low > NO_GAIN:
        return FAILS, f"a gain: all of the interval is above {NO_GAIN:g}"
    return UNSURE, f"{NO_GAIN:g}, from where on it is a gain, is within the interval"
