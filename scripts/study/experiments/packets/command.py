"""The packet ray tracer: rays a second beside Embree on the same rays, and against sphere tracing."""

from __future__ import annotations

import argparse
import secrets
import time
from pathlib import Path

import matplotlib

from study.core import cli, machine, registry, store
from study.experiments.functions import measure as functions
from study.experiments.moving import measure as moving
from study.experiments.packets import figures as packets_figures
from study.experiments.packets import measure as packets
from study.experiments.packets import moving_tables as packets_moving
from study.experiments.packets import pictures as packets_pictures
from study.experiments.packets import rays as packets_rays
from study.experiments.packets import tables as packets_page
from study.pictures.draw import STYLE, save

DESCRIPTION = """\
Rays a second of phase packets: of the camera, to the light, mirrored, in any direction; by tree, number of
lanes and root; beside Embree, where it was there to build with, on the same rays by turns, hit by hit
compared. The article's own benchmark, normalising vectors. Ray tracing against sphere tracing on the same
scenes: time to equal error. Then frame times of an animation, the tree built anew for each frame, and the
pictures beside their difference to truth."""


def arguments() -> argparse.Namespace:
    parser = cli.parser(DESCRIPTION, {1: "a picture has samples that are not finite, or hits differ"})
    add = parser.add_argument
    add(
        "--ray-n",
        type=cli.at_least(16),
        default=360,
        metavar="HEIGHT",
        help="height of the rays' picture: 360",
    )
    add(
        "-n",
        type=cli.at_least(16),
        default=180,
        metavar="HEIGHT",
        help="height of the pictures; default: 180",
    )
    add("--frames", type=cli.at_least(2), default=900,
        help="of the animation by the phase's own tree on every core, a quarter of them else; default: 900, "
        "as scripts/stepwise fixed has")  # fmt: skip
    add("--frame-n", type=cli.at_least(16), default=1080, metavar="HEIGHT", help="its height; default: 1080")
    add("--launches", type=cli.at_least(2), default=6, help="process launches of each; default: 6")
    add("--reps", type=cli.at_least(1), default=5, help="of the rays in each; default: 5")
    add(
        "--vectors",
        type=cli.at_least(1024),
        default=functions.VECTORS,
        metavar="N",
        help="that the article's own benchmark normalises; default: 20,000,000",
    )
    add("--seed", type=int, help="of rays and order; default: random")
    add("--run", type=Path, metavar="DIR", help="for packets.json, images/, figures/; default: build/systems")
    about = "go on with the animation of a run that was interrupted: its frames are kept in --run"
    add("--resume", action="store_true", help=about)
    args = parser.parse_args()
    args.seed = secrets.randbelow(2**32) if args.seed is None else args.seed
    return args


def main() -> int:
    args = arguments()
    folder = store.writable(args.run or registry.ROOT / "build" / "systems")
    if not args.resume:
        moving.forget(folder, ["packets"])
    begun = time.monotonic()
    made = store.writable(registry.ROOT / "build" / "systems" / "scenes")
    animation = packets_moving.study(args.frames, args.frame_n, folder)  # first: may refuse a size
    found = packets.study(made, args.ray_n, args.n, args.launches, args.reps, args.seed)
    found["animation"] = animation
    found["normalise"] = packets.normalised(args.vectors, args.seed)
    about = {"launches": args.launches, "reps": args.reps, "seed": args.seed}
    about["took_s"] = time.monotonic() - begun
    result = cli.plain({"schema": 1, **about, "context": machine.context(), **found})
    store.write_json(folder / packets.FILE, result)
    moving.forget(folder, ["packets"])
    paths = packets_pictures.write_pictures(folder, packets_rays.scenes(made), args.n)
    with matplotlib.rc_context(STYLE):
        for name, drawing in packets_figures.drawings(result).items():
            paths += save(drawing.make(), folder / "figures" / name, drawing.note)
    if args.json:
        cli.emit(result, folder)
    else:
        lines = [*packets_page.sentences(result), *packets_moving.sentences(result), *map(str, paths)]
        print("\n".join(lines))
    bad = packets_page.faults(result)
    for text in bad:
        cli.say(f"FAIL {text}")
    return cli.FAILED if bad else cli.OK
