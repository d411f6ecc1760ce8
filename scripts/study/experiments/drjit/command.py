"""Our phases beside Dr.Jit's kernels on this machine, interleaved in one run, with the error of both."""

from __future__ import annotations

import argparse
import os
import secrets
import time
from pathlib import Path

from study.core import cli, machine, registry, run, store, temporary
from study.core.cli import StudyError
from study.core.registry import Spec
from study.experiments.drjit import measure as drjit_measure
from study.experiments.drjit import tables as drjit_page
from study.experiments.drjit.measure import DRJIT, Measuring, Point, Rival
from study.experiments.frames import measure as frames
from study.experiments.sweep import summary

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
    add("-n", type=cli.at_least(16), default=720, metavar="HEIGHT", help="height; default: 720")
    add("--launches", type=cli.at_least(1), default=6, help="process launches of each; default: 6")
    add("--threads", type=cli.at_least(1), nargs="+", help="default: 1 and all CPUs")
    add("--python", type=Path, metavar="FILE", help="a Python with drjit; default: one in build/drjit")
    add("--seed", type=int, help="of order and padding; default: random")
    add("--cpu", type=int, default=run.FASTEST, help="first CPU to pin to; default: of a fast core")
    add("--run", type=Path, metavar="DIR", help="for drjit.json; default: build/drjit")
    args = parser.parse_args()
    args.threads = args.threads or [1, len(run.USABLE)]
    args.seed = secrets.randbelow(2**32) if args.seed is None else args.seed
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
    folder = store.writable(args.run or drjit_measure.HOME)
    run.cpu_set(args.cpu, 1)
    if max(args.threads) > len(run.USABLE):
        raise StudyError(f"--threads {max(args.threads)}: there are {len(run.USABLE)} CPUs")
    specs = frames.threaded(args.phase)
    specs = [spec for spec in specs if not registry.missing_isa(spec)]
    if not specs:
        raise StudyError("no phase of these can run on this CPU", cli.CANNOT_RUN)
    llvm = drjit_measure.find_llvm(os.environ.get("DRJIT_LIBLLVM_PATH"))
    rival = Rival(drjit_measure.find_python(args.python), llvm)
    begun = time.monotonic()
    settings = {key: getattr(args, key) for key in ("n", "launches", "threads", "seed", "cpu")}
    found = measured(args, specs, rival)
    about = {"took_s": time.monotonic() - begun, "context": machine.context()}
    result = cli.plain({"schema": 1, **settings, **about, **found})
    store.write_json(folder / drjit_measure.FILE, result)
    if args.json:
        cli.emit(result, folder)
    else:
        columns = drjit_page.COLUMNS
        shown = [{column.name: column.text(row) for column in columns} for row in result["rows"]]
        print(summary.table(shown, [(column.name, column.name) for column in columns]))
        print(drjit_page.note(result))
    bad = [row for row in result["rows"] if row["non_finite"]]
    for row in bad:
        who = row["program"]
        cli.say(f"FAIL {who} on {row['scene']}: {row['non_finite']} samples not finite")
    return cli.FAILED if any(row["program"] != DRJIT for row in bad) else cli.OK
