"""Frames a second on every core, gamma and 8 bits included: median, spread, error, and the goals."""

from __future__ import annotations

import argparse

from study.core import cli, registry, run, temporary
from study.core.cli import Outcome
from study.experiments import running
from study.experiments.frames import measure as frames
from study.experiments.frames import tables as frames_page

DESCRIPTION = """\
Whole frames against 60 and 30 frames a second: rendering on every core, then gamma and 8 bits. scene0 is
drawn at 1920×1080 and mandelbulb at 1280×720, each with the scene's own hit distance and with half a pixel's
footprint. The newest phases come first. What does not fit the time is named."""
SECONDS = 60


STATUSES = {cli.FAILED: "a picture has samples that are not finite, or is displayed as another"}


def options(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("--phase", nargs="+", metavar="PHASE", help="default: every phase with threads")
    add("--scene", nargs="+", default=list(frames.GOALS), metavar="SCENE", help="default: %(default)s")
    about = "height; default: 1080 and 720, which the goals are for"
    add("-n", type=cli.at_least(16), metavar="HEIGHT", help=about)
    add("--threads", type=cli.at_least(1), default=len(run.USABLE), help="default: all CPUs")
    running.budget(parser, SECONDS)
    running.options(parser, "frames.json and figures/", "frames")


def measure(args: argparse.Namespace) -> Outcome:
    folder = running.folder(args)
    specs, wanted = (
        frames.threaded(args.phase),
        frames.cases(args.scene, registry.ROOT / "build" / "frames" / "scenes", args.n),
    )
    with temporary.folder() as scratch:
        settings = {key: getattr(args, key) for key in ("launches", "threads", "seed")}
        settings["seconds"] = args.budget
        found = frames.study(specs, wanted, frames.Settings(**settings, scratch=scratch))
    result = running.write(folder / frames.FILE, settings, found)
    paths = running.draw(folder, frames_page.drawings(result))
    bad = [
        f"{row['phase']} on {row['scene']}: {row['non_finite']} samples not finite, "
        f"{row['displayed_otherwise']} bytes displayed otherwise than the picture's"
        for row in result["rows"]
        if row["non_finite"] or row["displayed_otherwise"]
    ]
    left = [f"left out {row['phase']} {row.get('scene', '')}: {row['reason']}" for row in result["left_out"]]
    lines = [*map(frames_page.sentence, result["rows"]), *paths]
    return Outcome(result, lines, folder, left, bad)
