"""fixed.json."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar

from study.core.schema import ABSENT, Absent, key
from study.experiments.moving.schema import Animation, with_means
from study.numbers.schema import Measured, TimedErrors, Times, TimesHigh, TimesLow


class Picture(TimedErrors, kw_only=True):
    """Times of a picture of spheres40 on one thread, and its errors to truth."""

    cleared: Annotated[float | Absent | None, key("share of pixels", "in cleared blocks")] = ABSENT
    wrongly_cleared_ppm: Annotated[float | Absent | None, key("ppm", "of those: truth sees a sphere")] = (
        ABSENT
    )


class Row(Picture, kw_only=True):
    """One case of lanes, integers or floats, all in one interleaved run. `gain`: of the first case."""

    case: Annotated[str, key("", "lanes; integers or floats")]
    phase: Annotated[str, key("", "its name")]
    settings: Annotated[str | Absent, key("", "in the words of STEPWISE_FIXED")] = ABSENT
    width: Annotated[int | Absent, key("pixels", "of the picture")] = ABSENT
    n: Annotated[int | Absent, key("pixels", "its height")] = ABSENT
    gain: Times = ABSENT
    gain_low: TimesLow = ABSENT
    gain_high: TimesHigh = ABSENT
    over_float: Annotated[float | Absent | None, key("×", "floats in the most lanes over this one")] = ABSENT
    over_float_low: Annotated[float | Absent | None, key("×", "lower end")] = ABSENT
    over_float_high: Annotated[float | Absent | None, key("×", "upper end")] = ABSENT
    over_like_float: Annotated[float | Absent | None, key("×", "floats in as many lanes over this one")] = (
        ABSENT
    )
    over_like_float_low: Annotated[float | Absent | None, key("×", "lower end")] = ABSENT
    over_like_float_high: Annotated[float | Absent | None, key("×", "upper end")] = ABSENT


class Fraction(Picture, kw_only=True):
    """Bits of fraction and a kind of roots, in the least unit that fits."""

    bits: Annotated[int, key("bits", "of fraction")]
    roots: Annotated[str, key("", "the article's, or so many Newton steps")]
    settings: Annotated[str | Absent, key("", "in the words of STEPWISE_FIXED")] = ABSENT
    refused: Annotated[str | Absent, key("", "what does not fit; then there is nothing else")] = ABSENT


class Clearing(Picture, kw_only=True):
    """A way to clear blocks, at a size."""

    clear: Annotated[str, key("", "never, by corners or by lists")]
    width: Annotated[int | Absent, key("pixels", "of the picture")] = ABSENT
    n: Annotated[int | Absent, key("pixels", "its height")] = ABSENT
    against: Annotated[
        str | Absent, key("", "of heights over 400 `never`: errors are to the picture without clearing")
    ] = ABSENT
    lost_pixels: Annotated[int | Absent, key("pixels", "that it sees and this one does not")] = ABSENT


class Moving(Animation, kw_only=True):
    """An animation by one program."""

    program: Annotated[str, key("", "`article` (its roots and corners), `lanes` or `floats`")]
    shadows: Annotated[bool, key("", "the article has none")]


class Fixed(Measured, kw_only=True):
    """Rays in integers against floats: lanes, bits of fraction, cleared blocks, an animation."""

    made_by: ClassVar[str] = "fixed"
    article: Annotated[dict[str, Any], key("", "what the article says")]
    rows: Annotated[list[Row], key("", "integers and floats by lanes", min_length=1)]
    sweep: Annotated[list[Fraction], key("", "bits of fraction")]
    clearing: Annotated[list[Clearing], key("", "cleared blocks")]
    animation: Annotated[list[Moving] | Absent, key("", "spheres40_animated")] = ABSENT

    @classmethod
    def current(cls, data: Any) -> Any:
        return with_means(data)


SCHEMAS = {"fixed.json": Fixed}
