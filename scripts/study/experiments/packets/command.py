"""The packet ray tracer: rays a second beside Embree on the same rays, and against sphere tracing."""

from __future__ import annotations

import argparse

from study.core import cli, registry, store
from study.experiments import running
from study.experiments.functions import measure as functions
from study.experiments.moving import measure as moving
from study.experiments.packets import figures as packets_figures
from study.experiments.packets import measure as packets
from study.experiments.packets import moving_tables as packets_moving
from study.experiments.packets import pictures as packets_pictures
from study.experiments.packets import tables as packets_page
from study.measuring import rays as packets_rays

DESCRIPTION = """\
Rays a second of phase packets: of the camera, to the light, mirrored, in any direction; by tree, number of
lanes and root; beside Embree, where it was there to build with, on the same rays by turns, hit by hit
compared. The article's own benchmark, normalising vectors. Ray tracing against sphere tracing on the same
scenes: time to equal error. Then frame times of an animation, the tree built anew for each frame, and the
pictures beside their difference to truth."""


def arguments() -> argparse.Namespace:
    parser = cli.parser(DESCRIPTION, {1: "a picture has samples that are not finite, or hits differ"})
    add = parser.add_argument
    running.height(parser, 360, "height of the rays' picture", "--ray-n")
    running.height(parser, 180, "height of the pictures")
    add("--frames", type=cli.at_least(2), default=900,
        help="of the animation by the phase's own tree on every core, a quarter of them else; default: 900, "
        "as scripts/stepwise fixed has")  # fmt: skip
    running.height(parser, 1080, "its height", "--frame-n")
    add("--reps", type=cli.at_least(1), default=5, help="of the rays in each; default: 5")
    add(
        "--vectors",
        type=cli.at_least(1024),
        default=functions.VECTORS,
        metavar="N",
        help="that the article's own benchmark normalises; default: 20,000,000",
    )
    running.options(parser, "packets.json, images/, figures/", "systems", 2, "rays and order")
    about = "go on with the animation of a run that was interrupted: its frames are kept in --run"
    add("--resume", action="store_true", help=about)
    return parser.parse_args()


def main() -> int:
    args = arguments()
    folder = running.folder(args)
    if not args.resume:
        moving.forget(folder, ["packets"])
    made = store.writable(registry.ROOT / "build" / "systems" / "scenes")
    animation = packets_moving.study(args.frames, args.frame_n, folder)  # first: may refuse a size
    found = packets.study(made, args.ray_n, args.n, args.launches, args.reps, args.seed)
    found["animation"] = animation
    found["normalise"] = packets.normalised(args.vectors, args.seed)
    about = {"launches": args.launches, "reps": args.reps, "seed": args.seed}
    result = running.write(folder / packets.FILE, about, found)
    moving.forget(folder, ["packets"])
    paths = packets_pictures.write_pictures(folder, packets_rays.scenes(made), args.n)
    paths += running.draw(folder, packets_figures.drawings(result))
    lines = [*packets_page.sentences(result), *packets_moving.sentences(result), *paths]
    return running.end(args, result, lines, packets_page.faults(result))
