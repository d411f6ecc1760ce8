"""One sheet of what the systems beside the ladder draw: lattice, rods' hand-over, integers beside floats."""

from __future__ import annotations

import argparse
from pathlib import Path

from study.core.cli import Outcome
from study.experiments import running
from study.experiments.systems import pictures

DESCRIPTION = """\
opt9_convex on CPU-RTRM's scene, rods_simd with the map of where its rods let each ray begin, fixed beside
fixed_float: each picture over its difference to truth. scripts/stepwise report shows the sheet."""


def options(parser: argparse.ArgumentParser) -> None:
    running.height(parser, pictures.HEIGHT)
    parser.add_argument("--run", type=Path, metavar="DIR", help="for images/; default: build/systems")
    parser.set_defaults(home="systems")


def measure(args: argparse.Namespace) -> Outcome:
    folder = running.folder(args)
    (path,) = pictures.write_pictures(folder, args.n)
    return Outcome({"picture": path}, [path], folder)
