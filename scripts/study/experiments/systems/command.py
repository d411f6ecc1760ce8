"""One sheet of what the systems beside the ladder draw: lattice, rods' hand-over, integers beside floats."""

from __future__ import annotations

from pathlib import Path

from study.core import cli
from study.experiments import running
from study.experiments.systems import pictures as systems_pictures

DESCRIPTION = """\
opt9_convex on CPU-RTRM's scene, rods_simd with the map of where its rods let each ray begin, fixed beside
fixed_float: each picture over its difference to truth. scripts/stepwise report shows the sheet."""


def main() -> int:
    parser = cli.parser(DESCRIPTION, {})
    running.height(parser, systems_pictures.HEIGHT)
    parser.add_argument("--run", type=Path, metavar="DIR", help="for images/; default: build/systems")
    parser.set_defaults(home="systems")
    args = parser.parse_args()
    folder = running.folder(args)
    (path,) = systems_pictures.write_pictures(folder, args.n)
    return running.end(args, {"picture": path}, [path])
