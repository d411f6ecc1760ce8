"""The roofline of a run and the performance of every phase against n (Tables 5 and 6, Figure 6)."""

from __future__ import annotations

import argparse

from study.bounds import roof
from study.core import cli, table_files
from study.core.cli import Outcome, StudyError
from study.experiments import running
from study.experiments.roofline import figures
from study.experiments.roofline.tables import tables
from study.numbers import analysis


def options(parser: argparse.ArgumentParser) -> None:
    cli.of_run(parser, "where figures/ and tables/ go; default: RUN")


def measure(args: argparse.Namespace) -> Outcome:
    data = analysis.load(args.run)
    counted, limits, _ = roof.read(data.path)
    points = roof.points(data, counted, limits)
    if not points:
        again = f"run scripts/stepwise flops --measure --run {data.path}"
        raise StudyError(f"{data.path / roof.COUNTS}: no counts of what was timed; {again}")
    out = args.out or data.path
    remarks = [*roof.remarks(roof.headline(points)), *(limits.remarks() if limits else [])]
    made = tables(points, limits)
    files = running.draw(out, figures.drawings(data, points, limits))
    files += table_files.write(made, out / "tables")
    ceilings = limits.ceilings if limits else []
    result = {"ceilings": ceilings, "points": points, "remarks": roof.remarks(points), "files": files}
    return Outcome(result, [made["roofline"][1], *files], data.path, remarks)
