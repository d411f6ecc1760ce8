"""The pages of the hard cases, from stability.json alone: a table phase × case, and for each case its text,
its curve and what each phase does. HTML fragments for the report, or whole pages in a folder of their own.
"""

from __future__ import annotations

import math
from functools import partial
from html import escape
from pathlib import Path
from typing import Any

import markdown_it

from study.core import store
from study.core.cli import StudyError
from study.core.registry import ROOT
from study.experiments.stability.cases import curves
from study.pictures import embed
from study.pictures.processes import in_processes

CASE_KEYS = {"number", "name", "title", "what", "why", "source", "known", "strength", "strengths", "metric",
             "unit", "fails_above", "limit", "own"}  # fmt: skip
ROW_KEYS = {"number", "phase", "strengths", "errors", "states", "notes", "first_failure", "refused"}
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


def _whole(data: dict[str, Any]) -> bool:
    """Whether every phase has a row for every case, and every row a value for every strength of its case."""
    strengths = {case["number"]: case["strengths"] for case in data["cases"]}
    rows = sorted((row["number"], row["phase"]) for row in data["results"])
    return (
        bool(rows)
        and rows == sorted((number, phase["name"]) for number in strengths for phase in data["phases"])
        and all(row["strengths"] == strengths[row["number"]] for row in data["results"])
        and all(
            len(row[key]) == len(row["strengths"])
            for row in data["results"]
            for key in ("errors", "states", "notes")
        )
    )


def read(path: Path) -> dict[str, Any]:
    """stability.json; StudyError with the file if it is not what scripts/stepwise stability writes."""
    data = store.read_json(path)
    try:
        sound = data["schema"] == 1 and all(c.keys() >= CASE_KEYS for c in data["cases"])
        sound = sound and all(r.keys() >= ROW_KEYS for r in data["results"]) and _whole(data)
    except (KeyError, TypeError, AttributeError):
        sound = False
    if not sound:
        raise StudyError(f"{path}: not what scripts/stepwise stability writes; make it again with it")
    return data


def prose(text: str) -> str:
    """Markdown of one paragraph; HTML in it is shown, not obeyed."""
    return markdown_it.MarkdownIt("commonmark", {"html": False}).disable("image").renderInline(text)


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


def cell(row: dict | None) -> str:
    """A table cell: first strength that fails, with what happened if it is worse than a wrong answer."""
    if row is None:
        return '<td class="small">not run</td>'
    if row["refused"]:
        return '<td class="small">refuses</td>'
    if row["first_failure"] is None:
        return '<td class="good">·</td>'
    state = state_at_failure(row)
    worse = f" <strong>{escape(state)}</strong>" if state != "wrong" else ""
    return f'<td class="bad" style="min-width: 0">{number(row["first_failure"])}{worse}</td>'


def table(data: dict, link: str = "#{}") -> str:
    """The table phase × case. `link`: a page's address, from its anchor."""
    names = [p["name"] for p in data["phases"]]
    found = {(r["number"], r["phase"]): r for r in data["results"]}
    heads = "".join(f'<th scope="col">{escape(name)}</th>' for name in names)
    lines = []
    for case in data["cases"]:
        ends = f"{number(case['strengths'][0])} … {number(case['strengths'][-1])}"
        title = f"{case['number']}. {escape(case['title'])}" + (" (our own)" if case["own"] else "")
        lines.append(
            '<tr><th scope="row" style="white-space: normal">'
            f'<a href="{link.format(anchor(case))}">{title}</a></th>'
            + "".join(cell(found.get((case["number"], name))) for name in names)
            + f'<td class="prose" style="text-align: left">{escape(case["strength"])}: {ends}</td></tr>'
        )
    return (
        '<div class="scroll"><table>'
        "<caption>First strength at which a phase fails; · at none that was run</caption><thead>"
        f'<tr><th scope="col">case</th>{heads}'
        '<th scope="col" style="text-align: left">strength, easy … hard</th>'
        f"</tr></thead><tbody>{''.join(lines)}</tbody></table></div>"
    )


def sentence(row: dict, case: dict) -> str:
    """What one phase does on a case, with the case's own note."""
    unit = case["unit"]
    if row["refused"]:
        return f"does not render the scene: {escape(row['notes'][0])}"
    if row["first_failure"] is None:
        worst = max((e for e in row["errors"] if e is not None), default=None)
        where = len(row["strengths"]) - 1
        text = f"right throughout; the largest error is {value(worst, unit)}"
    else:
        where = row["strengths"].index(row["first_failure"])
        state = row["states"][where]
        what = said(row["errors"][where], unit) if state == "wrong" else escape(state)
        text = f"fails from {number(row['first_failure'])}: {what}"
        if row["states"][-1] in ("right", "refused"):
            text += f"; at the hardest strength {escape(row['states'][-1])} again"
    note = row["notes"][where]
    return text + (
        f" <span class=small>(at {number(row['strengths'][where])}: {escape(note)})</span>" if note else ""
    )


