"""Rays in integers against the same rays in floats."""

from __future__ import annotations

import argparse

from study.core import cli
from study.core.cli import Outcome
from study.experiments import running
from study.experiments.fixed import tables
from study.experiments.fixed.measure import study
from study.experiments.fixed.schema import FILE, Fixed
from study.measuring import hit_tables

DESCRIPTION = """\
spheres40 by the integer ray tracer, one lane, 8 and 16, and the same in floats: interleaved times, errors to
truth. Then bits of fraction × roots, blocks that are cleared wrongly, and an animation's frame times."""
STATUSES = {1: "a picture has samples that are not finite"}


def options(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    running.height(parser, 180, "height of the pictures")
    about = "heights at which blocks are cleared; default: 90 180 360"
    add("--sizes", nargs="+", type=cli.at_least(16), default=[90, 180, 360], metavar="N", help=about)
    add("--frames", type=cli.at_least(2), default=900,
        help="of the animation in lanes on every core; on one thread and by the article's program "
        "fewer, as the table says; default: 900, the article's")  # fmt: skip
    running.height(parser, 1080, "its height", "--frame-n")
    running.options(parser, FILE, "systems", 2, "the order")


def measure(args: argparse.Namespace) -> Outcome:
    folder = running.folder(args, FILE)
    found = study(args.n, args.sizes, args.frames, args.frame_n, args.launches, args.seed)
    result = Fixed(**running.about(args), **found)
    named = [*((row.case, row) for row in result.rows), *((row.settings, row) for row in result.sweep)]
    named += [(f"clear={row.clear}, height {row.n}", row) for row in result.clearing]
    return running.end(folder / FILE, result, tables.parts(result), failed=hit_tables.not_finite(named))
