"""Every phase against its parent, from three more views of each scene."""

import argparse
import math

from study.core import cli, registry, run, temporary
from study.core.cli import Outcome, StudyError
from study.experiments import running
from study.experiments.section import where
from study.experiments.views import gains, tables
from study.experiments.views.measure import Settings, parents, study
from study.experiments.views.schema import LeftOut, Views
from study.measuring import hit_tables, views

DESCRIPTION = """\
Was a phase tuned to one view? Every scene is drawn from four places, and each phase is timed in interleaved
launches with its parent. A phase that is faster where it was tuned and not elsewhere is named."""
STATUSES = {cli.FAILED: "a program crashed, or a picture has samples that are not finite"}
FILE = "views.json"
SECONDS = 150


def options(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("--phase", nargs="+", default=list(registry.ladder()), metavar="PHASE", help="default: all")
    add("--scene", nargs="+", default=list(registry.scenes()), metavar="SCENE", help="default: all")
    running.height(parser, 90, "height of what is timed", least=8)
    running.height(parser, 45, "of what is held against ground truth", "--error-n", 8)
    running.budget(parser, SECONDS, full=True)
    add("--full", action="store_true", help="every phase, however long that takes")
    add("--cpu", type=int, default=run.FASTEST, help="CPU to pin to; default: of a fast core")
    running.options(parser, f"{FILE}, figures/", "views")


def measure(args: argparse.Namespace) -> Outcome:
    folder = running.folder(args, FILE)
    run.cpu_set(args.cpu, 1)
    seconds = args.budget or (math.inf if args.full else SECONDS)
    pairs = parents(args.phase)
    if not pairs:
        raise StudyError(f"{' '.join(args.phase)}: no phase with a parent, which it would be held against")
    scenes, left_out = [], []
    for scene in [registry.find_scene(name) for name in dict.fromkeys(args.scene)]:
        try:
            scenes += views.of(scene, registry.ROOT / "build" / "views" / "scenes")
        except StudyError as error:
            left_out.append(LeftOut(phase="all", scene=scene.name, view="all", reason=str(error)))
    told = (args.n, args.error_n, args.launches, args.seed, args.cpu, seconds)
    with temporary.folder() as scratch:
        settings = Settings(*told, jobs=len(run.USABLE), scratch=scratch)
        rows, plan = study(pairs, scenes, settings)
    result = Views(
        **running.about(args),
        n=args.n,
        error_n=args.error_n,
        seconds=seconds if math.isfinite(seconds) else None,
        reference=gains.BASE,
        rows=rows,
        steps=gains.over_views(rows),
        left_out=left_out + plan.left_out,
        failures=plan.failures,
    )
    failed = hit_tables.not_finite([(f"{row.phase} on {row.scene} {row.view}", row) for row in rows])
    failed += [f"{one.phase} on {where(one)}: {one.reason}" for one in plan.failures]
    made = tables.found(result)
    return running.end(folder / FILE, result, made.parts, made.drawn, failed=failed)
