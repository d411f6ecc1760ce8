"""The article's throttle: rod size, rod steps, finishing steps for the best frame time at a stated error."""

from __future__ import annotations

import argparse
import secrets
import time
from pathlib import Path

from study.core import cli, machine, registry, store
from study.core.cli import StudyError
from study.core.run import USABLE
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
    add("-n", type=cli.at_least(16), default=90, metavar="HEIGHT", help="height in pixels; default: 90")
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
    add(
        "--large",
        type=cli.at_least(16),
        default=360,
        metavar="HEIGHT",
        help="height of the larger; default: 360",
    )
    add("--launches", type=cli.at_least(2), default=6, help="of finalists and choice; default: 6")
    add("--seed", type=int, help="of the order; default: random")
    add("--run", type=Path, metavar="DIR", help="for throttle.json; default: build/systems")
    args = parser.parse_args()
    args.seed = secrets.randbelow(2**32) if args.seed is None else args.seed
    return args


def main() -> int:
    args = arguments()
    if missing := registry.missing_isa(registry.find_phase("rods_simd")):
        raise StudyError(f"rods_simd needs {' '.join(missing)}, which this CPU lacks", cli.CANNOT_RUN)
    folder = store.writable(args.run or registry.ROOT / "build" / "systems")
    scenes = [registry.find_scene(name) for name in dict.fromkeys(args.scene)]
    begun, rows = time.monotonic(), []
    for scene in scenes:
        cli.say(f"{scene.name}: {len(rods.choices())} settings")
        how = (args.psnr, args.wrong, args.launches, args.seed)
        rows.append(rods.throttle(scene, args.n, *how, large=args.large))
    about = {"cpus": len(USABLE), "launches": args.launches, "seed": args.seed}
    about["took_s"] = time.monotonic() - begun
    result = cli.plain({"schema": 1, **about, "context": machine.context(), "rows": rows})
    store.write_json(folder / rods.THROTTLE, result)
    if args.json:
        cli.emit(result, folder)
    else:
        print("\n".join(map(rods_page.choice, result["rows"])))
    none = [row["scene"] for row in rows if row["chosen"] is None]
    for name in none:
        cli.say(f"FAIL {name}: no setting is within {args.psnr:g} dB and {args.wrong:g} ppm")
    return cli.FAILED if none else cli.OK
