"""truth.json."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from study.core.schema import Record, key
from study.numbers.schema import Result


class Row(Record, kw_only=True):
    """The exact picture of a scene. Pixels are counted by their camera ray."""

    scene: Annotated[str, key("", "its name")]
    width: Annotated[int, key("pixels", "of the picture", ge=1)]
    height: Annotated[int, key("pixels", "of the picture", ge=1)]
    proved: Annotated[int, key("pixels", "whose hit or miss is proved")]
    undecided: Annotated[int, key("pixels", "neither")]
    converged_only: Annotated[int, key("pixels", "of a fractal: marched, not proved")]
    surface_proved: Annotated[int, key("pixels", "of a Mandelbulb's exact surface: proved")] = 0
    widest: Annotated[float, key("scene units", "widest enclosure of a distance", ge=0)]
    chain_proved: Annotated[int, key("pixels", "whose mirror rays are proved too")]
    sha256: Annotated[str, key("", "of the picture's values")]
    picture: Annotated[str, key("", "the EXR file, named as in build/truth/cache")]


class Truth(Result, kw_only=True):
    """The exact pictures that phases are judged by, and how sure each is."""

    made_by: ClassVar[str] = "truth"
    schema: Annotated[Literal[1], key("", "version of the form")]
    rows: Annotated[list[Row], key("", "scenes", min_length=1)]


FILE = "truth.json"
SCHEMAS = {FILE: Truth}
