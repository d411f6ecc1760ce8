"""The tables of values at the edges (0, denormal, ∞, NaN, negative …), made from functions.json alone: only
implementations that differ from what C's Annex F and IEEE 754 ask, and only inputs at which one does.
"""

from __future__ import annotations

import math
from typing import Any

from study.core.show import Column
from study.experiments.functions import measure as functions
from study.experiments.functions.tables import TITLES

Row = dict[str, Any]
AGREES = "·"
# Functions of one table: those that are asked for the same inputs.
TABLES = {
    "functions-edges": [name for name in functions.FUNCTIONS if name not in ("pow", "atan2")],
    "functions-edges-pow": ["pow"],
    "functions-edges-atan2": ["atan2"],
}


def judged(result: Row) -> list[Row]:
    """Entries that were tried at the edges."""
    return [row for row in result["entries"] if row.get("edges")]


def agrees(row: Row) -> bool:
    return all(edge["right"] for edge in row["edges"])


def short(text: str) -> str:
    """A value with three digits: how wrong it is, they tell."""
    value = float(text.replace("−", "-").replace("∞", "inf"))
    return f"{value:.3g}".replace("-", "−") if math.isfinite(value) and value else text


def _asked(row: Row) -> Row:
    """The line above a function's: what is asked of it."""
    values = {edge["argument"]: edge["exact"] for edge in row["edges"]}
    about = {"function": row["function"], "precision": row["precision"], "values": values}
    return about | {"name": "asked for", "wrong": []}


def rows(result: Row, names: list[str]) -> list[Row]:
    """Per function and precision what is asked, then a row for all whose values differ from it alike.

    values: input → value, the right ones too; wrong: the inputs where they differ.
    """
    made = []
    for function in names:
        for precision in ("float", "double"):
            mine = [r for r in judged(result) if (r["function"], r["precision"]) == (function, precision)]
            alike: dict[tuple, list[Row]] = {}
            for row in mine:
                if not agrees(row):
                    alike.setdefault(tuple((e["value"], e["right"]) for e in row["edges"]), []).append(row)
            made += [_asked(mine[0])] if alike else []
            for same in alike.values():
                sets: dict[str, list[str]] = {}
                for row in same:
                    sets.setdefault(row["name"], []).append(row["isa"])
                edges = same[0]["edges"]
                made.append(
                    {
                        "function": function,
                        "precision": precision,
                        "name": "; ".join(f"{name} ({', '.join(isas)})" for name, isas in sets.items()),
                        "values": {e["argument"]: e["value"] for e in edges},
                        "wrong": [e["argument"] for e in edges if not e["right"]],
                    }
                )
    return made


def _cell(argument: str):
    def text(row: Row) -> str:
        known = row["name"] == "asked for" or argument in row["wrong"]
        return short(row["values"][argument]) if known else AGREES

    return text


def columns(rows: list[Row]) -> list[Column]:
    """Function and precision, implementations, and a column for each input at which any of them differs."""
    wrong = {argument for row in rows for argument in row["wrong"]}
    arguments = [argument for argument in (rows[0]["values"] if rows else ()) if argument in wrong]
    return [
        Column("", "function", lambda r: f"{TITLES[r['function']]}, {r['precision']}"),
        Column("", "implementations", lambda r: r["name"]),
        *(
            Column("at", a, _cell(a), lambda r, a=a: "bad tight" if a in r["wrong"] else "")
            for a in arguments
        ),
    ]


def caption(result: Row, names: list[str]) -> str:
    """What the table of these functions is, and how many are not in it."""
    tried = [row for row in judged(result) if row["function"] in names]
    good = sum(map(agrees, tried))
    return (
        f"At the edges, {', '.join(TITLES[name] for name in names)}: what is given where it is not what C "
        f"and IEEE 754 ask for; {AGREES} where it is. The other {good} of {len(tried)} entries agree "
        "throughout"
    )


def remark(result: Row) -> str | None:
    """How many agree everywhere, and what is judged."""
    tried = judged(result)
    if not tried:
        return None
    good = [row for row in tried if agrees(row)]
    sound = [
        family
        for family in dict.fromkeys(row["family"] for row in tried)
        if all(agrees(row) for row in tried if row["family"] == family)
    ]
    named = f", every one of {' and '.join(sound)} among them" if sound else ""
    return (
        f"Edges: {AGREES} is the value that C's Annex F (of 1/√x: IEEE 754's rSqrt) asks for, a finite one "
        f"to within 5 % or one ulp; nearer is the matter of the errors above. {len(good)} of {len(tried)} "
        f"entries agree with it at every input tried{named}, and are not in the table; inputs at which all "
        "agree are not either."
    )
