"""The tables of values at the edges (0, denormal, ∞, NaN, negative …), made from functions.json alone: only
implementations that differ from what C's Annex F and IEEE 754 ask, and only inputs at which one does.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from study.core.show import Column
from study.experiments.functions import measure
from study.experiments.functions.schema import Entry, Functions
from study.experiments.functions.tables import TITLES
from study.experiments.section import Part, part

AGREES, ASKED = "·", "asked for"
# Functions of one table: those that are asked for the same inputs.
TABLES = {
    "functions-edges": [name for name in measure.FUNCTIONS if name not in ("pow", "atan2")],
    "functions-edges-pow": ["pow"],
    "functions-edges-atan2": ["atan2"],
}


@dataclass(frozen=True)
class Line:
    """What is asked of a function, or implementations that differ from it alike. `values`: by input, the
    right ones too; `wrong`: the inputs where they differ."""

    kind: tuple[str, str]
    name: str
    values: dict[str, str]
    wrong: Sequence[str] = ()


def short(text: str) -> str:
    """A value with three digits: how wrong it is, they tell."""
    value = float(text.replace("−", "-").replace("∞", "inf"))
    return f"{value:.3g}".replace("-", "−") if math.isfinite(value) and value else text


def rows(result: Functions, names: list[str]) -> list[Line]:
    """Per function and precision what is asked, then a row for all whose values differ from it alike."""
    made = []
    for kind in ((function, precision) for function in names for precision in ("float", "double")):
        mine = [row for row in result.entries if row.edges and row.kind == kind]
        alike: dict[tuple, list[Entry]] = {}
        for row in mine:
            if not row.agrees:
                alike.setdefault(tuple((e.value, e.right) for e in row.edges), []).append(row)
        if alike:
            made.append(Line(kind, ASKED, {edge.argument: edge.exact for edge in mine[0].edges}))
        for same in alike.values():
            sets: dict[str, list[str]] = {}
            for row in same:
                sets.setdefault(row.name, []).append(row.isa)
            name = "; ".join(f"{name} ({', '.join(isas)})" for name, isas in sets.items())
            edges = same[0].edges
            values = {edge.argument: edge.value for edge in edges}
            made.append(Line(kind, name, values, [edge.argument for edge in edges if not edge.right]))
    return made


def _at(argument: str) -> Column:
    def text(row: Line) -> str:
        return short(row.values[argument]) if row.name == ASKED or argument in row.wrong else AGREES

    return Column("at", argument, text, lambda row: "bad tight" if argument in row.wrong else "")


def columns(rows: list[Line]) -> list[Column]:
    """Function and precision, implementations, and a column for each input at which any of them differs."""
    wrong = {argument for row in rows for argument in row.wrong}
    return [
        Column("", "function", lambda r: f"{TITLES[r.kind[0]]}, {r.kind[1]}"),
        Column("", "implementations", lambda r: r.name),
        *(_at(argument) for argument in (rows[0].values if rows else ()) if argument in wrong),
    ]


def parts(result: Functions) -> list[Part]:
    made = []
    for table, names in TABLES.items():
        tried = [row for row in result.entries if row.edges and row.function in names]
        caption = (
            f"At the edges, {', '.join(TITLES[name] for name in names)}: what is given where it is not what "
            f"C and IEEE 754 ask for; {AGREES} where it is. The other {sum(row.agrees for row in tried)} of "
            f"{len(tried)} entries agree throughout"
        )
        foot = (
            f"{AGREES} is the value that C's Annex F (of 1/√x: IEEE 754's rSqrt) asks for, a finite one to "
            "within 5 % or one ulp; nearer is the matter of the errors above."
        )
        lines = rows(result, names)
        made += part(table, caption, lines, columns(lines), foot)
    return made
