"""Compilers and flags: what each changes in time and pixels."""

import argparse

from study.core import cli, registry, run, show, store
from study.core.cli import Outcome, StudyError
from study.experiments import running
from study.experiments.toolchains import chapter
from study.experiments.toolchains import measure as toolchains
from study.experiments.toolchains.measure import BASE, SETS, Program
from study.experiments.toolchains.schema import FILE, Failure, Missing, Row, Toolchains

DESCRIPTION = """\
Each phase is built by each compiler under each set of flags, behind the phase's own:
  as shipped           nothing more (the phase's -O3, its -m flags, -ffp-contract=off)
  the CPU's -m flags   -march=native, recorded as what it stands for here
  and contraction      -ffp-contract=fast: a·b + c in one rounding wherever the compiler likes
  and fast-math        -ffast-math
and timed in random order, one frame per process launch. Ratios are over gcc as shipped, same phase."""
STATUSES = {cli.FAILED: "a phase cannot be built, crashes, or writes what is not finite"}


def options(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    ladder = [name for name, phase in registry.phases().items() if phase.family == "ladder"]
    compilers, default = list(toolchains.COMPILERS), "default: %(default)s"
    add("--phase", nargs="+", default=ladder, metavar="PHASE", help="default: the ladder")
    add("--scene", nargs="+", default=["scene0", "mandelbulb"], metavar="SCENE", help=default)
    add("--compiler", nargs="+", default=compilers, metavar="CC", help=default)
    add("--flags", nargs="+", default=list(SETS), choices=SETS, metavar="SET", help="default: all four")
    running.height(parser, 90, least=1)
    add("--cpu", type=int, default=run.FASTEST, help="CPU to pin to; default: of a fast core")
    add("--no-truth", action="store_true", help="do not compare with truth (saves rendering it)")
    running.options(parser, FILE, "toolchains")


def study(args: argparse.Namespace) -> Toolchains:
    """Raises StudyError where not even gcc as shipped can be built and run."""
    specs, lacking = running.programs(args.phase)
    if other := next((spec for spec in [*specs, *lacking] if spec.flags_from != spec.phase), None):
        raise StudyError(f"{other}: flags are what is compared here; name {other.phase} alone")
    scenes = [registry.find_scene(name) for name in dict.fromkeys(args.scene)]
    run.cpu_set(args.cpu, 1)
    compilers, missing = toolchains.present(dict.fromkeys(args.compiler))
    skipped = [Missing(phase=spec.phase, reason=why) for spec, why in lacking.items()]
    wanted, failures = toolchains.built(toolchains.programs(compilers, args.flags, specs))
    rows: list[Row] = []
    folder = store.writable(registry.ROOT / "build" / "toolchains" / "images")
    for scene in scenes:
        whole = {}
        for program in wanted:
            made = toolchains.picture(program, scene, args.n, folder)
            if isinstance(made, StudyError):
                failures.append(Failure(program=f"{program} on {scene.name}", reason=str(made)))
            else:
                whole[program] = made
        able = [program for program in whole if Program(*BASE, program.phase) in whole]
        exact = None if args.no_truth else toolchains.truth_of(scene, args.n)
        times = toolchains.measure(able, scene, args.n, args.launches, args.seed, args.cpu)
        rows += [toolchains.row(program, scene, args.n, times, whole, exact) for program in able]
    native = {name: toolchains.resolved(name) for name in compilers}
    found = {"n": args.n, "native": native, "rows": rows, "failures": failures}
    return Toolchains(**running.about(args), **found, skipped=[*skipped, *missing])


def measure(args: argparse.Namespace) -> Outcome:
    folder = running.folder(args, FILE)
    found = study(args)
    store.write_json(folder / FILE, found)
    lines = []
    if found.rows:
        lines = [show.markdown(show.table(found.rows, chapter.CHAINS))]
        lines.append(f"n = {args.n}, {args.launches} launches of one frame; -march=native here:")
        lines.append(chapter.natives(found))
    failed = [f"{one.program}: {one.reason}" for one in found.failures]
    failed += [
        f"{row.phase} by {row.compiler} {row.flags} on {row.scene}: not finite"
        for row in found.rows
        if row.non_finite
    ]
    return Outcome(found, lines, folder, chapter.left_out(found), failed)
