"""The packet ray tracer beside Embree and against sphere tracing."""

import argparse

from study.core import cli, registry, store
from study.core.cli import Outcome
from study.experiments import running
from study.experiments.packets import tables
from study.experiments.packets.measure import ARTICLE, normalised, study
from study.experiments.packets.schema import FILE, Packets
from study.measuring.function_bench import VECTORS

DESCRIPTION = """\
Rays a second of phase packets by tree, lanes and root, beside Embree on the same rays, hit by hit compared;
the article's own benchmark, normalising vectors; ray tracing against sphere tracing: time to equal error."""
STATUSES = {1: "a picture has samples that are not finite, or hits differ"}


def options(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    running.height(parser, 360, "height of the rays' picture", "--ray-n")
    running.height(parser, 180, "height of the pictures")
    add("--reps", type=cli.at_least(1), default=5, help="of the rays in each; default: 5")
    about = "that the article's own benchmark normalises; default: 20,000,000"
    add("--vectors", type=cli.at_least(1024), default=VECTORS, metavar="N", help=about)
    running.options(parser, f"{FILE}, figures/", "systems", 2, "rays and order")


def measure(args: argparse.Namespace) -> Outcome:
    folder = running.folder(args, FILE)
    made = store.writable(registry.ROOT / "build" / "systems" / "scenes")
    found = study(made, args.ray_n, args.n, args.launches, args.reps, args.seed)
    about = running.about(args) | {"reps": args.reps, "article": ARTICLE}
    result = Packets(**about, **found, normalise=normalised(args.vectors, args.seed))
    drawn, failed = tables.drawings(result), tables.faults(result)
    return running.end(folder / FILE, result, tables.parts(result), drawn, failed=failed)
