"""Rays in integers against the same in floats: bits of fraction, lanes, cleared blocks, an animation."""

from __future__ import annotations

import argparse
import secrets
import time
from pathlib import Path

import matplotlib

from study.core import cli, machine, registry, store
from study.experiments.fixed import measure as fixed
from study.experiments.fixed import pictures as fixed_pictures
from study.experiments.fixed import tables as fixed_page
from study.experiments.moving import measure as moving
from study.pictures.draw import STYLE, save

DESCRIPTION = """\
spheres40 by the integer ray tracer: the article's way, one lane, 8 and 16, and the same in floats, timed in
interleaved launches with the error of each to truth; bits of fraction from 8 to 28 with the article's
roots, two Newton steps and three; which pixels the article's four-corner test clears wrongly; and the frame
times of the animation beside the article's 14.29 ms on 35 cores. Interrupted in the animation, it goes
on behind the last frame with the same --run and --resume."""


def arguments() -> argparse.Namespace:
    parser = cli.parser(DESCRIPTION, {1: "a picture has samples that are not finite"})
    add = parser.add_argument
    add(
        "-n",
        type=cli.at_least(16),
        default=180,
        metavar="HEIGHT",
        help="height of the pictures; default: 180",
    )
    add("--sizes", nargs="+", type=cli.at_least(16), default=[90, 180, 360, 1080], metavar="N",
        help=f"heights at which blocks are cleared, those over {fixed.TRUTH_HEIGHT} against the picture "
        "without clearing in place of truth; default: 90 180 360 1080")  # fmt: skip
    add("--frames", type=cli.at_least(2), default=900,
        help="of the animation in lanes on every core; on one thread and by the article's program "
        "fewer, as the table says; default: 900, the article's")  # fmt: skip
    add("--frame-n", type=cli.at_least(16), default=1080, metavar="HEIGHT", help="its height; default: 1080")
    add("--launches", type=cli.at_least(2), default=6, help="process launches of each; default: 6")
    add("--seed", type=int, help="of the order; default: random")
    add("--run", type=Path, metavar="DIR", help="for fixed.json, images/, figures/; default: build/systems")
    about = "go on with the animation of a run that was interrupted: its frames are kept in --run"
    add("--resume", action="store_true", help=about)
    args = parser.parse_args()
    args.seed = secrets.randbelow(2**32) if args.seed is None else args.seed
    return args


def main() -> int:
    args = arguments()
    folder = store.writable(args.run or registry.ROOT / "build" / "systems")
    if not args.resume:
        moving.forget(folder, fixed.ANIMATED)
    begun = time.monotonic()
    found = fixed.study(args.n, args.sizes, args.frames, args.frame_n, args.launches, args.seed, folder)
    about = {"launches": args.launches, "seed": args.seed, "took_s": time.monotonic() - begun}
    result = cli.plain({"schema": 1, **about, "context": machine.context(), **found})
    store.write_json(folder / fixed.FILE, result)
    moving.forget(folder, {row["phase"] for row in result["animation"]})
    paths = fixed_pictures.write_pictures(folder)
    with matplotlib.rc_context(STYLE):
        for name, drawing in fixed_page.drawings(result).items():
            paths += save(drawing.make(), folder / "figures" / name, drawing.note)
    if args.json:
        cli.emit(result, folder)
    else:
        lines = [*map(fixed_page.sentence, result["rows"]), *map(moving.sentence, result["animation"])]
        print("\n".join([*lines, *map(str, paths)]))
    bad = [r for r in (*result["rows"], *result["sweep"], *result["clearing"]) if r.get("non_finite")]
    for row in bad:
        cli.say(f"FAIL {row.get('case') or row.get('settings')}: samples that are not finite")
    return cli.FAILED if bad else cli.OK