def rows_of(data: dict, case: dict) -> list[dict]:
    return [r for r in data["results"] if r["number"] == case["number"]]


def errors_table(case: dict, rows: list[dict]) -> str:
    """Every error, strength by strength."""
    heads = "".join(f'<th scope="col">{escape(r["phase"])}</th>' for r in rows)
    lines = []
    for i, strength in enumerate(case["strengths"]):
        cells = []
        for r in rows:
            state = r["states"][i]
            text = state if state not in ("right", "wrong") else value(r["errors"][i], "")
            cells.append(
                f"<td{' class=bad' if state not in ('right', 'refused') else ''}>{escape(text)}</td>"
            )
        lines.append(f'<tr><th scope="row">{number(strength)}</th>{"".join(cells)}</tr>')
    unit = f", {case['unit']}" if case["unit"] else ""
    return (
        '<details><summary>All errors</summary><div class="scroll"><table>'
        f"<caption>{escape(case['metric'])}{unit}; red: outside the limit</caption>"
        f'<thead><tr><th scope="col">{escape(case["strength"])}</th>{heads}</tr>'
        f"</thead><tbody>{''.join(lines)}</tbody></table></div></details>"
    )


def draw(data: dict, case: dict, folder: Path) -> Path:
    """The case's figure as FOLDER/hard-NN-name.svg (and .png beside it)."""
    names = [p["name"] for p in data["phases"]]
    return curves.draw(case, rows_of(data, case), names, folder / anchor(case))[0]


def curve(data: dict, case: dict) -> str:
    """The case's figure inside the page: a small PNG."""
    names = [p["name"] for p in data["phases"]]
    uri = embed.exact(curves.small(case, rows_of(data, case), names))
    about = f"{case['metric']} against {case['strength']}, one line per phase, the limit dashed"
    return (
        f'<figure><img src="{uri}" alt="{escape(about)}"><figcaption>{escape(about)}.</figcaption></figure>'
    )


def page(data: dict, case: dict) -> str:
    """The fragment of one case: text, curve, what each phase does."""
    rows = rows_of(data, case)
    parts = [f'<article id="{anchor(case)}"><h3>{case["number"]}. {escape(case["title"])}</h3><dl>']
    parts += [f"<dt>{head}</dt><dd>{prose(case[key])}</dd>" for key, head in TEXTS]
    most = value(case["fails_above"], case["unit"]) if case["fails_above"] else "0"
    limit = f"{escape(case['metric'])}; more than {most} fails. "
    doing: dict[str, list[str]] = {}
    for r in rows:
        doing.setdefault(sentence(r, case), []).append(escape(r["phase"]))
    parts.append(f"<dt>What is measured</dt><dd>{limit}{prose(case['limit'])}</dd></dl>")
    parts.append(curve(data, case))
    doings = "".join(f"<li><strong>{', '.join(who)}:</strong> {text}</li>" for text, who in doing.items())
    parts.append(f"<h4>What each phase does</h4><ul>{doings}</ul>{errors_table(case, rows)}</article>")
    return "".join(parts)


def section(data: dict) -> str:
    """Everything as one fragment: the table, then each case, all behind their titles."""
    pages = in_processes([partial(page, data, case) for case in data["cases"]])
    shown = "".join(
        f"<details><summary>{c['number']}. {escape(c['title'])}</summary>{made}</details>"
        for c, made in zip(data["cases"], pages, strict=True)
    )
    skipped = "".join(
        f'<p class="notice">{escape(s["phase"])} did not run: {escape(s["reason"])}</p>'
        for s in data.get("skipped", [])
    )
    heads = (
        "All cases: the first strength at which a phase fails",
        "Each case: what it is, why it is hard, what each phase does",
    )
    folded = "".join(
        f"<details><summary>{head}</summary>{body}</details>"
        for head, body in zip(heads, (table(data), shown), strict=True)
    )
    return skipped + folded


def whole(title: str, body: str) -> str:
    """A page that needs no other file."""
    style = (ROOT / "report" / "templates" / "style.css").read_text(encoding="utf-8")
    head = f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{escape(title)}</title>'
    view = '<meta name="viewport" content="width=device-width, initial-scale=1">'
    return f"{head}{view}<style>{style}</style></head><body>{body}</body></html>\n"


def write(data: dict, folder: Path) -> Path:
    """FOLDER/index.html with the table, and one page a case beside it; the index."""
    body = f"<h1>Hard cases</h1><p>{escape(INTRO)}</p>{table(data, '{}.html')}"
    pages = in_processes([partial(page, data, case) for case in data["cases"]])
    for case, made in zip(data["cases"], pages, strict=True):
        back = '<p><a href="index.html">All cases</a></p>'
        store.write_text(folder / f"{anchor(case)}.html", whole(case["title"], back + made))
    store.write_text(folder / "index.html", whole("Hard cases", body))
    return folder / "index.html"
