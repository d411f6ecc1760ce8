"""fixed.json."""

from __future__ import annotations

from typing import Annotated, ClassVar

from study.core.schema import key
from study.measuring.schema import Animation, Article, TimedErrors, Times, TimesHigh, TimesLow
from study.numbers.schema import Measured


class Picture(TimedErrors, kw_only=True):
    """Times of a picture of spheres40 on one thread, and its errors to truth."""

    cleared: Annotated[float | None, key("share of pixels", "in cleared blocks")] = None
    wrongly_cleared_ppm: Annotated[float | None, key("ppm", "of those: truth sees a sphere")] = None


class Row(Picture, kw_only=True):
    """One case of lanes, integers or floats, all in one interleaved run. `gain`: of the first case. A case
    that others are compared with has no ratio to itself."""

    case: Annotated[str, key("", "lanes; integers or floats")]
    phase: Annotated[str, key("", "its name")]
    settings: Annotated[str, key("", "in the words of STEPWISE_FIXED")]
    width: Annotated[int, key("pixels", "of the picture")]
    n: Annotated[int, key("pixels", "its height")]
    gain: Times = None
    gain_low: TimesLow = None
    gain_high: TimesHigh = None
    over_float: Annotated[float | None, key("×", "floats in the most lanes over this one")] = None
    over_float_low: Annotated[float | None, key("×", "lower end")] = None
    over_float_high: Annotated[float | None, key("×", "upper end")] = None
    over_like_float: Annotated[float | None, key("×", "floats in as many lanes over this one")] = None
    over_like_float_low: Annotated[float | None, key("×", "lower end")] = None
    over_like_float_high: Annotated[float | None, key("×", "upper end")] = None


class Fraction(Picture, kw_only=True):
    """Bits of fraction and a kind of roots, in the least unit that fits."""

    bits: Annotated[int, key("bits", "of fraction")]
    roots: Annotated[str, key("", "the article's, or so many Newton steps")]
    settings: Annotated[str, key("", "in the words of STEPWISE_FIXED")]
    refused: Annotated[str | None, key("", "what does not fit; then there is nothing else")] = None


class Clearing(Picture, kw_only=True):
    """A way to clear blocks, at a size."""

    clear: Annotated[str, key("", "never, by corners or by lists")]
    width: Annotated[int, key("pixels", "of the picture")]
    n: Annotated[int, key("pixels", "its height")]
    against: Annotated[str | None, key("", "of earlier runs, over height 400: `never`, not truth")] = None


class Moving(Animation, kw_only=True):
    """An animation by one program."""

    program: Annotated[str, key("", "`article` (its roots and corners), `lanes` or `floats`")]
    shadows: Annotated[bool, key("", "the article has none")]


class Fixed(Measured, kw_only=True):
    """Rays in integers against floats: lanes, bits of fraction, cleared blocks, an animation."""

    made_by: ClassVar[str] = "fixed"
    article: Annotated[Article, key("", "what the article says")]
    rows: Annotated[list[Row], key("", "integers and floats by lanes", min_length=1)]
    sweep: Annotated[list[Fraction], key("", "bits of fraction")]
    clearing: Annotated[list[Clearing], key("", "cleared blocks")]
    animation: Annotated[list[Moving], key("", "spheres40_animated")]


FILE = "fixed.json"
SCHEMAS = {FILE: Fixed}
