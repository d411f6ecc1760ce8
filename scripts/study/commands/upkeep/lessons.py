"""Draws the figures and tables of the phases' NOTES.md from published runs. Nothing is measured.

phases/NAME/lesson.svg, and in NOTES.md the times and the table of the phase's ideas, below their markers."""

import argparse

from study.core import registry, store
from study.core.cli import Outcome, StudyError
from study.experiments import experiment
from study.report import lesson_times, lessons, lessons_draw


def options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--phase", nargs="+", metavar="PHASE", help="default: all that the published run has")


def run(args: argparse.Namespace) -> Outcome:
    made = []
    for name in args.phase or registry.phases():
        found = lessons.figure(name)
        notes = registry.find_phase(name).path / "NOTES.md"
        old = text = notes.read_text(encoding="utf-8")
        for fill in [lesson_times.filled, *(one.lesson for one in experiment.find_all().values())]:
            text = (fill and fill(name, text)) or text
        if text != old:
            store.write_text(notes, text)
            made.append(notes.relative_to(registry.ROOT))
        if found:
            path = notes.with_name(lessons.NAME)
            store.write_text(path, lessons_draw.svg(found))
            made.append(path.relative_to(registry.ROOT))
        elif args.phase:
            raise StudyError(f"{name}: no figure; there are those of {', '.join(lessons.PANELS)}")
    return Outcome({"files": made}, made)
