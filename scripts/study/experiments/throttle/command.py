"""The article's throttle: rod size, rod steps, finishing steps for the best frame time at a stated error."""

from __future__ import annotations

import argparse

from study.core import cli, registry
from study.core.cli import StudyError
from study.core.run import USABLE
from study.experiments import running
from study.experiments.rods import measure as rods
from study.experiments.rods import tables as rods_page

DESCRIPTION = """\
Phase rods_simd hands each pixel's ray over to packets where its rods end. Every choice of starting size,
smallest size, rod steps and finishing steps is rendered and held against truth; of those within the error
asked for, the fastest are timed again, interleaved, and the best is the throttle's; it and packets alone are
then timed anew, here and in a larger picture."""


def arguments() -> argparse.Namespace:
    parser = cli.parser(
        DESCRIPTION, {1: "no setting is within the error of a scene", 3: "the CPU lacks what it needs"}
    )
    add = parser.add_argument
    add("--scene", nargs="+", default=list(registry.scenes()), metavar="SCENE", help="default: all")
    running.height(parser, 90)
    add(
        "--psnr",
        type=cli.at_least(0, float),
        default=40.0,
        metavar="DB",
        help="to truth, at least; default: 40",
    )
    add(
        "--wrong",
        type=cli.at_least(0, float),
        default=1000.0,
        metavar="PPM",
        help="wrong hits, at most; default: 1000",
    )
    running.height(parser, 360, "height of the larger", "--large")
    running.options(parser, "throttle.json", "systems", 2, "the order")
    return parser.parse_args()


def main() -> int:
    args = arguments()
    if missing := registry.missing_isa(registry.find_phase("rods_simd")):
        raise StudyError(f"rods_simd needs {' '.join(missing)}, which this CPU lacks", cli.CANNOT_RUN)
    folder = running.folder(args)
    scenes = [registry.find_scene(name) for name in dict.fromkeys(args.scene)]
    rows = []
    for scene in scenes:
        cli.say(f"{scene.name}: {len(rods.choices())} settings")
        how = (args.psnr, args.wrong, args.launches, args.seed)
        rows.append(rods.throttle(scene, args.n, *how, large=args.large))
    about = {"cpus": len(USABLE), "launches": args.launches, "seed": args.seed}
    result = running.write(folder / rods.THROTTLE, about, {"rows": rows})
    none = [row["scene"] for row in rows if row["chosen"] is None]
    failed = [f"{name}: no setting is within {args.psnr:g} dB and {args.wrong:g} ppm" for name in none]
    return running.end(args, result, map(rods_page.choice, result["rows"]), failed)
