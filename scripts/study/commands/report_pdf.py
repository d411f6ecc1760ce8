"""A run as a paper: a PDF of some eight pages with figures, the studied paper's tables, method and limits.

It is set by typst, which is installed into build/pdf on the first call.
"""

import argparse
import json
import shutil
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import matplotlib

from study.core import html, registry, store, temporary
from study.core.cli import CANNOT_RUN, Outcome, StudyError
from study.core.host import child
from study.experiments import venvs
from study.experiments.section import Section
from study.numbers import analysis, ladder, noise, stats
from study.numbers.analysis import Data
from study.report import chapters, facts, figures

OUT = registry.ROOT / "report" / "out" / "report.pdf"
HOME = registry.ROOT / "build" / "pdf"
PACKAGE = "typst==0.15.2"
SET = (
    "import sys, typst; "
    "typst.compile(sys.argv[1], output=sys.argv[2], root=sys.argv[3], font_paths=sys.argv[4:])"
)
FONTS = Path(matplotlib.get_data_path()) / "fonts" / "ttf"  # of the figures' letters
TEMPLATE = html.TEMPLATES / "report.typ"
CHAPTERS = {"ladder", "pareto", "roofline", "hotspots", "flops", "claims", "ablations", "negative"}
CHAPTERS |= {"accuracy", "stability"}
TABLES = {"pareto", "table1", "table5", "paper", "ablations"}  # beside those that are open on the page


def chapter(section: Section, folder: Path) -> dict[str, Any]:
    """Answer, first figure (in `folder`) and some tables of a chapter."""
    tables = [
        {
            "caption": part.caption,
            "foot": part.foot,
            "heads": [f"{one.group} {one.name}".strip() for one in part.table.columns],
            "rows": [[text for text, _ in row] for row in part.table.cells],
        }
        for part in section.parts
        if part.open or part.name in TABLES
    ]
    drawn = [
        {"file": f"{folder.name}/{name}.svg", "caption": one.caption} for name, one in section.drawn.items()
    ]
    told = {"title": section.title, "answer": section.answer}
    return told | {"figure": drawn[0] if drawn else None, "tables": tables}


def content(data: Data, questions: dict[str, Sequence[Section]], folder: Path) -> dict[str, Any]:
    return {
        "questions": [
            {"title": text, "chapters": [chapter(one, folder) for one in some]}
            for text, some in questions.items()
        ],
        "machine": facts.machine(data),
        "commands": facts.commands(data),
        "remarks": noise.remarks(data.frames, data.cells),
        **stats.methods(),
        "time": (data.context.time or "")[:10],
    }


def shown(data: Data) -> dict[str, list[Section]]:
    """Question → the chapters that the paper has, each with its first figure alone."""
    asked = chapters.asked(data, ladder.rows(data))
    return {
        text: [replace(one, drawn=dict([*one.drawn.items()][:1])) for one in some]
        for text, found in asked.items()
        if (some := [one for one in found if one.id in CHAPTERS and (one.answer or one.parts)])
    }


def typeset(folder: Path, out: Path) -> None:
    """`folder` has the template and all that it reads. Raises StudyError with what typst says."""
    if not venvs.has(venvs.python_of(HOME), "typst"):
        venvs.install(HOME, [PACKAGE])
    command = [venvs.python_of(HOME), "-I", "-c", SET, folder / TEMPLATE.name, out, folder, FONTS]
    done = child.run(command, capture_output=True, text=True)
    if done.returncode:
        last = (done.stderr.strip().splitlines() or ["no word"])[-1]
        raise StudyError(f"typst: {last}", CANNOT_RUN)


def make(data: Data, out: Path) -> None:
    """The PDF of a run at `out`, whole or not at all."""
    questions = shown(data)
    with temporary.folder(store.writable(out.parent), ".pdf.") as folder:
        figures.draw([one for some in questions.values() for one in some], folder / "figures")
        told = content(data, questions, folder / "figures")
        (folder / "report.json").write_text(json.dumps(told, ensure_ascii=False), encoding="utf-8")
        shutil.copyfile(TEMPLATE, folder / TEMPLATE.name)
        typeset(folder, folder / "report.pdf")
        (folder / "report.pdf").replace(out)


def options(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("run", nargs="?", type=Path, metavar="RUN", help="its folder; default: the newest run")
    add("-o", "--out", type=Path, default=OUT, metavar="PATH", help="default: report/out/report.pdf")


def run(args: argparse.Namespace) -> Outcome:
    data = analysis.load(args.run, timed=True)
    make(data, args.out)
    return Outcome({"pdf": args.out}, [args.out], data.path)
