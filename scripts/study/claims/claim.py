"""A statement of a paper: a row of results/paper/claims.csv."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import pandas as pd

from study.numbers import paper


@dataclass(frozen=True)
class Claim:
    """`quantity`: which check holds it (CHECKS). `base`: what `phase` is held against. `value`: stated, in
    `unit`; `n`: stated for pictures (or vectors) up to that size; NaN where none is named."""

    text: str
    quantity: str
    scene: str
    phase: str
    base: str
    value: float
    unit: str
    n: float
    source: str
    line: int
    quote: str
    note: str
    command: str


def _known(name: str, value: Any) -> Any:
    if name in ("value", "n"):
        return math.nan if pd.isna(value) else float(value)
    return "" if pd.isna(value) else value


def read() -> list[Claim]:
    rows = paper.read("claims").astype(object).to_dict("records")
    return [Claim(**{name: _known(str(name), value) for name, value in row.items()}) for row in rows]
