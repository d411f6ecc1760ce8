"""A run as a paper: a PDF of some eight pages with figures, the studied paper's tables, method and limits.

It is set by typst, which is installed into build/pdf on the first call.
"""

from __future__ import annotations

import argparse
import json
import shutil
from pathlib import Path

import matplotlib

from study.commands import report
from study.core import registry, store, temporary
from study.core.cli import CANNOT_RUN, Outcome, StudyError
from study.core.host import child
from study.experiments import venvs
from study.numbers import analysis, ladder
from study.numbers.analysis import Data
from study.report import figures, paper

OUT = registry.ROOT / "report" / "out" / "report.pdf"
HOME = registry.ROOT / "build" / "pdf"
PACKAGE = "typst==0.15.2"
SET = (
    "import sys, typst; "
    "typst.compile(sys.argv[1], output=sys.argv[2], root=sys.argv[3], font_paths=sys.argv[4:])"
)
FONTS = Path(matplotlib.get_data_path()) / "fonts" / "ttf"  # of the figures' letters


def typeset(folder: Path, out: Path) -> None:
    """`folder` has paper.typ and all that it reads. Raises StudyError with what typst says."""
    if not venvs.has(venvs.python_of(HOME), "typst"):
        venvs.install(HOME, [PACKAGE])
    command = [venvs.python_of(HOME), "-I", "-c", SET, folder / paper.TEMPLATE.name, out, folder]
    command.append(FONTS)
    done = child.run(command, capture_output=True, text=True)
    if done.returncode:
        last = (done.stderr.strip().splitlines() or ["no word"])[-1]
        raise StudyError(f"typst: {last}", CANNOT_RUN)


def make(data: Data, out: Path) -> None:
    """The PDF of a run at `out`, whole or not at all."""
    rows = ladder.rows(data)
    questions = report.asked(data, rows)
    store.writable(out.parent)
    with temporary.folder(out.parent, ".pdf.") as folder:
        found = [section for some in questions.values() for section in some if section.id in paper.CHAPTERS]
        figures.draw(found, folder / "figures")
        told = paper.content(data, questions, report.headlines(rows), folder / "figures")
        (folder / "paper.json").write_text(json.dumps(told, ensure_ascii=False), encoding="utf-8")
        shutil.copyfile(paper.TEMPLATE, folder / paper.TEMPLATE.name)
        typeset(folder, folder / "report.pdf")
        (folder / "report.pdf").replace(out)


def options(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("run", nargs="?", type=Path, metavar="RUN", help="its folder; default: the newest run")
    add("-o", "--out", type=Path, default=OUT, metavar="PATH", help="default: report/out/report.pdf")


def run(args: argparse.Namespace) -> Outcome:
    data = analysis.load(args.run)
    make(data, args.out)
    return Outcome({"pdf": args.out}, [args.out], data.path)
