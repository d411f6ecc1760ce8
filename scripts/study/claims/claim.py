"""A statement of a paper."""

import csv
import math

import msgspec

from study.numbers import paper


class Claim(msgspec.Struct, frozen=True):
    """A row of results/paper/claims.csv. `quantity`: which check holds it (CHECKS). `base`: what `phase` is
    held against. `value`: stated, in `unit`; `n`: stated for pictures (or vectors) up to that size; NaN where
    none is named."""

    text: str
    quantity: str
    scene: str
    phase: str
    base: str
    unit: str
    source: str
    line: int
    quote: str
    note: str
    command: str
    value: float = math.nan
    n: float = math.nan


def read() -> list[Claim]:
    with (paper.FOLDER / "claims.csv").open(encoding="utf-8", newline="") as file:
        rows = [
            {key: text for key, text in row.items() if text or key not in ("value", "n")}
            for row in csv.DictReader(file)
        ]
    return msgspec.convert(rows, list[Claim], strict=False)


def known(value: float | None) -> float:
    """NaN for JSON's null."""
    return math.nan if value is None else value
