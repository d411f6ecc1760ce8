"""One sheet of what the systems beside the ladder draw: lattice, rods' hand-over, integers beside floats."""

from __future__ import annotations

from pathlib import Path

from study.core import cli, registry, store
from study.experiments.systems import pictures as systems_pictures

DESCRIPTION = """\
opt9_convex on CPU-RTRM's scene, rods_simd with the map of where its rods let each ray begin, fixed beside
fixed_float: each picture over its difference to truth. scripts/stepwise report shows the sheet."""


def main() -> int:
    parser = cli.parser(DESCRIPTION, {})
    parser.add_argument(
        "-n",
        type=cli.at_least(16),
        default=systems_pictures.HEIGHT,
        metavar="HEIGHT",
        help="height; default: 180",
    )
    parser.add_argument("--run", type=Path, metavar="DIR", help="for images/; default: build/systems")
    args = parser.parse_args()
    folder = store.writable(args.run or registry.ROOT / "build" / "systems")
    (path,) = systems_pictures.write_pictures(folder, args.n)
    if args.json:
        cli.emit({"picture": path}, folder)
    else:
        print(path)
    return cli.OK
