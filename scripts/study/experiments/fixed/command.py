"""Rays in integers against the same in floats: bits of fraction, lanes, cleared blocks, an animation."""

from __future__ import annotations

import argparse

from study.core import cli
from study.experiments import running
from study.experiments.fixed import measure as fixed
from study.experiments.fixed import pictures as fixed_pictures
from study.experiments.fixed import tables as fixed_page
from study.experiments.moving import measure as moving

DESCRIPTION = """\
spheres40 by the integer ray tracer: the article's way, one lane, 8 and 16, and the same in floats, timed in
interleaved launches with the error of each to truth; bits of fraction from 8 to 28 with the article's
roots, two Newton steps and three; which pixels the article's four-corner test clears wrongly; and the frame
times of the animation beside the article's 14.29 ms on 35 cores. Interrupted in the animation, it goes
on behind the last frame with the same --run and --resume."""


def arguments() -> argparse.Namespace:
    parser = cli.parser(DESCRIPTION, {1: "a picture has samples that are not finite"})
    add = parser.add_argument
    running.height(parser, 180, "height of the pictures")
    add("--sizes", nargs="+", type=cli.at_least(16), default=[90, 180, 360, 1080], metavar="N",
        help=f"heights at which blocks are cleared, those over {fixed.TRUTH_HEIGHT} against the picture "
        "without clearing in place of truth; default: 90 180 360 1080")  # fmt: skip
    add("--frames", type=cli.at_least(2), default=900,
        help="of the animation in lanes on every core; on one thread and by the article's program "
        "fewer, as the table says; default: 900, the article's")  # fmt: skip
    running.height(parser, 1080, "its height", "--frame-n")
    running.options(parser, "fixed.json, images/, figures/", "systems", 2, "the order")
    about = "go on with the animation of a run that was interrupted: its frames are kept in --run"
    add("--resume", action="store_true", help=about)
    return parser.parse_args()


def main() -> int:
    args = arguments()
    folder = running.folder(args)
    if not args.resume:
        moving.forget(folder, fixed.ANIMATED)
    found = fixed.study(args.n, args.sizes, args.frames, args.frame_n, args.launches, args.seed, folder)
    result = running.write(folder / fixed.FILE, {"launches": args.launches, "seed": args.seed}, found)
    moving.forget(folder, {row["phase"] for row in result["animation"]})
    paths = fixed_pictures.write_pictures(folder)
    paths += running.draw(folder, fixed_page.drawings(result))
    lines = [*map(fixed_page.sentence, result["rows"]), *map(moving.sentence, result["animation"])]
    bad = [r for r in (*result["rows"], *result["sweep"], *result["clearing"]) if r.get("non_finite")]
    failed = [f"{row.get('case') or row.get('settings')}: samples that are not finite" for row in bad]
    return running.end(args, result, [*lines, *paths], failed)
