"""Draws a run's figures again from its files, and its sheets of pictures. Nothing is measured."""

import argparse
from collections.abc import Callable
from pathlib import Path

from study.core import store
from study.core.cli import Outcome, StudyError
from study.experiments import experiment
from study.experiments.section import reading
from study.numbers import analysis


def sheets() -> dict[str, Callable[[Path], list[Path]]]:
    """Sheets of pictures by name: the phases that they show must be built."""
    return {name: make for one in experiment.find_all().values() for name, make in one.sheets.items()}


def options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("run", type=Path, metavar="RUN", help="its folder")
    about = "where figures/ and images/ go; default: RUN"
    parser.add_argument("-o", "--out", type=Path, metavar="PATH", help=about)
    about = f"chapters of the report (pareto, roofline …), or of {', '.join(sheets())}, whose phases must be "
    parser.add_argument("--only", nargs="+", metavar="NAME", help=about + "built; default: all chapters")


def run(args: argparse.Namespace) -> Outcome:
    data, known = analysis.load(args.run), sheets()
    chapters = {one.id: one for one in experiment.sections(data)}
    out, made, remarks = store.writable(args.out or args.run), [], []
    for name in args.only or chapters:
        if name in known:
            made += known[name](out)
        elif name not in chapters:
            raise StudyError(f"no chapter or sheet '{name}'; there are {', '.join([*chapters, *known])}")
        else:
            section = chapters[name]
            if args.only and not section.drawn:
                remarks.append(f"{name}: left out, the run has nothing to draw it from; {section.lacking}")
            for stem, drawing in section.drawn.items():
                with reading(section.file or section.id, f"{section.script} --run {args.run}"):
                    made += drawing.write(out / "figures" / stem)
    return Outcome({"files": made}, made, args.run, remarks)
