"""rods.json."""

from __future__ import annotations

from typing import Annotated, ClassVar

from study.core.schema import Record, key
from study.measuring.schema import Gain, Timed, TimedErrors, Times, TimesHigh, TimesLow
from study.numbers.schema import Measured


class Article(Record, kw_only=True):
    """What the article says."""

    size: Annotated[int, key("pixels", "of its picture, each way")]
    max_steps: Annotated[int, key("evaluations", "its step cap")]
    down: Annotated[int, key("rods", "from top to bottom at the start")]
    pixels_ms: Annotated[float, key("ms", "a ray per pixel")]
    rods_ms: Annotated[float, key("ms", "by rods: under")]
    evaluations: Annotated[float, key("×", "fewer by rods")]
    cpu: Annotated[str, key("", "its CPU")]


class Way(TimedErrors, kw_only=True):
    """One way to march, with the errors of its shaded picture. Times are of the march alone."""


class Row(Gain, kw_only=True):
    """A scene by both ways to march of phase rods."""

    scene: Annotated[str, key("", "its name")]
    width: Annotated[int, key("pixels", "of the picture", ge=1)]
    n: Annotated[int, key("pixels", "its height", ge=1)]
    pixels: Annotated[Way, key("", "a ray per pixel")]
    rods: Annotated[Way, key("", "by rods; a rod's evaluations count once")]
    fewer: Annotated[float, key("×", "evaluations per pixel over those by rods")]


class Trade(Way, kw_only=True):
    """One setting of rods on the article's scene. `gain` is over the march per pixel, `trade_pixels`."""

    gain: Times = None
    gain_low: TimesLow = None
    gain_high: TimesHigh = None
    down: Annotated[int, key("rods", "starting rods from top to bottom")]
    max_steps: Annotated[int, key("evaluations", "step cap")]
    least: Annotated[int, key("pixels", "on a side of the smallest rod")]
    step: Annotated[str, key("", "`whole`: the distance; `safe`: less the radius")]


class Rods(Measured, kw_only=True):
    """Rod marching against per-pixel marching."""

    made_by: ClassVar[str] = "rods"
    article: Annotated[Article, key("", "what the article says")]
    own: Annotated[Row, key("", "the article's scene at its size")]
    rows: Annotated[list[Row], key("", "every scene", min_length=1)]
    trade: Annotated[list[Trade], key("", "rods × step cap")]
    trade_pixels: Annotated[Timed, key("ms", "per pixel by the scene's own cap, same run")]


FILE = "rods.json"
SCHEMAS = {FILE: Rods}
