"""Displayed frames a second on every core: median, spread, error."""

import argparse

from study.core import cli, registry, run, temporary
from study.core.cli import Outcome
from study.experiments import running
from study.experiments.frames import tables
from study.experiments.frames.measure import HEIGHTS, Settings, cases, study, threaded
from study.experiments.frames.schema import FILE, Frames

DESCRIPTION = """\
Whole frames: rendering on every core, then gamma and 8 bits. scene0 at 1920×1080 and mandelbulb at 1280×720,
each with the scene's own hit distance and with half a pixel's. The newest phases come first."""
SECONDS = 60
STATUSES = {cli.FAILED: "a picture has samples that are not finite, or is displayed as another"}


def options(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("--phase", nargs="+", metavar="PHASE", help="default: every phase with threads")
    add("--scene", nargs="+", default=list(HEIGHTS), metavar="SCENE", help="default: %(default)s")
    add("-n", type=cli.at_least(16), metavar="HEIGHT", help="height; default: 1080 and 720")
    add("--threads", type=cli.at_least(1), default=len(run.USABLE), help="default: all CPUs")
    running.budget(parser, SECONDS)
    running.options(parser, "frames.json and figures/", "frames")


def measure(args: argparse.Namespace) -> Outcome:
    folder = running.folder(args, FILE)
    specs = threaded(args.phase)
    wanted = cases(args.scene, registry.ROOT / "build" / "frames" / "scenes", args.n)
    with temporary.folder() as scratch:
        settings = Settings(args.launches, args.threads, args.seed, args.budget, scratch)
        found = study(specs, wanted, settings)
    result = Frames(**running.about(args), threads=args.threads, seconds=args.budget, **found)
    bad = [
        f"{row.phase} on {row.scene}: {row.non_finite} samples not finite, "
        f"{row.displayed_otherwise} bytes displayed otherwise than the picture's"
        for row in result.rows
        if row.non_finite or row.displayed_otherwise
    ]
    made = tables.found(result)
    return running.end(folder / FILE, result, made.parts, made.drawn, failed=bad)
