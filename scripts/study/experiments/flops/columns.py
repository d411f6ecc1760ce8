"""Columns of what was counted: Table 1, its terms, declared against measured."""

import math
from collections.abc import Callable
from typing import Any

import pandas as pd

from study.core.show import NOTHING, Column, cell, number, percent, picture, plain, word
from study.counting.schema import Measurement, Row


def _phase(row: Any) -> str:
    """Its name; where it generates code for scenes, that its general code was counted in its place."""
    return row.phase + (" (general code)" if cell(row, "kernel") else "")


def _difference(name: str, digits: int = 3) -> Callable[[Any], str]:
    return lambda row: NOTHING if pd.isna(value := cell(row, name)) else f"{100 * value:+.{digits}f}\u00a0%"


def _residue(row: Row) -> str:
    """FLOPs that the compiler is known to add, as shares of what was measured."""
    low, high = (100 * flop / (row.measured or math.nan) for flop in (row.residue_low, row.residue_high))
    if not (low or high):
        return NOTHING
    return f"{low:+.2f}\u00a0%" if low == high else f"{low:+.2f} … {high:+.2f}\u00a0%"


def _within(row: Row) -> str:
    """A residue that is only known as a range proves no more than its width; one that agrees needs none."""
    if not row.judged:
        return "not judged: libm's inside is in it" if row.scope == "total" else "not judged: small"
    if not row.within:
        return "✗ OUTSIDE 1\u00a0%"
    off = math.nan if row.relative_difference is None else abs(row.relative_difference)
    if row.explained_to and row.explained_to > 0.01 and not off <= 0.01:
        return f"✓ explained to within {100 * row.explained_to:.1f}\u00a0%"
    return "✓ within 1\u00a0%"


def _backend(row: Row | Measurement) -> str:
    state = {True: "", False: " (not calibrated here)", None: " (not yet validated)"}
    return f"{row.backend}{state[row.calibrated]}"


def _giga(value: Callable[[Measurement], int]) -> Callable[[Measurement], str]:
    return lambda row: number(value(row) / 1e9, 4)


SIZE = Column("", "size", lambda r: f"{r.width}×{r.height}")
# FLOPs: all lanes are counted; the useful share is that of the active ones.
TABLE1 = [
    Column("", "scene", word("scene")),
    Column("", "phase", _phase),
    SIZE,
    Column("GFLOP of a picture", "by the paper's rule", plain("paper_rule_gflop", 4)),
    Column("GFLOP of a picture", "the paper's own", plain("paper_gflop", 4)),
    Column("GFLOP of a picture", "difference", _difference("difference", 1)),
    Column("GFLOP of a picture", "iterations as entered", plain("paper_convention_gflop", 4)),
    Column("GFLOP of a picture", "machine's convention", plain("machine_convention_gflop", 4)),
    Column("GFLOP of a picture", "measured, machine's convention", plain("measured_gflop", 4)),
    Column("saved of baseline's", "by the paper's rule", lambda r: percent(r.rule_cut)),
    Column("saved of baseline's", "the paper's own", lambda r: percent(r.paper_cut)),
    Column("saved of baseline's", "of useful lanes, as entered", lambda r: percent(r.cut)),
    Column("saved of baseline's", "measured, machine's convention", lambda r: percent(r.measured_cut)),
    Column("", "lanes at useful work", lambda r: percent(r.useful_share)),
    Column("", "useful FLOP/evaluation, as entered", plain("flop_per_evaluation", 4)),
    Column("", "10⁶ evaluations", plain("evaluations_million", 4)),
    Column("", "10⁹ comparisons of the source (not in the FLOPs)", plain("compare_gop", 3)),
]


TERMS = [
    Column("", "scene", picture),
    Column("", "phase", _phase),
    Column("", "term", word("term")),
    Column("", "GFLOP, paper's convention", plain("gflop", 4)),
    Column("", "share", lambda r: percent(r.share)),
    Column("", "FLOP/evaluation", plain("flop_per_evaluation", 4)),
]


MEASURED = [
    Column("", "scene", word("scene")),
    Column("", "phase", _phase),
    SIZE,
    Column("", "by", _backend),
    Column("measured, shipped build", "GFLOP, machine's convention", _giga(lambda r: r.total.machine)),
    Column("measured, shipped build", "10⁹ instructions", _giga(lambda r: r.total.instructions)),
    Column("measured, shipped build", "GB loaded", _giga(lambda r: r.total.load_bytes)),
    Column("measured, shipped build", "GB stored", _giga(lambda r: r.total.store_bytes)),
]


VALIDATION = [
    Column("", "scene", picture),
    Column("", "phase", _phase),
    Column("", "build", lambda r: "shipped" if r.variant == "shipped" else "without inlining"),
    Column("", "what", word("scope")),
    Column("FLOP, machine's convention", "declared × counted", lambda r: f"{r.counted:,}"),
    Column("FLOP, machine's convention", "measured", lambda r: f"{r.measured:,}"),
    Column("", "by", _backend),
    Column("", "difference", _difference("relative_difference")),
    Column("", "the compiler's doing, known", _residue),
    Column("", "left", _difference("unexplained")),
    Column("", "verdict", _within, lambda row: "" if not row.judged else "good" if row.within else "bad"),
]
