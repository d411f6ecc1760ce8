"""Frames a second and error along a camera's path: by rods, packets, both, and a phase of the ladder."""

from __future__ import annotations

import argparse

from study.core import cli, registry, temporary
from study.core.cli import StudyError
from study.experiments import running
from study.experiments.flight import measure as flight
from study.experiments.flight import tables as page

DESCRIPTION = """\
Flies along the path of a scene's camera. At some places it measures the time of a frame, its error to ground
truth and its evaluations. Four programs draw each place: rods as in the article, packets alone, the
throttle's choice of rods and packets for that place, and a phase of the ladder. One thread; launches of all
four are interleaved."""


def arguments() -> argparse.Namespace:
    parser = cli.parser(
        DESCRIPTION, {1: "a picture has samples that are not finite", 3: "the CPU lacks AVX2"}
    )
    add = parser.add_argument
    add("--scene", nargs="+", default=list(flight.scenes()), metavar="SCENE", help="default: %(default)s")
    add("--phase", default=flight.FASTEST, metavar="PHASE", help="of the ladder; default: %(default)s")
    add("--places", type=cli.at_least(1), default=6, metavar="K", help="along the path; default: 6")
    decibels, ppm = cli.at_least(0, float), cli.at_least(0, float)
    add(
        "--psnr",
        type=decibels,
        default=40.0,
        metavar="DB",
        help="that the throttle's choice has to truth, at least; default: 40",
    )
    add(
        "--wrong",
        type=ppm,
        default=1000.0,
        metavar="PPM",
        help="wrong hits of the throttle's choice, at most; default: 1000",
    )
    running.height(parser, 180)
    running.options(parser, "flight.json and figures/", "flight", 2, "the order")
    return parser.parse_args()


def main() -> int:
    args = arguments()
    for name in ("rods_simd", args.phase):
        if lacking := registry.missing_isa(registry.find_phase(name)):
            raise StudyError(f"{name} needs {' '.join(lacking)}, which this CPU lacks", cli.CANNOT_RUN)
    folder = running.folder(args)
    scenes = [flight.find(name) for name in dict.fromkeys(args.scene)]
    how = (args.n, args.places, args.launches, args.seed, args.psnr, args.wrong, args.phase)
    with temporary.folder() as scratch:
        found = flight.study(scenes, flight.Settings(*how), scratch)
    result = running.write(folder / flight.FILE, {"launches": args.launches, "seed": args.seed}, found)
    paths = running.draw(folder, page.drawings(result))
    bad = [
        f"{row['scene']} at {place['seconds']:g} s by {way['phase']}: samples that are not finite"
        for row in result["rows"]
        for place in row["places"]
        for way in place["ways"]
        if way["non_finite"]
    ]
    lines = [page.sentence(row) for row in result["rows"]]
    return running.end(args, result, [*lines, *paths, folder / flight.FILE], bad)
