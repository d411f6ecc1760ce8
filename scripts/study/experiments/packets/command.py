"""The packet ray tracer: rays a second beside Embree on the same rays, and against sphere tracing."""

from __future__ import annotations

import argparse

from study.core import cli, registry, store
from study.core.cli import Outcome
from study.experiments import running
from study.experiments.packets import figures, normalise, pictures, tables
from study.experiments.packets import measure as packets
from study.experiments.packets.schema import FILE, Packets
from study.measuring import animation_tables

DESCRIPTION = """\
Rays a second of phase packets: of the camera, to the light, mirrored, in any direction; by tree, number of
lanes and root; beside Embree, where it was there to build with, on the same rays by turns, hit by hit
compared. The article's own benchmark, normalising vectors. Ray tracing against sphere tracing on the same
scenes: time to equal error. Then frame times of an animation, the tree built anew for each frame, and the
pictures beside their difference to truth."""
STATUSES = {1: "a picture has samples that are not finite, or hits differ"}


def options(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    running.height(parser, 360, "height of the rays' picture", "--ray-n")
    running.height(parser, 180, "height of the pictures")
    about = "of the animation by the phase's own tree on every core, a quarter of them else; default: 900"
    add("--frames", type=cli.at_least(2), default=900, help=about)
    running.height(parser, 1080, "its height", "--frame-n")
    add("--reps", type=cli.at_least(1), default=5, help="of the rays in each; default: 5")
    about = "that the article's own benchmark normalises; default: 20,000,000"
    add("--vectors", type=cli.at_least(1024), default=normalise.VECTORS, metavar="N", help=about)
    running.options(parser, f"{FILE}, images/, figures/", "systems", 2, "rays and order")


def measure(args: argparse.Namespace) -> Outcome:
    folder = running.folder(args)
    made = store.writable(registry.ROOT / "build" / "systems" / "scenes")
    animation = packets.animated(args.frames, args.frame_n)  # first: may refuse a size
    found = packets.study(made, args.ray_n, args.n, args.launches, args.reps, args.seed)
    found |= {"animation": animation, "normalise": normalise.measured(args.vectors, args.seed)}
    about = {"launches": args.launches, "reps": args.reps, "seed": args.seed, "article": normalise.ARTICLE}
    running.write(folder / FILE, about, found)
    result = Packets.load(folder / FILE)
    paths = pictures.write_pictures(folder, args.n)
    paths += running.draw(folder, figures.drawings(result))
    lines = [*tables.sentences(result), *map(animation_tables.sentence, result.animation), *paths]
    return Outcome(result, lines, folder, failed=tables.faults(result))
