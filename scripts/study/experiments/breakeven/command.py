"""After how many frames a generated kernel has paid for itself."""

from __future__ import annotations

import argparse

from study.core import cli, registry
from study.core.build import build
from study.core.cli import Outcome, StudyError
from study.core.registry import Spec
from study.experiments import running
from study.experiments.breakeven import tables
from study.experiments.breakeven.measure import AGAINST, PHASE, Settings, scenes, study
from study.experiments.breakeven.schema import Breakeven
from study.measuring import hit_tables

DESCRIPTION = """\
opt10_scene compiles a kernel for each scene. Its set-up, from an empty cache, and its frames against
opt9_convex's: how many frames until it has paid. Scenes without a kernel are named."""
STATUSES = {cli.FAILED: "a kernel's picture has samples that are not finite"}
FILE = "breakeven.json"
SECONDS = 90


def options(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("--phase", default=PHASE, metavar="PHASE", help="default: %(default)s")
    add("--against", default=AGAINST, metavar="PHASE", help="default: %(default)s")
    add("--scene", nargs="+", default=scenes(), metavar="SCENE", help="default: all with a kernel")
    running.height(parser, 720, least=1)
    running.budget(parser, SECONDS)
    running.options(parser, FILE, "breakeven")


def measure(args: argparse.Namespace) -> Outcome:
    specs = Spec.parse(args.against), Spec.parse(args.phase)
    chosen = [registry.find_scene(name) for name in dict.fromkeys(args.scene)]
    for spec in specs:
        if lacking := registry.missing_isa(spec):
            raise StudyError(f"{spec} needs {', '.join(lacking)}, which this CPU lacks", cli.CANNOT_RUN)
        if registry.find_phase(spec.phase).family == registry.TRUTH:
            raise StudyError(f"{spec}: is truth itself; name phases that are to be timed")
    folder = running.folder(args, FILE)
    for spec in specs:
        build(spec)
    settings = Settings(args.n, args.launches, args.budget, args.seed)
    rows, left_out = study(specs, chosen, settings)
    result = Breakeven(
        **running.about(args),
        seconds=args.budget,
        phase=args.phase,
        against=args.against,
        rows=rows,
        left_out=left_out,
    )
    failed = hit_tables.not_finite([(row.scene, row.error) for row in rows if row.error])
    return running.end(folder / FILE, result, tables.found(result).parts, failed=failed)
