"""How cost grows: time, evaluations and error against n, shapes, steps, bounces and threads; memory at 4K."""

from __future__ import annotations

import argparse
from pathlib import Path

import matplotlib

from study.core import cli, registry, run, temporary
from study.core.cli import StudyError
from study.core.registry import Spec
from study.experiments import running
from study.experiments.scaling import figures as scaling_page
from study.experiments.scaling import goals as scaling_goals
from study.experiments.scaling import measure as scaling
from study.experiments.scaling import series as scaling_series
from study.numbers import power_laws as scaling_fit
from study.pictures.draw import STYLE, save

DESCRIPTION = """\
How time grows: each program is timed over picture height, number of shapes, step cap, bounces and threads, in
interleaved launches. Scenes of many shapes are made to order and cover the same share of the picture. Power
laws are fitted and set beside the paper's O(K·T·N²). What does not fit the time is left out and named. Also:
peak memory at 4K."""
SECONDS, FULL_SECONDS = 540, 14400
HEIGHT, FULL_HEIGHT = 90, 360
MEMORY_SHARE = 0.1


def arguments() -> argparse.Namespace:
    parser = cli.parser(DESCRIPTION, {1: "a picture has samples that are not finite"})
    add = parser.add_argument
    about = "all, or by name or its beginning: n, shapes, shapes-scattered, steps, bounces, threads, memory"
    add("--series", nargs="+", metavar="NAME", help=about)
    add("--phase", nargs="+", default=list(registry.ladder()), metavar="PHASE", help="default: the ladder")
    add(
        "-n",
        type=cli.at_least(16),
        metavar="HEIGHT",
        help=f"height where it is not what varies; default: {HEIGHT}",
    )
    add(
        "--budget", type=cli.at_least(1, float), metavar="SECONDS", help=f"for everything; default: {SECONDS}"
    )
    add("--full", action="store_true", help=f"n = {FULL_HEIGHT} and {FULL_SECONDS} s: nearly every point")
    add("--scene-seed", type=int, default=1, help="of the generated scenes; default: 1")
    add("--cpu", type=int, default=run.FASTEST, help="CPU to pin to; default: of a fast core")
    running.options(parser, "scaling.json, figures/, images/", "scaling")
    args = parser.parse_args()
    args.n = args.n or (FULL_HEIGHT if args.full else HEIGHT)
    args.budget = args.budget or (FULL_SECONDS if args.full else SECONDS)
    return args


def programs(names: list[str]) -> tuple[list[Spec], list[dict]]:
    """Those that can run here, and the others with the reason. Raises StudyError."""
    specs = [Spec.parse(name) for name in dict.fromkeys(names)]
    for spec in specs:
        if registry.find_phase(spec.phase).family == registry.TRUTH:
            raise StudyError(f"{spec}: is truth itself; name phases that are to be timed")
    lacking = {spec: registry.missing_isa(spec) for spec in specs}
    skipped = [
        {
            "series": "all",
            "x": 0,
            "phase": str(s),
            "reason": f"this CPU lacks {' '.join(what)}",
            "foreseen_s": None,
        }
        for s, what in lacking.items()
        if what
    ]
    able = [spec for spec in specs if not lacking[spec]]
    if not able:
        raise StudyError("no phase of these can run on this CPU", cli.CANNOT_RUN)
    return able, skipped


def measured(args: argparse.Namespace, folder: Path) -> dict:
    """Every series in its share of what is left of the time; what one does not use, the next may."""
    specs, left_out = programs(args.phase)
    scenes = registry.ROOT / "build" / "scaling" / "scenes"
    known = scaling_series.series(args.n, args.scene_seed, scenes)
    names = args.series or [*known, "memory"]
    chosen = scaling_series.chosen(known, [name for name in names if name != "memory"])
    left = args.budget * (1 - MEMORY_SHARE if "memory" in names and chosen else 1)
    rows, thumbnails = [], []
    with temporary.folder() as scratch:
        settings = scaling.Settings(args.launches, args.seed, args.cpu, scratch, folder)
        for number, series in enumerate(chosen):
            share = series.weight / sum(one.weight for one in chosen[number:])
            found = scaling.study(series, specs, left * share, settings)
            left -= found.seconds
            rows, left_out = rows + found.rows, left_out + found.left_out
            thumbnails += found.thumbnails
            cli.say(f"{series.name}: {len(found.rows)} points in {found.seconds:.0f} s")
    memory: list[dict] = []
    if "memory" in names:
        seconds = max(left, 0) + MEMORY_SHARE * args.budget
        memory, without = scaling_goals.memory(specs, rows, seconds, args.scene_seed, scenes)
        left_out += without
    if not rows:
        scaling.say_left_out(left_out)
        raise StudyError("nothing was measured: every point was left out, for the reasons above")
    return {
        "rows": rows,
        "left_out": left_out,
        "thumbnails": thumbnails,
        "fits": scaling_goals.fits(rows, known.values()),
        "memory": memory,
        "goals": scaling_goals.goals(rows, memory, [str(spec) for spec in specs]),
        "axes": {series.name: series.axis for series in chosen},
        "titles": {series.name: series.title for series in chosen},
    }


def main() -> int:
    args = arguments()
    folder = running.folder(args)
    run.cpu_set(args.cpu, 1)
    settings = {key: getattr(args, key) for key in ("n", "launches", "seed", "scene_seed", "cpu")}
    settings["seconds"] = args.budget
    found = measured(args, folder)
    settings["coverage_wanted"] = scaling_goals.scaling_scenes.COVERAGE
    result = running.write(folder / scaling.FILE, settings, found)
    figures = []
    with matplotlib.rc_context(STYLE):
        for name, figure in scaling_page.figures(result, folder).items():
            text = "" if name == scaling_page.SHEET else scaling_page.note(result)
            figures += save(figure, folder / "figures" / name, text)
    lines = [
        f"{fit['title']}, {fit['phase']}: time grows by exponent "
        f"{scaling_fit.text(fit['time']['exponent'])}; {fit['verdict']}"
        for fit in result["fits"]
    ]
    bad = [row for row in result["rows"] if row.get("non_finite")]
    failed = [f"{r['phase']} in {r['series']} at {r['x']}: {r['non_finite']} samples not finite" for r in bad]
    scaling.say_left_out(result["left_out"])
    return running.end(args, result, [*lines, *figures], failed)
