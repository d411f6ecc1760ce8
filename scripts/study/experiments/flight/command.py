"""Frames a second and error along a camera's path."""

import argparse

from study.core import cli, registry, run, temporary
from study.core.cli import Outcome, StudyError
from study.experiments import running
from study.experiments.flight import tables, throttle
from study.experiments.flight.measure import ARTICLE, FASTEST, Settings, find, fly, scenes
from study.experiments.flight.schema import FILE, THROTTLE, Flight, Throttle
from study.measuring import hit_tables

DESCRIPTION = """\
Flies along the path of a scene's camera. At some places it measures the time of a frame, its error to ground
truth and its evaluations. Four programs draw each place: rods as in the article, packets alone, the
throttle's choice of rods and packets for that place, and a phase of the ladder. One thread; launches of all
four are interleaved.

--still: the throttle's choice of every setting, for scenes whose camera rests. Every choice of starting size,
smallest size, rod steps and finishing steps is rendered and held against truth. Of those within the error
asked for the fastest are timed again; the best and packets alone are then timed anew, here and in a larger
picture."""
STATUSES = {
    1: "a picture has samples that are not finite, or no setting is within the error of a still scene",
    3: "the CPU lacks what rods_simd or the phase needs",
}


def options(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("--scene", nargs="+", metavar="SCENE", help=f"default: {', '.join(scenes())}; all that rest")
    add("--phase", default=FASTEST, metavar="PHASE", help="of the ladder; default: %(default)s")
    add("--places", type=cli.at_least(1), default=6, metavar="K", help="along the path; default: 6")
    number = cli.at_least(0, float)
    about = "that the throttle's choice has to truth, at least; default: 40"
    add("--psnr", type=number, default=40.0, metavar="DB", help=about)
    about = "wrong hits of the throttle's choice, at most; default: 1000"
    add("--wrong", type=number, default=1000.0, metavar="PPM", help=about)
    add("-n", type=cli.at_least(16), metavar="HEIGHT", help="height; default: 180, of still scenes 90")
    add("--still", action="store_true", help="scenes whose camera rests, by every setting: throttle.json")
    running.height(parser, 360, "height of the larger picture of still scenes", "--large")
    running.options(parser, f"{FILE}, {THROTTLE} and figures/", "flight", 2, "the order")


def measure(args: argparse.Namespace) -> Outcome:
    for name in (throttle.PHASE, args.phase):
        if lacking := registry.missing_isa(registry.find_phase(name)):
            raise StudyError(f"{name} needs {' '.join(lacking)}, which this CPU lacks", cli.CANNOT_RUN)
    return rest(args) if args.still else moving(args)


def moving(args: argparse.Namespace) -> Outcome:
    """flight.json."""
    folder = running.folder(args, FILE)
    chosen = [find(name) for name in dict.fromkeys(args.scene or scenes())]
    how = (args.n or 180, args.places, args.launches, args.seed, args.psnr, args.wrong, args.phase)
    with temporary.folder() as scratch:
        rows = [fly(scene, Settings(*how), scratch) for scene in chosen]
    allowed = {"psnr_db": args.psnr, "wrong_ppm": args.wrong}
    result = Flight(**running.about(args), **allowed, article=ARTICLE, rows=rows)
    places = [(f"{row.scene} at {place.seconds:g} s by", place) for row in rows for place in row.places]
    ways = [(f"{name} {way.phase}", way) for name, place in places for way in place.ways]
    failed, made = hit_tables.not_finite(ways), tables.found(result)
    return running.end(folder / FILE, result, made.parts, made.drawn, failed=failed)


def rest(args: argparse.Namespace) -> Outcome:
    """throttle.json."""
    folder = running.folder(args, THROTTLE)
    chosen = [registry.find_scene(name) for name in dict.fromkeys(args.scene or registry.scenes())]
    wanted = throttle.settings()
    rows = []
    for scene in chosen:
        cli.doing(f"{scene.name}: {len(wanted)} settings")
        how = (args.psnr, args.wrong, args.launches, args.seed)
        rows.append(throttle.choose(scene, args.n or 90, *how, wanted, args.large))
    result = Throttle(**running.about(args), cpus=len(run.USABLE), rows=rows)
    none = [row.scene for row in rows if row.chosen is None]
    failed = [f"{name}: no setting is within {args.psnr:g} dB and {args.wrong:g} ppm" for name in none]
    return running.end(folder / THROTTLE, result, tables.throttle_parts(result), failed=failed)
