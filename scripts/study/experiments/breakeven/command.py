"""When a kernel generated for a scene has paid for its compilation: frames, against its parent's time."""

from __future__ import annotations

import argparse
import secrets
import time
from pathlib import Path

from study.core import cli, machine, registry, store
from study.core.build import build
from study.core.cli import StudyError
from study.core.registry import Spec
from study.experiments.breakeven import measure as breakeven
from study.experiments.breakeven import tables as breakeven_page

DESCRIPTION = """\
opt10_scene compiles a kernel for each scene. Its set-up, from an empty cache, and its frames against
opt9_convex's, interleaved, each launch a process of its own: how many frames until it has paid. Scenes
without a kernel are named."""
SECONDS = 90


def arguments() -> argparse.Namespace:
    parser = cli.parser(DESCRIPTION, {1: "a kernel's picture has samples that are not finite"})
    add = parser.add_argument
    add("--phase", default=breakeven.PHASE, metavar="PHASE", help="default: %(default)s")
    add("--against", default=breakeven.AGAINST, metavar="PHASE", help="default: %(default)s")
    add("--scene", nargs="+", default=list(breakeven.SCENES), metavar="SCENE", help="default: %(default)s")
    add("-n", type=cli.at_least(1), default=720, metavar="HEIGHT", help="height; default: 720, the paper's")
    add("--launches", type=cli.at_least(1), default=6, help="process launches of each; default: 6")
    add(
        "--budget",
        type=cli.at_least(1, float),
        default=SECONDS,
        metavar="SECONDS",
        help="for everything; default: %(default)s",
    )
    add("--seed", type=int, help="of order and padding; default: random")
    add("--run", type=Path, metavar="DIR", help="for breakeven.json; default: build/breakeven")
    args = parser.parse_args()
    args.seed = secrets.randbelow(2**32) if args.seed is None else args.seed
    return args


def main() -> int:
    args = arguments()
    specs = Spec.parse(args.against), Spec.parse(args.phase)
    scenes = [registry.find_scene(name) for name in dict.fromkeys(args.scene)]
    for spec in specs:
        if lacking := registry.missing_isa(spec):
            raise StudyError(f"{spec} needs {', '.join(lacking)}, which this CPU lacks", cli.CANNOT_RUN)
        if registry.find_phase(spec.phase).family == registry.TRUTH:
            raise StudyError(f"{spec}: is truth itself; name phases that are to be timed")
    folder = store.writable(args.run or registry.ROOT / "build" / "breakeven")
    for spec in specs:
        build(spec)
    begun = time.monotonic()
    settings = breakeven.Settings(args.n, args.launches, args.budget, args.seed)
    found = breakeven.study(specs, scenes, settings)
    about = {"launches": args.launches, "seconds": args.budget, "seed": args.seed}
    about |= {"took_s": time.monotonic() - begun, "context": machine.context()}
    result = cli.plain({"schema": 1, **about, **found})
    store.write_json(folder / breakeven.FILE, result)
    if args.json:
        cli.emit(result, folder)
    else:
        for row in result["rows"]:
            print(breakeven_page.sentence(row, result["against"]))
        print(folder / breakeven.FILE)
    for row in result["left_out"]:
        cli.say(f"left out {row['scene']}: {row['reason']}")
    bad = [row for row in result["rows"] if row["generated"] and row["error"]["non_finite"]]
    for row in bad:
        cli.say(f"FAIL {row['scene']}: {row['error']['non_finite']} samples not finite")
    return cli.FAILED if bad else cli.OK
