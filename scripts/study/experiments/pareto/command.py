"""Speed against error: each phase over hit distance × step cap × approximations, and the front."""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable
from pathlib import Path

import matplotlib

from study.core import cli, machine, registry, run, store, temporary
from study.core.cli import StudyError
from study.core.registry import Scene, Spec
from study.experiments import running
from study.experiments.pareto import fronts as pareto
from study.experiments.pareto import measure as measuring
from study.experiments.pareto import tables as pareto_page
from study.pictures.draw import STYLE, save

DESCRIPTION = """\
Speed against error. Every program draws every hit distance and step cap, and each picture is held against
ground truth. The front is made of the points that no other point beats in both time and error.

Each point is launched once. It is timed in full unless another point of no larger error took less than half
its time, by every measure (PSNR to either truth, false hits and misses, |Δt|). That first launch is not among
those of the full timing. With the scene's own parameters every program is timed in full. Launches are in
random order, on one thread even of phases that could use more. A launch times one frame, behind a warm-up
frame where that takes under 0.25 s."""


def length(text: str) -> float:
    """What the loader takes as a hit distance, in scene units."""
    try:
        value = float(text)
    except ValueError:
        value = 0
    if not 1e-9 <= value <= 1e9:
        raise argparse.ArgumentTypeError(f"'{text}': must be a length of 1e-9 to 1e9")
    return value


def arguments() -> argparse.Namespace:
    parser = cli.parser(DESCRIPTION, {1: "a picture has samples that are not finite"})
    add = parser.add_argument
    ladder = [name for name, phase in registry.phases().items() if phase.family == "ladder"]
    switches = [name for name in measuring.SWITCHES if name.partition("+")[0] in ladder]
    about = "default: the ladder, and the ablations that switch an approximation"
    add("--phase", nargs="+", default=ladder + switches, metavar="PHASE", help=about)
    add("--scene", nargs="+", default=list(registry.scenes()), metavar="SCENE", help="default: every scene")
    about = "besides the scene's own; default: %(default)s"
    add("--hit-distance", nargs="+", type=length, default=list(measuring.HIT_DISTANCES), help=about)
    add("--max-steps", nargs="+", type=cli.at_least(1), default=list(measuring.STEPS), help=about)
    sizes = ", ".join(map(str, measuring.HEIGHTS))
    about = f"height in pixels; default: the first of {sizes} that the budget has time for"
    add("-n", type=cli.at_least(1), metavar="HEIGHT", help=about)
    about = "height of the 4x4 averaged pictures that fractals are judged by; default: half of -n"
    add("--antialias-n", type=cli.at_least(1), metavar="HEIGHT", help=about)
    running.budget(parser, 600)
    add("--cpu", type=int, default=run.FASTEST, help="CPU to pin to; default: of a fast core")
    running.options(parser, "pareto.json and figures/", "pareto")
    return parser.parse_args()


def heights(args: argparse.Namespace, specs: list[Spec], scenes: list[Scene]) -> tuple[int, int]:
    """Of timed pictures, and of the averaged ones of fractals: as asked for, or what the budget allows."""
    counts = {s.name: len(measuring.grid(s, specs[:1], args.hit_distance, args.max_steps)) for s in scenes}
    frames = measuring.trial(specs, scenes)
    for n in [args.n] if args.n else measuring.HEIGHTS:
        pair = n, args.antialias_n or max(n // 2, 1)
        seconds = measuring.estimate(frames, scenes, counts, pair, args.launches)
        if seconds <= args.budget:
            break
    cli.say(f"n = {pair[0]}: about {seconds:.0f} s")
    return pair


def measure(
    args: argparse.Namespace, specs: list[Spec], scenes: list[Scene], keep: Callable[[dict], None]
) -> dict:
    """What pareto.json has of the measurement itself: rows, what was refused, seconds by scene.

    `keep` is given it after each scene, with the scenes that are still to come as `unfinished`.
    """
    size = heights(args, specs, scenes)
    rows: list[dict] = []
    skipped: list[dict] = []
    seconds = {}
    with temporary.folder() as scratch:
        for scene in scenes:
            begun = time.monotonic()
            points = measuring.grid(scene, specs, args.hit_distance, args.max_steps)
            settings = size, args.launches, args.seed, args.cpu
            found, missing = measuring.study_scene(scene, points, *settings, scratch)
            rows, skipped = rows + found, skipped + missing
            seconds[scene.name] = round(time.monotonic() - begun, 1)
            cli.say(f"{scene.name}: {len(found)} points, {seconds[scene.name]:.0f} s")
            left = [one.name for one in scenes if one.name not in seconds]
            about = {"n": size[0], "antialias_n": size[1], "seconds": dict(seconds), "unfinished": left}
            result = about | {"rows": rows, "skipped": skipped}
            keep(result)
    return result


def concluded(result: dict) -> dict:
    """With what its rows support."""
    rows = result["rows"]
    winners = pareto.winners(rows)
    sentences = [pareto.sentence(winner) for winner in winners]
    return result | {"winners": winners, "sentences": sentences, "summary": pareto.summary(winners, rows)}


def figures(result: dict, folder: Path) -> list[Path]:
    """One figure per measure that any row has."""
    made = []
    with matplotlib.rc_context(STYLE):
        for measure, name in pareto_page.FIGURES.items():
            rows = [row for row in result["rows"] if not math.isnan(pareto.badness(row, measure))]
            if rows:
                note = pareto_page.note(result, measure)
                made += save(pareto_page.figure(rows, measure), folder / name, note)
    return made


def main() -> int:
    args = arguments()
    folder = running.folder(args)
    specs = [Spec.parse(name) for name in dict.fromkeys(args.phase)]
    scenes = [registry.find_scene(name) for name in dict.fromkeys(args.scene)]
    lacking = {spec: registry.missing_isa(spec) for spec in specs}
    run.cpu_set(args.cpu, 1)
    able = [spec for spec in specs if not lacking[spec]]
    if not able:
        raise StudyError("no phase of these can run on this CPU", cli.CANNOT_RUN)
    result = {"schema": 1, "launches": args.launches, "seed": args.seed, "cpu": args.cpu}
    result["context"] = machine.context()

    def keep(found: dict) -> None:
        """A run that is killed leaves the scenes that were done; the page says which were not."""
        if found["rows"]:
            store.write_json(folder / pareto.FILE, concluded(result | found))

    result |= measure(args, able, scenes, keep)
    rows, skipped = result["rows"], result["skipped"]
    for spec in specs:
        if what := " ".join(lacking[spec]):
            reason = f"this CPU lacks {what}"
            skipped.append({"phase": str(spec), "scene": "any scene", "reason": reason})
    if not rows:
        pareto.say_missing(skipped)
        raise StudyError("nothing was measured: every point was refused, for the reasons above")
    result = concluded(result)
    store.write_json(folder / pareto.FILE, result)
    drawn = figures(result, folder / "figures")
    pareto.say_missing(skipped)
    bad = [row for row in rows if row["non_finite"]]
    failed = [f"{row['phase']} on {row['scene']} at {row['hit_distance']:g}: not finite" for row in bad]
    return running.end(args, result, [*result["sentences"], *result["summary"], *drawn], failed)
