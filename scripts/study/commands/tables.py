"""Tables of a run as CSV, Markdown and JSON. They are: the ladder, runtime, verification, what was
counted, the paper's, and what became of the papers' claims."""

import argparse
import dataclasses
from collections.abc import Iterable

import pandas as pd

from study.core import cli, provenance, run_schema, show, store, table_files
from study.core.cli import Outcome, StudyError
from study.core.registry import ROOT
from study.core.show import between
from study.experiments import experiment
from study.experiments.section import Section
from study.numbers import accuracy, analysis, columns, ladder
from study.numbers.analysis import Data
from study.report import appendix, chapters, programs_chapter, published_tables

REFERENCE = ROOT / "results" / "reference"
PAGES = {  # option → the page with a block that is made anew, and the block's name in its marks
    "readme": (ROOT / "README.md", "ladder"),
    "systems": (REFERENCE / "systems.md", "systems"),
    "machines": (REFERENCE / "machines.md", "machines"),
    "limit": (ROOT / "docs" / "limit.md", "limit"),
    "artifact": (ROOT / "docs" / "artifact.md", "claims"),
}


def ladder_text(rows: pd.DataFrame) -> str:
    """Per scene: speed and error, the paper beside, the first frame, and how each phase was built."""
    lines = []
    for scene, group in ladder.ladders(rows).items():
        records = group.to_dict("records")
        lines.append(f"### {show.inert(scene)}, {records[0]['width']}×{records[0]['height']}\n")
        for part, title in columns.PARTS:
            lines += [f"{title}\n", show.markdown(show.table(records, columns.sized(part, records)))]
    return "\n".join(lines)


def make(rows: pd.DataFrame, sections: Iterable[Section]) -> table_files.Made:
    """The ladder, and every table of the chapters that has a name."""
    made: table_files.Made = {} if rows.empty else {"ladder": (rows[rows.headline], ladder_text(rows))}
    return made | {
        part.name: (part.frame, part.markdown) for section in sections for part in section.parts if part.name
    }


def systems_block(data: Data) -> str:
    """The block of a run that has other papers' systems. Raises StudyError."""
    known = experiment.find_all()
    ((_, chapter),) = known["systems"].sections
    block = next((part.markdown for part in chapter(data).parts if part.name == "systems"), None)
    if block is None:
        raise StudyError(f"{data.path}: has no systems; make systems")
    files = [file for one in known.values() if one.system for file in one.schemas]
    context = data.context
    here = f"{provenance.place(context)}; {provenance.commit(context)}; {context.time or ''}"
    where = provenance.line(provenance.contexts(data.path, files)) or here
    return f"{block}\nMeasured on {show.inert(where)}; run `{data.path.name}`.\n"


def machines_block() -> str:
    """The block of every published run of 1280×720."""
    folders = sorted(file.parent for file in REFERENCE.glob("*-720p*/context.json"))
    return published_tables.machines_block([analysis.load(folder) for folder in folders])


def exact_surfaces() -> pd.DataFrame | None:
    """Errors (ladder.truth_errors) in the newest published run that knows Mandelbulbs' exact surface."""
    made = []
    for file in REFERENCE.glob("*/accuracy.json"):
        if any(row.surface for row in accuracy.rows(file.parent)):
            run = analysis.load(file.parent)
            made.append((run.context.time or "", ladder.truth_errors(run).assign(run=file.parent.name)))
    return max(made, key=lambda one: one[0], default=(None, None))[1]


def all_sections(data: Data, rows: pd.DataFrame) -> list[Section]:
    if data.plan.programs:
        return [programs_chapter.timed(data)]
    return [chapters.reproduced(data, rows), *experiment.sections(data)]


def rewritten(option: str, data: Data, rows: pd.DataFrame) -> str:
    """The text of the option's page with its block made anew. Raises StudyError without marks."""
    page, name = PAGES[option]
    make = {
        "readme": lambda: published_tables.ladder_block(data, rows, exact_surfaces()),
        "systems": lambda: systems_block(data),
        "machines": machines_block,
        "limit": lambda: published_tables.limit_block(data, rows),
        "artifact": lambda: appendix.block(data, all_sections(data, rows)),
    }
    marks = (f"<!-- {name}:{end} -->" for end in ("begin", "end"))
    return between(page.read_text(encoding="utf-8"), *marks, make[option]())


def options(parser: argparse.ArgumentParser) -> None:
    cli.of_run(parser, "default: RUN/tables", height=True)
    for option, (page, _) in PAGES.items():
        about = f"rewrite the block of {page.relative_to(ROOT)}"
        parser.add_argument(f"--{option}", action="store_true", help=about)


def run(args: argparse.Namespace) -> Outcome:
    data = dataclasses.replace(analysis.load(args.run), height=args.n)
    rows = ladder.rows(data)
    if not rows.empty and not rows.headline.any():
        raise StudyError(f"{data.path}: nothing was measured at n = {args.n}")
    if rows.empty and (args.readme or args.limit):
        raise StudyError(f"{data.path}: has no timed frame for that page; run scripts/stepwise sweep")
    files = {file for one in experiment.find_all().values() for file in one.schemas}
    files -= run_schema.SCHEMAS.keys()
    if not data.cells and not any(store.stored(data.path / file).exists() for file in files):
        raise StudyError(f"{data.path}: nothing was measured: no timed frame and no experiment's file")
    made = make(rows, all_sections(data, rows))
    paths = table_files.write(made, args.out or data.path / "tables")
    for option, (page, _) in PAGES.items():
        if getattr(args, option):
            store.write_text(page, rewritten(option, data, rows))
            paths.append(page)
    found = {name: table.to_dict("records") for name, (table, _) in made.items()}
    return Outcome(found | {"files": paths}, paths, data.path, data.notes)
