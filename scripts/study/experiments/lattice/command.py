"""CPU-RTRM's scene by every phase of the ladder: time, error to truth, beside that program's own figures."""

from __future__ import annotations

import argparse

from study.core import cli, registry, run, temporary
from study.core.cli import StudyError
from study.experiments import running
from study.experiments.lattice import measure as lattice
from study.experiments.lattice import tables as lattice_page

DESCRIPTION = """\
Every phase of the ladder on the scene `lattice` at 1000×562 and 1280×720, on one thread and on all CPUs, in
interleaved launches; the error of each to truth; what the light takes of the time; beside the figures of
CPU-RTRM's own program, which were measured on another machine."""


def arguments() -> argparse.Namespace:
    parser = cli.parser(DESCRIPTION, {1: "a picture has samples that are not finite"})
    add = parser.add_argument
    add("--phase", nargs="+", metavar="PHASE", help="default: the ladder")
    add(
        "-n",
        type=cli.at_least(9),
        nargs="+",
        metavar="HEIGHT",
        help="heights, 16:9; default: 1000×562 and 1280×720",
    )
    running.height(parser, 180, "height for errors", "--error-n", 9)
    add("--threads", type=cli.at_least(1), nargs="+", help="default: 1, 2 and all CPUs")
    add("--cpu", type=int, default=run.FASTEST, help="first CPU to pin to; default: of a fast core")
    running.options(parser, "lattice.json", "systems")
    args = parser.parse_args()
    args.threads = args.threads or sorted({1, min(2, len(run.USABLE)), len(run.USABLE)})
    return args


def main() -> int:
    args = arguments()
    folder = running.folder(args)
    run.cpu_set(args.cpu, 1)
    if max(args.threads) > len(run.USABLE):
        raise StudyError(f"--threads {max(args.threads)}: there are {len(run.USABLE)} CPUs")
    names = lattice.able([registry.find_phase(name).name for name in args.phase] if args.phase else None)
    if not names:
        raise StudyError("no phase of these can run on this CPU", cli.CANNOT_RUN)
    scene = registry.find_scene(lattice.SCENE)
    sizes = [scene.size(n) for n in args.n] if args.n else list(lattice.SIZES)
    settings = {key: getattr(args, key) for key in ("launches", "threads", "seed", "cpu")}
    how = (args.threads, args.launches, args.seed, args.cpu, args.error_n)
    with temporary.folder() as scratch:
        found = lattice.study(names, sizes, *how, scratch)
    result = running.write(folder / lattice.FILE, settings, found)
    lines = [*map(lattice_page.sentence, result["rows"]), lattice_page.note(result)]
    bad = sorted({row["phase"] for row in result["rows"] if row["non_finite"]})
    failed = [f"{name} on {lattice.SCENE}: samples that are not finite" for name in bad]
    return running.end(args, result, lines, failed)
