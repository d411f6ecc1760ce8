"""The hard cases as a fragment of the report's page, from stability.json alone: a table phase × case, and for
each case its text, its curve and what each phase does."""

from functools import partial
from typing import Any

from study.core import html
from study.experiments.stability.cases import curves
from study.experiments.stability.schema import Case, Row, Stability
from study.pictures import embed
from study.pictures.processes import in_processes

TEXTS = (
    ("what", "What it is"),
    ("why", "Why it is hard"),
    ("source", "Who described it"),
    ("known", "The answer is known from"),
)
number = curves.number


def anchor(case: Case) -> str:
    return f"hard-{case.number:02}-{case.name.replace('_', '-')}"


def value(error: float | None, unit: str) -> str:
    """An error with its unit; None: there was no usable answer."""
    if error is None:
        return "no answer"
    return number(error) + (f" {unit}" if unit else "")


def does(row: Row, case: Case) -> tuple[str, str]:
    """What one phase does on a case, and the case's own note on it."""
    if row.refused:
        return f"does not render the scene: {row.notes[0]}", ""
    if row.first_failure is None:
        worst = max((e for e in row.errors if e is not None), default=None)
        where = len(row.strengths) - 1
        text = f"right throughout; the largest error is {value(worst, case.unit)}"
    else:
        where = row.place
        state, error = row.states[where], row.errors[where]
        what = value(error, case.unit) if state == "wrong" else state
        text = f"fails from {number(row.first_failure)}: {'an error of ' * (what[0].isdigit())}{what}"
        if row.states[-1] in ("right", "refused"):
            text += f"; at the hardest strength {row.states[-1]} again"
    note = row.notes[where]
    return text, f"at {number(row.strengths[where])}: {note}" if note else ""


def doings(rows: list[Row], case: Case) -> dict[tuple[str, str], list[str]]:
    """What is done → the phases that do it."""
    found: dict[tuple[str, str], list[str]] = {}
    for row in rows:
        found.setdefault(does(row, case), []).append(row.phase)
    return found


def row_of(data: Stability, case: Case, phase: str) -> Row | None:
    return next((row for row in data.rows_of(case) if row.phase == phase), None)


def fragment(macro: str, *about: Any) -> str:
    """What a macro of hard_cases.html.j2 makes, in one line."""
    known: dict[str, Any] = {one.__name__: one for one in (number, anchor, value, row_of, doings)}
    known |= {"texts": TEXTS, "prose": html.prose}
    made = getattr(html.templates().get_template("hard_cases.html.j2", globals=known).module, macro)(*about)
    return "".join(line.strip() for line in made.splitlines()).replace("&#32;", " ")


def section(data: Stability) -> str:
    """Everything as one fragment: the table, then each case behind its title. Curves use all CPUs."""
    names = [phase.name for phase in data.phases]
    made = in_processes([partial(curves.small, case, data.rows_of(case), names) for case in data.cases])
    pictures = {anchor(case): embed.figure(png) for case, png in zip(data.cases, made, strict=True)}
    return fragment("section", data, pictures)
