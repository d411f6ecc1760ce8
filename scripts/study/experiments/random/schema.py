"""random.json."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from study.core.schema import Record, key
from study.numbers.schema import Result


class Row(Record, kw_only=True):
    """What one kind of input found with one seed."""

    kind: Annotated[
        str, key("", "of the input: any, extreme or benign scenes, groups, or a harness of tests/fuzz")
    ]
    seed: Annotated[int, key("", "of what is drawn", ge=1)]
    tried: Annotated[int, key("inputs", "that were to be drawn", ge=1)]
    found: Annotated[str | None, key("", "what broke, in a line; null: nothing")]
    input: Annotated[str | None, key("", "the input that broke it: a scene, or bytes in base64")]


class Random(Result, kw_only=True):
    """Random scenes through every phase, and random bytes through every reader, by seed."""

    made_by: ClassVar[str] = "random"
    schema: Annotated[Literal[1], key("", "version of the form")]
    rows: Annotated[list[Row], key("", "kinds and seeds", min_length=1)]


SCHEMAS = {"random.json": Random}
