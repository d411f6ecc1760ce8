"""What the PDF of a run says: a paper of seven or eight pages, as data for paper.typ beside this file."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from study.experiments.section import Part, Section
from study.numbers import noise, stats
from study.numbers.analysis import Data
from study.report import facts

TEMPLATE = Path(__file__).with_name("paper.typ")


@dataclass(frozen=True)
class Kept:
    """A table of the page that the paper has: `columns` by their names, `GROUP/NAME` where two have one.

    `caption`: what the page's caption begins or ends with. `phases`: rows of these alone (empty: all).
    """

    caption: str
    columns: Sequence[str] = ()
    phases: Sequence[str] = ()


RULE = "GFLOP of a picture/by the paper's rule"
MACHINE = "GFLOP of a picture/machine's convention"
AVX2 = "machine's convention/share of AVX2 peak"
WORDS = ("scene", "phase", "step", "against")  # columns of names, which come first
CHAPTERS: Mapping[str, tuple[bool, Sequence[Kept]]] = {  # chapter → whether with its figure, its tables
    "ladder": (True, [Kept("speed and error")]),
    "pareto": (True, [Kept("The fastest at a stated PSNR")]),
    "roofline": (
        True,
        [Kept("Table 5", ["scene", "phase", "n", "flop/core cycle [95\xa0%]", AVX2, "flop/cycle"])],
    ),
    "hotspots": (True, []),
    "flops": (
        False,
        [
            Kept(
                "Table 1: FLOPs",
                ["scene", "phase", RULE, "GFLOP of a picture/the paper's own", "difference", MACHINE],
                ("baseline",),
            )
        ],
    ),
    "claims": (True, [Kept("The paper's ladder")]),
    "ablations": (
        True,
        [Kept("Each step alone", ["step", "against", "scene", "the step's gain [95\xa0%]", "the paper"])],
    ),
    "negative": (False, []),
    "accuracy": (False, []),
    "stability": (True, []),
}


def _kept(part: Part, kept: Kept) -> dict[str, Any]:
    """The part's table with the columns and rows that are kept, as text."""
    table = part.table
    names = [f"{column.group}/{column.name}" for column in table.columns]
    plain = [column.name for column in table.columns]
    at = [(names if one in names else plain).index(one) for one in kept.columns if one in names + plain]
    at = at or list(range(len(plain)))
    phase = plain.index("phase") if "phase" in plain else 0
    cells = [
        [row[i][0] for i in at] for row in table.cells if not kept.phases or row[phase][0] in kept.phases
    ]
    heads = [" ".join(filter(None, (table.columns[i].group, plain[i]))) for i in at]
    words = sum(plain[i] in WORDS for i in at)
    caption = re.sub(r"^(Table \d+): ", r"As the paper's \1: ", part.caption)
    return {"caption": caption, "heads": heads, "rows": cells, "foot": part.foot, "words": words}


def chapter(section: Section, folder: Path) -> dict[str, Any] | None:
    """Answer, figure and tables of a chapter, None where the paper has none. `folder`: of figures."""
    if section.id not in CHAPTERS or not (section.answer or section.parts):
        return None
    with_figure, wanted = CHAPTERS[section.id]
    tables = [
        _kept(part, kept)
        for kept in wanted
        for part in section.parts
        if part.caption.startswith(kept.caption) or part.caption.endswith(kept.caption)
    ]
    figure = None
    if with_figure and section.drawn:
        name, drawing = next(iter(section.drawn.items()))
        path = folder / f"{name}.svg"
        if path.is_file():
            figure = {"file": f"{folder.name}/{path.name}", "caption": drawing.caption, "note": drawing.note}
    made = {"title": section.title, "answer": section.answer, "cut": section.cut}
    return made | {"figure": figure, "tables": tables}


def _headline(one: Mapping[str, Any]) -> str:
    said = f"On {one['scene']} the fastest phase, {one['row']['phase']}, takes {one['ms']} ms a frame"
    if one["speedup"]:
        said += f", {one['speedup']} as fast as baseline"
    if one["truth"]:
        picture = "the ideal picture" if one["draws_ideal"] else "ground truth"
        said += f"; its PSNR to {picture} is {one['truth']} dB"
    return f"{said}."


def content(
    data: Data, questions: Mapping[str, Sequence[Section]], headlines: Sequence[Mapping], folder: Path
) -> dict[str, Any]:
    """Everything that paper.typ shows, as JSON types."""
    chapters = {text: [chapter(one, folder) for one in some] for text, some in questions.items()}
    return {
        "abstract": [_headline(one) for one in headlines],
        "machine": [list(pair) for pair in facts.machine(data)],
        "commands": list(facts.commands(data)),
        "remarks": noise.remarks(data.frames, data.cells),
        "questions": [
            {"title": text, "chapters": [one for one in some if one]}
            for text, some in chapters.items()
            if any(some)
        ],
        **stats.methods(),
        "time": (data.context.time or "")[:10],
    }
