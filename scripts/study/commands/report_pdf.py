"""A run as a paper: a PDF of ten pages with figures, tables, method and limits.

It is set by typst, which is installed into build/pdf on the first call.
"""

import argparse
import json
import re
import shutil
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import matplotlib

from study.core import html, registry, show, store, temporary
from study.core.cli import CANNOT_RUN, Outcome, StudyError
from study.core.host import child
from study.experiments import venvs
from study.experiments.section import Part, Section
from study.numbers import analysis, ladder, noise, stats, summary
from study.numbers.analysis import Data
from study.report import chapters, compared, facts, figures

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
# Tables beside those that are open on the page, and what paper has no room for.
TABLES: dict[str, set[str]] = {"pareto": set(), "table5": {"counted by"}, "paper": set()}
TABLES["table1"] = {"difference", "iterations as entered", "useful FLOP/evaluation, as entered"}
TABLES["table1"] |= {"10⁹ comparisons of the source (not in the FLOPs)"}
TABLES["ablations"] = {"added or removed", "of what it is compared with", "pixels off > 1/255", "tolerance"}
TABLES["ablations"] |= {"what"}
ACROSS = 6.77  # inches: of a figure


def broken(text: str) -> str:
    """A cell in which the name of a step, like opt2+fast_root_1, may be broken; feet tell of general code."""
    text = text.removesuffix(" (general code)")
    return re.sub(r"(?<=\w[+_])(?=\w)", "\u200b", text) if "+" in text else text


def table(part: Part) -> dict[str, Any]:
    """Columns without a value are left out; one that says the same in every row says it in the foot."""
    heads, columns, feet = [], [], part.foot.splitlines()
    for place, one in enumerate(part.table.columns):
        head = f"{one.group} {one.name}".strip()
        texts = [broken(row[place][0]) for row in part.table.cells]
        if {*texts} <= {"", show.NOTHING} or one.name in TABLES.get(part.name, ()):
            continue
        if place and len(texts) > 2 and len({*texts}) == 1:
            feet.append(f"{head}: {texts[0]}.")
            continue
        heads.append(head)
        columns.append(texts)
    rows = [list(row) for row in zip(*columns, strict=True)]
    caption = re.sub(r"^Table", "The paper's Table", part.caption)
    return {"caption": caption, "foot": "\n".join(feet), "heads": heads, "rows": rows}


def chapter(section: Section, folder: Path) -> dict[str, Any]:
    """Answer, first figure (in `folder`) and some tables of a chapter."""
    drawn = [
        {"file": f"{folder.name}/{name}.svg", "caption": one.caption, "note": one.note}
        for name, one in section.drawn.items()
    ]
    told = {"title": section.title, "answer": section.answer, "figure": drawn[0] if drawn else None}
    return told | {"tables": [table(one) for one in section.parts if one.open or one.name in TABLES]}


def lesson(data: Data) -> str:
    """The largest step of each scene's ladder, in a sentence; empty where no phase was timed beside its
    parent."""
    known, told = registry.phases(), []
    every = [row for row in summary.rows(data.frames) if row.parent_speedup and row.threads == 1]
    for scene in dict.fromkeys(row.scene for row in every):
        size = ladder.headline_size(data, scene)
        some = [row for row in every if row.scene == scene and (row.width, row.height) == size]
        best = max(some, key=lambda row: row.parent_speedup.value, default=None)
        if best:
            gain = show.spread(best.parent_speedup, 3, "×")
            told.append(f"on {scene} {best.spec} ({known[best.spec].title}), {gain} over {best.parent}")
    return f"The largest single step: {'; '.join(told)}." if told else ""


def content(data: Data, questions: dict[str, Sequence[Section]], folder: Path) -> dict[str, Any]:
    return {
        "questions": [
            {"title": text, "chapters": [chapter(one, folder) for one in some]}
            for text, some in questions.items()
        ],
        "lesson": lesson(data),
        "pictures": [
            {"file": f"{folder.name}/{path.name}", "caption": f"{scene}, {phase}"}
            for scene, phase, path in compared.ends(data)
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
        figures.draw([one for some in questions.values() for one in some], folder / "figures", across=ACROSS)
        for _, _, path in compared.ends(data):
            shutil.copyfile(path, folder / "figures" / path.name)
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
