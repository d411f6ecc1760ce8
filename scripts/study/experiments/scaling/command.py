"""How time and error grow with n, shapes, steps, bounces and threads."""

import argparse
import time

from study.core import cli, registry, run, temporary
from study.core.cli import Outcome, StudyError
from study.experiments import running
from study.experiments.scaling import tables
from study.experiments.scaling.measure import Settings, crowds, fits, study
from study.experiments.scaling.schema import LeftOut, Scaling
from study.experiments.scaling.series import chosen, series
from study.measuring import hit_tables

DESCRIPTION = """\
Each program is timed over picture height, number of shapes, step cap, bounces and threads, in interleaved
launches. Power laws are fitted and set beside the paper's O(K·T·N²). What does not fit the time is named."""
STATUSES = {cli.FAILED: "a picture has samples that are not finite"}
FILE = "scaling.json"
SECONDS, FULL_SECONDS = 540.0, 14400.0
HEIGHT, FULL_HEIGHT = 90, 360


def options(parser: argparse.ArgumentParser) -> None:
    add, ladder = parser.add_argument, list(registry.ladder())
    about = "all, or by name or its beginning: n, shapes, shapes-scattered, steps, bounces, threads"
    add("--series", nargs="+", metavar="NAME", help=about)
    add("--phase", nargs="+", default=ladder, metavar="PHASE", help="default: the ladder")
    add("-n", type=cli.at_least(16), metavar="HEIGHT", help=f"where it does not vary; default: {HEIGHT}")
    running.budget(parser, SECONDS, full=True)
    add("--full", action="store_true", help=f"n = {FULL_HEIGHT} and {FULL_SECONDS:g} s: nearly every point")
    add("--scene-seed", type=int, default=1, help="of the generated scenes; default: 1")
    add("--cpu", type=int, default=run.FASTEST, help="CPU to pin to; default: of a fast core")
    running.options(parser, f"{FILE}, figures/", "scaling")


def measure(args: argparse.Namespace) -> Outcome:
    """Every series in its share of what is left of the time; what one does not use, the next may."""
    folder = running.folder(args, FILE)
    run.cpu_set(args.cpu, 1)
    height = args.n or (FULL_HEIGHT if args.full else HEIGHT)
    seconds = args.budget or (FULL_SECONDS if args.full else SECONDS)
    specs, unable = running.programs(args.phase)
    left_out = [LeftOut(series="all", x=0, phase=str(spec), reason=why) for spec, why in unable.items()]
    scenes = registry.ROOT / "build" / "scaling" / "scenes"
    known = series(height, args.scene_seed, scenes)
    wanted = chosen(known, args.series or [*known])
    left = seconds
    rows: list = []
    with temporary.folder() as scratch:
        settings = Settings(args.launches, args.seed, args.cpu, scratch)
        for number, one in enumerate(wanted):
            begun = time.monotonic()
            share = one.weight / sum(other.weight for other in wanted[number:])
            found, without = study(one, specs, left * share, settings)
            took = time.monotonic() - begun
            left -= took
            rows, left_out = rows + found, left_out + without
            cli.doing(f"{one.name}: {len(found)} points in {took:.0f} s")
    if not rows:
        reasons = "; ".join(dict.fromkeys(one.reason for one in left_out))
        raise StudyError(f"nothing was measured: {reasons}")
    result = Scaling(
        **running.about(args),
        n=height,
        seconds=seconds,
        scene_seed=args.scene_seed,
        rows=rows,
        left_out=left_out,
        fits=fits(rows, known.values()),
        goals=crowds(rows, [str(spec) for spec in specs]),
        axes={one.name: one.axis for one in wanted},
        titles={one.name: one.title for one in wanted},
    )
    failed = hit_tables.not_finite([(f"{row.phase} in {row.series} at {row.x:g}", row) for row in rows])
    first = {(row.series, row.phase): row for row in reversed(left_out)}
    names = {f"{row.phase} in {row.series} from {row.x:g} on": row for row in first.values()}
    long = [name for name, row in names.items() if row.foreseen_s]
    remarks = [f"left out, for the time did not last: {', '.join(long)}"] * bool(long)
    remarks += [f"left out {name}: {row.reason}" for name, row in names.items() if not row.foreseen_s]
    made = tables.found(result)
    return running.end(folder / FILE, result, made.parts, made.drawn, remarks=remarks, failed=failed)
