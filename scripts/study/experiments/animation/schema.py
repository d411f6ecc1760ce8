"""animation.json."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from study.core.schema import Record, key
from study.numbers.schema import Result


class Row(Record, kw_only=True):
    """One frame."""

    scene: Annotated[str, key("", "its name")]
    phase: Annotated[str, key("", "that drew it")]
    frame: Annotated[int, key("", "its number, from 0", ge=0)]
    seconds: Annotated[float, key("s", "its time in the scene", ge=0)]
    width: Annotated[int, key("pixels", "of the picture", ge=1)]
    height: Annotated[int, key("pixels", "of the picture", ge=1)]
    sha256: Annotated[str, key("", "of the picture's floats")]
    picture: Annotated[str, key("", "a PNG file in the run, as displayed")]


class Animation(Result, kw_only=True):
    """The frames of animated scenes."""

    made_by: ClassVar[str] = "animation"
    schema: Annotated[Literal[1], key("", "version of the form")]
    rows: Annotated[list[Row], key("", "frames", min_length=1)]


FILE = "animation.json"
SCHEMAS = {FILE: Animation}
