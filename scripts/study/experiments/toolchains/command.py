"""Compilers and flags: time, pixels that change and error to truth of every phase by each of them."""

from __future__ import annotations

import argparse
import os

from study.core import cli, machine, registry, run, store
from study.core.cli import StudyError
from study.core.registry import Spec
from study.experiments import running
from study.experiments.toolchains import measure as toolchains
from study.experiments.toolchains.measure import BASE, SETS
from study.numbers import summary

DESCRIPTION = """\
Each phase is built by each compiler under each set of flags, behind the phase's own:
  as shipped           nothing more (the phase's -O3, its -m flags, -ffp-contract=off)
  the CPU's -m flags   -march=native, recorded as what it stands for here
  and contraction      -ffp-contract=fast: a·b + c in one rounding wherever the compiler likes
  and fast-math        -ffast-math
and timed in random order, one frame per process launch. Ratios are over gcc as shipped, same phase."""


def arguments() -> argparse.Namespace:
    parser = cli.parser(DESCRIPTION, {1: "a phase cannot be built, crashes, or writes what is not finite"})
    add = parser.add_argument
    ladder = [name for name, phase in registry.phases().items() if phase.family == "ladder"]
    add("--phase", nargs="+", default=ladder, metavar="PHASE", help="default: the ladder")
    add("--scene", nargs="+", default=["scene0", "mandelbulb"], metavar="SCENE", help="default: %(default)s")
    add(
        "--compiler", nargs="+", default=list(toolchains.COMPILERS), metavar="CC", help="default: %(default)s"
    )
    add("--flags", nargs="+", default=list(SETS), choices=SETS, metavar="SET", help="default: all four")
    running.height(parser, 90, least=1)
    add("--cpu", type=int, default=run.FASTEST, help="CPU to pin to; default: of a fast core")
    add("--no-truth", action="store_true", help="do not compare with truth (saves rendering it)")
    running.options(parser, "toolchains.json", "toolchains")
    return parser.parse_args()


def study(args: argparse.Namespace) -> dict:
    """toolchains.json. Raises StudyError where not even gcc as shipped can be built and run."""
    specs = [Spec.parse(name) for name in dict.fromkeys(args.phase)]
    for spec in specs:
        if spec.flags_from != spec.phase:
            raise StudyError(f"{spec}: flags are what is compared here; name {spec.phase} alone")
    lacking = {spec: registry.missing_isa(spec) for spec in specs}
    skipped = [
        {"phase": s.phase, "reason": f"this CPU lacks {' '.join(what)}"}
        for s, what in lacking.items()
        if what
    ]
    specs = [spec for spec in specs if not lacking[spec]]
    scenes = [registry.find_scene(name) for name in dict.fromkeys(args.scene)]
    run.cpu_set(args.cpu, 1)
    compilers, missing = toolchains.present(list(dict.fromkeys(args.compiler)))
    skipped += missing
    wanted = toolchains.programs(compilers, args.flags, specs)
    if not wanted:
        raise StudyError("nothing to measure: no phase can run on this CPU", cli.CANNOT_RUN)
    problems = toolchains.build_all(wanted, len(os.sched_getaffinity(0)))
    failures = [
        {"program": f"{p.phase}, {p.compiler} {p.flags}", "reason": why} for p, why in problems.items()
    ]
    wanted = [p for p in wanted if p not in problems]
    rows: list[dict] = []
    folder = registry.ROOT / "build" / "toolchains" / "images"
    folder.mkdir(parents=True, exist_ok=True)
    for scene in scenes:
        pictures = {p: toolchains.picture(p, scene, args.n, folder) for p in wanted}
        for program, made in pictures.items():
            if isinstance(made, StudyError):
                name = f"{program.phase}, {program.compiler} {program.flags}"
                failures.append({"program": f"{name} on {scene.name}", "reason": str(made)})
        whole = {p: made for p, made in pictures.items() if not isinstance(made, StudyError)}
        able = [p for p in whole if toolchains.Program(*BASE, p.phase) in whole]
        truth = None if args.no_truth else toolchains.truth_of(scene, args.n)
        times = toolchains.measure(able, scene, args.n, args.launches, args.seed, args.cpu)
        rows += [toolchains.row(p, scene, args.n, times, whole, truth) for p in able]
    settings = {key: getattr(args, key) for key in ("n", "launches", "seed", "cpu")}
    native = {name: toolchains.resolved(name) for name in compilers}
    context = machine.context()
    result = {"schema": 1, **settings, "native": native, "context": context, "rows": rows}
    return result | {"skipped": skipped, "failures": failures}


def main() -> int:
    args = arguments()
    folder = running.folder(args)
    result = study(args)
    store.write_json(folder / "toolchains.json", result)
    lines = []
    if result["rows"]:
        lines = [summary.table(toolchains.shown(result["rows"]), toolchains.COLUMNS)]
        lines.append(f"n = {args.n}, {args.launches} launches of one frame; -march=native here:")
        lines += [f"  {name}: {flags or 'not told'}" for name, flags in result["native"].items()]
    skipped = [f"skipped {one.get('compiler') or one['phase']}: {one['reason']}" for one in result["skipped"]]
    failed = [f"{one['program']}: {one['reason']}" for one in result["failures"]]
    failed += [
        f"{row['phase']} by {row['compiler']} {row['flags']} on {row['scene']}: not finite"
        for row in result["rows"]
        if row["non_finite"]
    ]
    return running.end(args, result, lines, failed, skipped)
