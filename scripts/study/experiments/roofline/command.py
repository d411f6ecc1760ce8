"""The roofline of a run, and every phase's performance against n. The paper's Tables 5 and 6, Figure 6."""

import argparse

from study.bounds import roof
from study.core import cli, table_files
from study.core.cli import Outcome, StudyError
from study.experiments import running
from study.experiments.roofline import chapter
from study.experiments.section import noted
from study.numbers import analysis


def options(parser: argparse.ArgumentParser) -> None:
    cli.of_run(parser, "where figures/ and tables/ go; default: RUN")


def measure(args: argparse.Namespace) -> Outcome:
    data = analysis.load(args.run, timed=True)
    counted, limits, _ = roof.read(data.path)
    points = roof.points(data, counted, limits)
    if not points:
        again = f"run scripts/stepwise flops --measure --run {data.path}"
        raise StudyError(f"{data.path / roof.COUNTS}: no counts of what was timed; {again}")
    found, out = noted(chapter.made(data, points, limits), data.by_simde), args.out or data.path
    made = {part.name: (part.frame, part.markdown) for part in found.parts}
    files = [*running.draw(out, found.drawn), *table_files.write(made, out / "tables")]
    remarks = [*roof.remarks(roof.headline(points)), *(limits.remarks() if limits else [])]
    ceilings = limits.ceilings if limits else []
    result = {"ceilings": ceilings, "points": points, "remarks": found.remarks, "files": files}
    return Outcome(result, [made["roofline"][1], *files], data.path, remarks)
