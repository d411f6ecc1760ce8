"""Our phases beside Dr.Jit's kernels on this machine, interleaved in one run, with the error of both."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from study.core import cli, registry, run, temporary
from study.core.cli import StudyError
from study.core.registry import Spec
from study.experiments import running
from study.experiments.drjit import measure as drjit_measure
from study.experiments.drjit import tables as drjit_page
from study.experiments.drjit.measure import DRJIT, Measuring, Point, Rival
from study.experiments.frames import measure as frames
from study.numbers import summary

DESCRIPTION = """\
scene0_plain and mandelbulb without shadows, rendered by Dr.Jit (float, at most 100 steps, hit distance
1e-3, normals by six evaluations; in one kernel on LLVM) and by our phases, with their own limits and with
those. Dr.Jit is installed into build/drjit unless --python names a Python that has it; LLVM 17 or newer is
looked for in DRJIT_LIBLLVM_PATH and among the system's libraries. Neither is needed for anything else."""


def arguments() -> argparse.Namespace:
    parser = cli.parser(DESCRIPTION, {3: "drjit or LLVM is missing, or cannot run here"})
    add = parser.add_argument
    every = list(drjit_measure.GOALS)
    add("--phase", nargs="+", metavar="PHASE", help="default: every phase with threads")
    add("--scene", nargs="+", default=every, choices=every, metavar="SCENE", help="default: both")
    running.height(parser, 720)
    add("--threads", type=cli.at_least(1), nargs="+", help="default: 1 and all CPUs")
    add("--python", type=Path, metavar="FILE", help="a Python with drjit; default: one in build/drjit")
    add("--cpu", type=int, default=run.FASTEST, help="first CPU to pin to; default: of a fast core")
    running.options(parser, "drjit.json", "drjit")
    args = parser.parse_args()
    args.threads = args.threads or [1, len(run.USABLE)]
    return args


def measured(args: argparse.Namespace, specs: list[Spec], rival: Rival) -> dict:
    with temporary.folder() as scratch:
        work = Measuring(rival, args.n, args.cpu, scratch)
        points = drjit_measure.points(specs, args.scene, args.threads)
        errors = {
            alone: work.errors(alone)
            for alone in dict.fromkeys(Point(p.program, p.scene, p.limits, 1) for p in points)
        }
        version = work.rival_run(points[0])["drjit"]
        times = run.interleaved(points, args.launches, args.seed, args.cpu, work.once, "time")
    return {
        "drjit": version,
        "llvm": drjit_measure.say_versions(rival.llvm),
        "rows": drjit_measure.rows(times, errors, published=args.n == 720),
    }


def main() -> int:
    args = arguments()
    folder = running.folder(args)
    run.cpu_set(args.cpu, 1)
    if max(args.threads) > len(run.USABLE):
        raise StudyError(f"--threads {max(args.threads)}: there are {len(run.USABLE)} CPUs")
    specs = frames.threaded(args.phase)
    specs = [spec for spec in specs if not registry.missing_isa(spec)]
    if not specs:
        raise StudyError("no phase of these can run on this CPU", cli.CANNOT_RUN)
    llvm = drjit_measure.find_llvm(os.environ.get("DRJIT_LIBLLVM_PATH"))
    rival = Rival(drjit_measure.find_python(args.python), llvm)
    settings = {key: getattr(args, key) for key in ("n", "launches", "threads", "seed", "cpu")}
    result = running.write(folder / drjit_measure.FILE, settings, measured(args, specs, rival))
    columns = drjit_page.COLUMNS
    shown = [{column.name: column.text(row) for column in columns} for row in result["rows"]]
    table = summary.table(shown, [(column.name, column.name) for column in columns])
    told: dict[bool, list[str]] = {True: [], False: []}  # theirs fails nothing of ours
    for row in result["rows"]:
        if row["non_finite"]:
            about = f"{row['program']} on {row['scene']}: {row['non_finite']} samples not finite"
            told[row["program"] == DRJIT].append(about)
    return running.end(args, result, [table, drjit_page.note(result)], told[False], told[True])
