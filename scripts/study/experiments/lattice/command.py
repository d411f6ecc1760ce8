"""CPU-RTRM's scene by every phase, beside that program's own figures."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from msgspec.structs import asdict

from study.core import cli, registry, run
from study.core.cli import Outcome, StudyError
from study.core.registry import Spec
from study.experiments import running
from study.experiments.lattice import tables
from study.experiments.lattice.schema import FILE, SCENE, Lattice, Program, Row
from study.measuring import hit_tables, hits, launches
from study.measuring.launches import Size
from study.measuring.schema import HitErrors
from study.truth import truth

DESCRIPTION = """\
Every phase of the ladder on the scene `lattice`, on one thread and on all CPUs, in interleaved launches; the
error of each to truth; beside figures of CPU-RTRM's own program, which are of another machine."""
STATUSES = {cli.FAILED: "a picture has samples that are not finite"}
SIZES = ((1000, 562), (1280, 720))
PROGRAM = Program(size=[1280, 720], ms={"1": 57.7, "2": 33.1}, machine="a 2-core Zen 5 VM at 4.27 GHz")
PAPER = 14.0  # times as fast as CPU-RTRM with threads, as the paper has its own last step


def options(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("--phase", nargs="+", default=list(registry.ladder()), metavar="PHASE", help="default: the ladder")
    about = "heights, 16:9; default: 1000×562 and 1280×720"
    add("-n", type=cli.at_least(9), nargs="+", metavar="HEIGHT", help=about)
    running.height(parser, 180, "height for errors", "--error-n", 9)
    add("--threads", type=cli.at_least(1), nargs="+", help="default: 1, 2 and all CPUs")
    add("--cpu", type=int, default=run.FASTEST, help="first CPU to pin to; default: of a fast core")
    running.options(parser, FILE, "systems")


@dataclass(frozen=True)
class Point:
    """A phase at a size on a number of threads."""

    phase: str
    size: Size
    threads: int


def points(names: Sequence[str], sizes: Sequence[Size], threads: Sequence[int]) -> list[Point]:
    """Every phase at every size, with more threads where it has them."""
    return [
        Point(name, size, count)
        for size in sizes
        for name in names
        for count in dict.fromkeys(threads)
        if count == 1 or registry.find_phase(name).threads
    ]


def row(point: Point, times: Sequence[float], errors: Mapping[str, HitErrors]) -> Row:
    """Ms, and times as fast as CPU-RTRM's figure. `times`: in ms."""
    theirs = PROGRAM.ms.get(str(point.threads)) if [*point.size] == PROGRAM.size else None
    found = launches.timed(times)
    ends: dict[str, Any] = {"": found.ms, "_low": found.ms_high, "_high": found.ms_low}
    over = {f"program{end}": theirs / ms if theirs and ms else None for end, ms in ends.items()}
    return Row(
        **{"phase": point.phase, "width": point.size[0], "n": point.size[1], "threads": point.threads},
        **{"ms": found.ms, "ms_low": found.ms_low, "ms_high": found.ms_high},
        **{"ns": [one * 1e6 for one in times], "program_ms": theirs},
        **over,
        **asdict(errors[point.phase]),
    )


def measure(args: argparse.Namespace) -> Outcome:
    folder = running.folder(args, FILE)
    run.cpu_set(args.cpu, 1)
    threads = args.threads or sorted({1, min(2, len(run.USABLE)), len(run.USABLE)})
    if max(threads) > len(run.USABLE):
        raise StudyError(f"--threads {max(threads)}: there are {len(run.USABLE)} CPUs")
    wanted = [registry.find_phase(name).name for name in dict.fromkeys(args.phase)]
    names = [name for name in wanted if registry.cpu_supports(Spec.parse(name))]
    if not names:
        raise StudyError("no phase of these can run on this CPU", cli.CANNOT_RUN)
    scene = registry.find_scene(SCENE)
    sizes = [scene.size(n) for n in args.n] if args.n else SIZES
    error_size = scene.size(args.error_n)
    exact = truth.picture(scene, error_size)
    errors = {name: hits.errors(exact, hits.picture(name, scene, error_size)) for name in names}

    def once(point: Point, padding: int) -> float:
        """Median ms of a launch's frames: one frame of the phases in doubles, which take seconds."""
        slow = registry.find_phase(point.phase).precision == "double"
        warmup, reps = (0, 1) if slow else (1, 5)
        how = {"cpu": args.cpu, "threads": point.threads, "warmup": warmup}
        return launches.milliseconds(point.phase, scene, point.size, reps, padding, **how)

    every = points(names, sizes, threads)
    times = run.interleaved(every, args.launches, args.seed, args.cpu, once, "lattice")
    result = Lattice(
        **running.about(args),
        threads=threads,
        program=PROGRAM,
        paper=PAPER,
        error_size=[*error_size],
        rows=[row(point, ms, errors) for point, ms in times.items()],
    )
    failed = hit_tables.not_finite([(f"{name} on {SCENE}", found) for name, found in errors.items()])
    return running.end(folder / FILE, result, tables.parts(result), failed=failed)
