"""Frames a second on every core, gamma and 8 bits included: median, spread, error, and the goals."""

from __future__ import annotations

import argparse
import secrets
import time
from pathlib import Path

import matplotlib

from study.core import cli, machine, registry, run, store, temporary
from study.experiments.frames import measure as frames
from study.experiments.frames import tables as frames_page
from study.pictures.draw import STYLE, save

DESCRIPTION = """\
Whole frames (rendering on every core, then gamma and 8 bits) of scene0 at 1920×1080 and of mandelbulb at
1280×720, with the scene's own hit distance and with half a pixel's footprint, against 60 and 30 frames a
second. The newest phases come first; what does not fit the time is said."""
SECONDS = 60


def arguments() -> argparse.Namespace:
    parser = cli.parser(
        DESCRIPTION, {1: "a picture has samples that are not finite, or is displayed as another"}
    )
    add = parser.add_argument
    add("--phase", nargs="+", metavar="PHASE", help="default: every phase with threads")
    add("--scene", nargs="+", default=list(frames.GOALS), metavar="SCENE", help="default: %(default)s")
    add(
        "-n",
        type=cli.at_least(16),
        metavar="HEIGHT",
        help="height; default: 1080 and 720, which the goals are for",
    )
    add("--launches", type=cli.at_least(1), default=6, help="process launches of each; default: 6")
    add("--threads", type=cli.at_least(1), default=len(run.USABLE), help="default: all CPUs")
    add(
        "--budget",
        type=cli.at_least(1, float),
        default=SECONDS,
        metavar="SECONDS",
        help="for all; default: %(default)s",
    )
    add("--seed", type=int, help="of order and padding; default: random")
    add("--run", type=Path, metavar="DIR", help="for frames.json and figures/; default: build/frames")
    args = parser.parse_args()
    args.seed = secrets.randbelow(2**32) if args.seed is None else args.seed
    return args


def main() -> int:
    args = arguments()
    folder = store.writable(args.run or registry.ROOT / "build" / "frames")
    specs, wanted = (
        frames.threaded(args.phase),
        frames.cases(args.scene, registry.ROOT / "build" / "frames" / "scenes", args.n),
    )
    begun = time.monotonic()
    with temporary.folder() as scratch:
        settings = {key: getattr(args, key) for key in ("launches", "threads", "seed")}
        settings["seconds"] = args.budget
        found = frames.study(specs, wanted, frames.Settings(**settings, scratch=scratch))
    about = {"took_s": time.monotonic() - begun, "context": machine.context()}
    result = cli.plain({"schema": 1, **settings, **about, **found})
    store.write_json(folder / frames.FILE, result)
    paths = []
    with matplotlib.rc_context(STYLE):
        for name, drawing in frames_page.drawings(result).items():
            paths += save(drawing.make(), folder / "figures" / name, drawing.note)
    if args.json:
        cli.emit(result, folder)
    else:
        for row in result["rows"]:
            print(frames_page.sentence(row))
        print("\n".join(map(str, paths)))
    for row in result["left_out"]:
        cli.say(f"left out {row['phase']} {row.get('scene', '')}: {row['reason']}")
    bad = [row for row in result["rows"] if row["non_finite"] or row["displayed_otherwise"]]
    for row in bad:
        why = (
            f"{row['non_finite']} samples not finite, {row['displayed_otherwise']} bytes displayed otherwise"
        )
        cli.say(f"FAIL {row['phase']} on {row['scene']}: {why} than the picture's")
    return cli.FAILED if bad else cli.OK
