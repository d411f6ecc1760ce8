"""Plots of a run, SVG and PNG: speed-up ladder, runtime and time per pixel against n, speed against error."""

from __future__ import annotations

import argparse

from study.core import cli
from study.core.cli import Outcome, StudyError
from study.numbers import analysis, ladder
from study.pictures.ladder import PLOTS, draw


def options(parser: argparse.ArgumentParser) -> None:
    cli.of_run(parser, "default: RUN/figures", height=True)
    about = f"of {', '.join(PLOTS)}; default: all"
    parser.add_argument("--only", nargs="+", choices=PLOTS, metavar="PLOT", help=about)


def run(args: argparse.Namespace) -> Outcome:
    data = analysis.load(args.run)
    rows = ladder.rows(data, args.n)
    if not rows["headline"].any():
        raise StudyError(f"{data.path}: nothing was measured at n = {args.n}")
    made = draw(data, rows, args.out or data.path / "figures", args.only)
    return Outcome(made, [path for paths in made.values() for path in paths], data.path)
