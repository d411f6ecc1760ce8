"""The pages of the hard cases, from stability.json alone: a table phase × case, and for each case its text,
its curve and what each phase does. HTML fragments for the report, or whole pages in a folder of their own.
"""

from __future__ import annotations

import math
from functools import partial
from pathlib import Path
from typing import Any

from study.core import html, store
from study.experiments.stability.cases import curves
from study.experiments.stability.schema import Stability
from study.pictures import embed
from study.pictures.processes import in_processes

TEXTS = (
    ("what", "What it is"),
    ("why", "Why it is hard"),
    ("source", "Who described it"),
    ("known", "The answer is known from"),
)
INTRO = (
    "Generated scenes whose answer is known, each with a parameter that makes it harder. A cell is the first "
    "strength at which the phase's error exceeds the case's limit; a dot says that it does at none. Some "
    "failures belong to the method (a march that stops at a hit distance, or after so many steps) and are "
    "the same in every phase; what differs between phases is their arithmetic."
)
number = curves.number


def read(path: Path) -> dict[str, Any]:
    """stability.json; StudyError with the file if it is not what scripts/stepwise stability writes."""
    return Stability.read(path)


def prose(text: str) -> str:
    """Markdown of one paragraph."""
    return html.prose(text)


def anchor(case: dict) -> str:
    return f"hard-{case['number']:02}-{case['name'].replace('_', '-')}"


def value(error: float | None, unit: str) -> str:
    """An error with its unit; None is NaN or infinite: there was no usable answer."""
    if error is None or not math.isfinite(error):
        return "no answer"
    return number(error) + (f" {unit}" if unit else "")


def said(error: float | None, unit: str) -> str:
    """The error in a sentence."""
    text = value(error, unit)
    return text if text == "no answer" else f"an error of {text}"


def state_at_failure(row: dict) -> str:
    """The state at the first strength that fails."""
    return row["states"][row["strengths"].index(row["first_failure"])]


def does(row: dict, case: dict) -> tuple[str, str]:
    """What one phase does on a case, and the case's own note on it."""
    unit = case["unit"]
    if row["refused"]:
        return f"does not render the scene: {row['notes'][0]}", ""
    if row["first_failure"] is None:
        worst = max((e for e in row["errors"] if e is not None), default=None)
        where = len(row["strengths"]) - 1
        text = f"right throughout; the largest error is {value(worst, unit)}"
    else:
        where = row["strengths"].index(row["first_failure"])
        state = row["states"][where]
        what = said(row["errors"][where], unit) if state == "wrong" else state
        text = f"fails from {number(row['first_failure'])}: {what}"
        if row["states"][-1] in ("right", "refused"):
            text += f"; at the hardest strength {row['states'][-1]} again"
    note = row["notes"][where]
    return text, f"at {number(row['strengths'][where])}: {note}" if note else ""


def doings(rows: list[dict], case: dict) -> dict[tuple[str, str], list[str]]:
    """What is done → the phases that do it."""
    found: dict[tuple[str, str], list[str]] = {}
    for row in rows:
        found.setdefault(does(row, case), []).append(row["phase"])
    return found


def rows_of(data: dict, case: dict) -> list[dict]:
    return [r for r in data["results"] if r["number"] == case["number"]]


def row_of(data: dict, case: dict, phase: dict) -> dict | None:
    return next((row for row in rows_of(data, case) if row["phase"] == phase["name"]), None)


def draw(data: dict, case: dict, folder: Path) -> Path:
    """The case's figure as FOLDER/hard-NN-name.svg (and .png beside it)."""
    names = [p["name"] for p in data["phases"]]
    return curves.draw(case, rows_of(data, case), names, folder / anchor(case))[0]


def curve(data: dict, case: dict) -> str:
    """The case's figure as the address of a small PNG: drawn here, unless `with_curves` has."""
    if "curves" in data:
        return data["curves"][anchor(case)]
    names = [p["name"] for p in data["phases"]]
    return embed.exact(curves.small(case, rows_of(data, case), names))


def with_curves(data: dict) -> dict:
    """The data with every case's figure, drawn on all CPUs."""
    made = in_processes([partial(curve, data, case) for case in data["cases"]])
    return data | {"curves": dict(zip(map(anchor, data["cases"]), made, strict=True))}


def fragment(macro: str, *about: Any) -> str:
    """What a macro of hard_cases.html.j2 makes, in one line."""
    known = {one.__name__: one for one in (number, anchor, value, prose, rows_of, row_of, doings, curve)}
    known |= {"state": state_at_failure, "texts": TEXTS}
    made = getattr(html.templates().get_template("hard_cases.html.j2", globals=known).module, macro)(*about)
    return "".join(line.strip() for line in made.splitlines()).replace("&#32;", " ")


def cell(row: dict | None) -> str:
    """A table cell: first strength that fails, with what happened if it is worse than a wrong answer."""
    return fragment("cell", row)


def table(data: dict, link: str = "#{}") -> str:
    """The table phase × case. `link`: a page's address, from its anchor."""
    return fragment("table", data, link)


def page(data: dict, case: dict) -> str:
    """The fragment of one case: text, curve, what each phase does."""
    return fragment("page", data, case)


def section(data: dict) -> str:
    """Everything as one fragment: the table, then each case, all behind their titles."""
    return fragment("section", {"skipped": []} | with_curves(data))


def write(data: dict, folder: Path) -> Path:
    """FOLDER/index.html with the table, and one page a case beside it, none of which needs another file."""
    style = (html.TEMPLATES / "style.css").read_text(encoding="utf-8")
    data = with_curves(data)
    pages = {"index": ("Hard cases", fragment("index", data, INTRO))}
    pages |= {anchor(case): (case["title"], fragment("alone", data, case)) for case in data["cases"]}
    for name, (title, body) in pages.items():
        whole = html.templates().get_template("hard_case.html.j2")
        store.write_text(folder / f"{name}.html", whole.render(title=title, style=style, body=body))
    return folder / "index.html"
