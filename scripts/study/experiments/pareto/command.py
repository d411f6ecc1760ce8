"""Speed against error over hit distance, step cap and approximations."""

import argparse
import time
from collections.abc import Callable

from study.core import cli, registry, run, store, temporary
from study.core.cli import Outcome, StudyError
from study.core.registry import Scene, Spec
from study.experiments import running
from study.experiments.pareto import fronts, tables
from study.experiments.pareto.measure import HIT_DISTANCES, STEPS, SWITCHES, grid, study_scene
from study.experiments.pareto.schema import FILE, Pareto
from study.measuring import hit_tables
from study.numbers.schema import Skipped

DESCRIPTION = """\
Speed against error. Every program draws every hit distance and step cap, and each picture is held against
ground truth. The front is made of the points that no other point beats in both time and error.

Each point is launched once. It is timed in full unless another point of no larger error took less than half
its time, by every measure (PSNR to either truth, false hits and misses, |Δt|). That first launch is not among
those of the full timing. With the scene's own parameters every program is timed in full. Launches are in
random order, on one thread even of phases that could use more. A launch times one frame, behind a warm-up
frame where that takes under 0.25 s."""

STATUSES = {1: "a picture has samples that are not finite"}


def options(parser: argparse.ArgumentParser) -> None:
    add, whole = parser.add_argument, cli.at_least(1)
    ladder = [name for name, phase in registry.phases().items() if phase.family == "ladder"]
    switches = [name for name in SWITCHES if name.partition("+")[0] in ladder]
    about = "default: the ladder, and the ablations that switch an approximation"
    add("--phase", nargs="+", default=ladder + switches, metavar="PHASE", help=about)
    add("--scene", nargs="+", default=list(registry.scenes()), metavar="SCENE", help="default: every scene")
    about = "besides the scene's own; default: %(default)s"
    near = cli.at_least(1e-9, float)
    add("--hit-distance", nargs="+", type=near, default=list(HIT_DISTANCES), help=about)
    add("--max-steps", nargs="+", type=whole, default=list(STEPS), help=about)
    add("-n", type=whole, default=64, metavar="HEIGHT", help="height in pixels; default: 64")
    about = "height of the 4x4 averaged pictures that fractals are judged by; default: half of -n"
    add("--antialias-n", type=whole, metavar="HEIGHT", help=about)
    add("--cpu", type=int, default=run.FASTEST, help="CPU to pin to; default: of a fast core")
    running.options(parser, "pareto.json and figures/", "pareto")


def measured(
    args: argparse.Namespace, specs: list[Spec], scenes: list[Scene], keep: Callable[[Pareto], None]
) -> Pareto:
    """`keep` is given it after each scene, with the scenes that are still to come as `unfinished`."""
    size = args.n, args.antialias_n or max(args.n // 2, 1)
    result = Pareto(**running.about(args), n=size[0], antialias_n=size[1], rows=[])
    with temporary.folder() as scratch:
        for scene in scenes:
            begun = time.monotonic()
            points = grid(scene, specs, args.hit_distance, args.max_steps)
            settings = size, args.launches, args.seed, args.cpu
            found, missing = study_scene(scene, points, *settings, scratch)
            result.rows += found
            result.skipped += missing
            result.seconds[scene.name] = round(time.monotonic() - begun, 1)
            cli.doing(f"{scene.name}: {len(found)} points, {result.seconds[scene.name]:.0f} s")
            result.unfinished = [one.name for one in scenes if one.name not in result.seconds]
            result.winners = fronts.winners(result.rows)
            keep(result)
    return result


def measure(args: argparse.Namespace) -> Outcome:
    folder = running.folder(args, FILE)
    specs, lacking = running.programs(args.phase)
    scenes = [registry.find_scene(name) for name in dict.fromkeys(args.scene)]
    run.cpu_set(args.cpu, 1)

    def keep(found: Pareto) -> None:
        """A run that is killed leaves the scenes that were done; the page says which were not."""
        if found.rows:
            store.write_json(folder / FILE, cli.plain(found))

    result = measured(args, specs, scenes, keep)
    result.skipped += [Skipped(phase=str(s), scene="any scene", reason=why) for s, why in lacking.items()]
    remarks = dict.fromkeys(f"skipped {s.phase} on {s.scene}: {s.reason}" for s in result.skipped)
    if not result.rows:
        raise StudyError("\n".join([*remarks, "nothing was measured: every point was refused"]))
    named = [(f"{row.phase} on {row.scene} at {row.hit_distance:g}", row) for row in result.rows]
    failed, made = hit_tables.not_finite(named), tables.found(result)
    return running.end(folder / FILE, result, made.parts, made.drawn, remarks=list(remarks), failed=failed)
