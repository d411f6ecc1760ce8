"""Every rung against its parent on all scenes and on three further views of each: median and worst case."""

from __future__ import annotations

import argparse
from pathlib import Path

import matplotlib
import numpy as np

from study.core import cli, registry, run, temporary
from study.core.cli import StudyError
from study.core.registry import Spec
from study.core.run import DriverError
from study.experiments import running
from study.experiments.views import figures as views_page
from study.experiments.views import gains as views_gains
from study.experiments.views import measure as views_measure
from study.experiments.views import tables as views_tables
from study.measuring import views
from study.measuring.views import View
from study.pictures import images
from study.pictures.draw import STYLE, save

DESCRIPTION = """\
Was a rung tuned to one view? Its constants may suit the own views of scene0 and mandelbulb alone. Here every
scene is drawn from four places, and each rung is timed in interleaved launches with its parent. A rung that
is faster where it was tuned and not elsewhere is named. The newest rungs come first; what does not fit the
time is named too."""
SECONDS = 150


def arguments() -> argparse.Namespace:
    parser = cli.parser(DESCRIPTION, {1: "a program crashed, or a picture has samples that are not finite"})
    add = parser.add_argument
    add("--phase", nargs="+", default=list(registry.ladder()), metavar="PHASE", help="rungs; default: all")
    add("--scene", nargs="+", default=list(registry.scenes()), metavar="SCENE", help="default: all")
    running.height(parser, 90, "height of what is timed", least=8)
    running.height(parser, 45, "of what is held against ground truth", "--error-n", 8)
    add(
        "--reps",
        type=cli.at_least(1),
        default=1,
        help="timed frames of a launch at least, and 20 ms of them; default: 1",
    )
    add(
        "--budget", type=cli.at_least(1, float), metavar="SECONDS", help=f"for everything; default: {SECONDS}"
    )
    add("--full", action="store_true", help="every rung, however long that takes")
    add("--cpu", type=int, default=run.FASTEST, help="CPU to pin to; default: of a fast core")
    running.options(parser, "views.json, figures/, images/", "views")
    args = parser.parse_args()
    args.budget = args.budget or (float("inf") if args.full else SECONDS)
    return args


def thumbnails(scenes: list[View], folder: Path, height: int = 135) -> list[dict]:
    """A small picture of each view by the last rung that can; what none can render is left out."""
    made = []
    able = [name for name in registry.ladder() if registry.cpu_supports(Spec.parse(name))]
    with temporary.folder() as scratch:
        for view in scenes:
            path = scratch / "picture.exr"
            for name in [*reversed(able)]:
                try:
                    run.render(name, view.scene.path, height, view.size(height)[0], out=path)
                except DriverError:
                    continue
                picture = f"images/view-{view.base}-{view.name}.png"
                linear = np.nan_to_num(images.rgb(images.read(path)))
                images.write_png(folder / picture, images.to_display(linear))
                about = {"scene": view.base, "view": view.name, "change": view.change, "tuned": view.tuned}
                made.append(about | {"picture": picture})
                break
    return made


def measured(args: argparse.Namespace, folder: Path) -> dict:
    """Raises StudyError, where nothing could be measured too."""
    rungs = views_measure.parents(args.phase)
    if not rungs:
        raise StudyError(f"{' '.join(args.phase)}: no rung with a parent, which it would be held against")
    scenes, left_out = [], []
    for name in dict.fromkeys(args.scene):
        try:
            scenes += views.of(registry.find_scene(name), registry.ROOT / "build" / "views" / "scenes")
        except StudyError as error:
            if name not in registry.scenes():
                raise
            left_out.append({"phase": "all", "scene": name, "view": "all", "reason": str(error)})
    with temporary.folder() as scratch:
        settings = views_measure.Settings(
            **{key: getattr(args, key) for key in ("n", "error_n", "launches", "reps", "seed", "cpu")},
            **{"seconds": args.budget, "jobs": len(run.USABLE), "scratch": scratch},
        )
        found = views_measure.study(rungs, scenes, settings)
    found["left_out"] = left_out + found["left_out"]
    return {**found, "rungs": views_gains.rungs(found["rows"]), "thumbnails": thumbnails(scenes, folder)}


def main() -> int:
    args = arguments()
    folder = running.folder(args)
    run.cpu_set(args.cpu, 1)
    keys = ("n", "error_n", "launches", "reps", "seed", "cpu")
    found = measured(args, folder)
    settings = {key: getattr(args, key) for key in keys} | {
        "seconds": args.budget,
        "reference": registry.BASE,
    }
    result = running.write(folder / views_measure.FILE, settings, found)
    figures = []
    with matplotlib.rc_context(STYLE):
        for name, figure in views_page.figures(result, folder).items():
            text = "" if name == views_page.SHEET else views_page.note(result)
            figures += save(figure, folder / "figures" / name, text)
    lines = []
    for rung in result["rungs"]:
        cells = [column.text(rung) for column in views_tables.RUNGS]
        lines.append(f"{rung['phase']}: median {cells[3]}, worst {cells[4]} ({rung['verdict']})")
    return running.end(args, result, [*lines, *figures], failed(result), left_out(result))


def left_out(result: dict) -> list[str]:
    return [
        f"left out {row['phase']}"
        + (f" on {row['scene']} {row['view']}" if "scene" in row else "")
        + f": {row['reason']}"
        for row in result["left_out"]
    ]


def failed(result: dict) -> list[str]:
    """Programs that crashed, and pictures that are not finite."""
    rows = [row for row in result["rows"] if row["non_finite"]]
    bad = [row | {"reason": f"{row['non_finite']} samples not finite"} for row in rows]
    return [f"{r['phase']} on {r['scene']} {r['view']}: {r['reason']}" for r in [*result["failures"], *bad]]
