"""Tables of a run as CSV, Markdown and JSON: ladder, runtime, verification, what was counted, the paper's,
and what became of the papers' claims."""

from __future__ import annotations

import argparse
import dataclasses
from collections.abc import Sequence

import pandas as pd

from study.claims import claims
from study.core import cli, provenance, show, store, table_files
from study.core.cli import Outcome, StudyError
from study.core.marked_blocks import between
from study.core.registry import ROOT
from study.experiments import experiment
from study.experiments.section import Section
from study.numbers import analysis, ladder, paper
from study.numbers import columns as ladder_columns
from study.numbers.analysis import Data
from study.report import front_page

REFERENCE = ROOT / "results" / "reference"
README, SYSTEMS, MACHINES = ROOT / "README.md", REFERENCE / "systems.md", REFERENCE / "machines.md"
BEGIN, END = "<!-- ladder:begin -->", "<!-- ladder:end -->"
MACHINES_BEGIN, MACHINES_END = "<!-- machines:begin -->", "<!-- machines:end -->"
SYSTEMS_BEGIN, SYSTEMS_END = "<!-- systems:begin -->", "<!-- systems:end -->"


def ladder_text(rows: pd.DataFrame) -> str:
    """Per scene: speed and error, the paper beside, the first frame, and how each phase was built."""
    lines = []
    for scene, group in ladder.ladders(rows).items():
        records = group.to_dict("records")
        lines.append(f"### {show.inert(scene)}, {records[0]['width']}×{records[0]['height']}\n")
        for part, title in ladder_columns.PARTS:
            lines += [f"{title}\n", show.markdown(show.table(records, ladder_columns.sized(part, records)))]
    return "\n".join(lines)


def make(data: Data, rows: pd.DataFrame, sections: Sequence[Section] | None = None) -> table_files.Made:
    """Every table that the run has data for. `sections`: its chapters, where they are known."""
    theirs = paper.ladder()
    made: table_files.Made = {
        "paper": (theirs, show.markdown(show.table(theirs.to_dict("records"), ladder_columns.PAPER)))
    }
    if not rows.empty:
        made["ladder"] = rows[rows["headline"]], ladder_text(rows)
    for section in experiment.sections(data) if sections is None else sections:
        made |= {part.name: (part.frame, part.markdown) for part in section.parts if part.name}
    found = claims.check(data, rows)
    made["claims"] = claims.frame(found), show.markdown(show.table(found, claims.COLUMNS))
    return made


def machine_line(data: Data) -> str:
    """CPU, compiler, commit and date of a run in one sentence."""
    context = data.context
    return f"{provenance.place(context)}; {provenance.commit(context)}; {context.time or ''}"


def readme(text: str, data: Data, rows: pd.DataFrame) -> str:
    """README's text with the block between the markers made anew. Raises StudyError without markers."""
    return between(text, BEGIN, END, front_page.ladder_block(data, rows))


def machines(text: str) -> str:
    """The page of machines with the block made anew from every published run of 1280×720, newest last."""
    folders = sorted(file.parent for file in REFERENCE.glob("*-720p*/context.json"))
    runs = [analysis.load(folder, strict=False) for folder in folders]
    return between(text, MACHINES_BEGIN, MACHINES_END, front_page.machines_block(runs))


def systems_page(text: str, data: Data) -> str:
    """Its text with the table of systems made anew from a run that has them. Raises StudyError without
    markers or systems."""
    known = experiment.find_all()
    ((_, chapter),) = known["systems"].sections
    (block, *_) = [part.markdown for part in chapter(data).parts if part.name == "systems"] or [None]
    if block is None:
        raise StudyError(f"{data.path}: has no systems; make systems")
    made_of = provenance.contexts(
        data.path, [file for one in known.values() if one.system for file in one.schemas]
    )
    where = show.inert(provenance.line(made_of) or machine_line(data))
    return between(
        text, SYSTEMS_BEGIN, SYSTEMS_END, f"{block}\nMeasured on {where}; run `{data.path.name}`.\n"
    )


def options(parser: argparse.ArgumentParser) -> None:
    cli.of_run(parser, "default: RUN/tables", height=True)
    for page, what in (
        ("readme", "the ladder between the marks in README.md"),
        ("systems", "the table of results/reference/systems.md"),
        ("machines", "the tables of results/reference/machines.md"),
    ):
        parser.add_argument(f"--{page}", action="store_true", help=f"rewrite {what}")


def run(args: argparse.Namespace) -> Outcome:
    data = dataclasses.replace(analysis.load(args.run), height=args.n)
    rows = ladder.rows(data)
    if not rows["headline"].any():
        raise StudyError(f"{data.path}: nothing was measured at n = {args.n}")
    made = make(data, rows)
    paths = table_files.write(made, args.out or data.path / "tables")
    rewritten = {README: lambda text: readme(text, data, rows)} if args.readme else {}
    rewritten |= {SYSTEMS: lambda text: systems_page(text, data)} if args.systems else {}
    rewritten |= {MACHINES: machines} if args.machines else {}
    for page, made_anew in rewritten.items():
        store.write_text(page, made_anew(page.read_text(encoding="utf-8")))
        paths.append(page)
    found = {name: table.to_dict("records") for name, (table, _) in made.items()}
    return Outcome(found | {"files": paths}, paths, data.path, data.notes)
