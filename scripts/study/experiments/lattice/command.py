"""CPU-RTRM's scene by every phase of the ladder: time, error to truth, beside that program's own figures."""

from __future__ import annotations

import argparse

from study.core import cli, registry, run, store
from study.core.cli import Outcome, StudyError
from study.core.registry import Spec
from study.experiments import running
from study.experiments.lattice import measure as lattice
from study.experiments.lattice import tables
from study.experiments.lattice.schema import Lattice
from study.measuring import hits
from study.truth import truth

DESCRIPTION = """\
Every phase of the ladder on the scene `lattice` at 1000×562 and 1280×720, on one thread and on all CPUs, in
interleaved launches; the error of each to truth; beside the figures of CPU-RTRM's own program, which were
measured on another machine."""
STATUSES = {cli.FAILED: "a picture has samples that are not finite"}


def options(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("--phase", nargs="+", default=list(registry.ladder()), metavar="PHASE", help="default: the ladder")
    about = "heights, 16:9; default: 1000×562 and 1280×720"
    add("-n", type=cli.at_least(9), nargs="+", metavar="HEIGHT", help=about)
    running.height(parser, 180, "height for errors", "--error-n", 9)
    add("--threads", type=cli.at_least(1), nargs="+", help="default: 1, 2 and all CPUs")
    add("--cpu", type=int, default=run.FASTEST, help="first CPU to pin to; default: of a fast core")
    running.options(parser, lattice.FILE, "systems")


def measure(args: argparse.Namespace) -> Outcome:
    folder = running.folder(args)
    run.cpu_set(args.cpu, 1)
    threads = args.threads or sorted({1, min(2, len(run.USABLE)), len(run.USABLE)})
    if max(threads) > len(run.USABLE):
        raise StudyError(f"--threads {max(threads)}: there are {len(run.USABLE)} CPUs")
    wanted = [registry.find_phase(name).name for name in dict.fromkeys(args.phase)]
    names = [name for name in wanted if registry.cpu_supports(Spec.parse(name))]
    if not names:
        raise StudyError("no phase of these can run on this CPU", cli.CANNOT_RUN)
    scene = registry.find_scene(lattice.SCENE)
    sizes = [scene.size(n) for n in args.n] if args.n else lattice.SIZES
    error_size = scene.size(args.error_n)
    exact = truth.picture(scene, error_size)
    errors = {name: hits.errors(exact, hits.picture(name, scene, error_size)) for name in names}

    def once(point: lattice.Point, padding: int) -> float:
        return lattice.once(point, scene, padding, args.cpu)

    points = lattice.points(names, sizes, threads)
    times = run.interleaved(points, args.launches, args.seed, args.cpu, once, "lattice")
    result = Lattice(
        **running.about(args),
        threads=threads,
        program=lattice.PROGRAM,
        paper=lattice.PAPER,
        error_size=[*error_size],
        rows=[lattice.row(point, ms, errors) for point, ms in times.items()],
    )
    store.write_json(folder / lattice.FILE, result)
    lines = [part.markdown for part in tables.parts(result)]
    bad = [name for name, found in errors.items() if found.non_finite]
    failed = [f"{name} on {lattice.SCENE}: samples that are not finite" for name in bad]
    return Outcome(result, lines, folder, failed=failed)
