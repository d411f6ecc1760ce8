"""FLOPs by the paper's method: declared and counted. Table 1 stands beside what a back end measures."""

import argparse
import itertools
import os
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import TypeVar

from study.core import cli, progress, registry, show, store
from study.core.build import build
from study.core.cli import Outcome, StudyError
from study.core.registry import Scene, Spec
from study.core.run import NO_ISA, UNSUPPORTED, DriverError
from study.counting import costs, flops
from study.counting.flops import BACKENDS
from study.counting.schema import Row
from study.experiments.flops import columns, table1

STATUSES = {cli.FAILED: "a count is further than 1 % from what was measured"}
HEIGHT, STEPPED = 720, 18  # of the paper's pictures; with ptrace, some hundred thousand times slower
T = TypeVar("T")


def options(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("--phase", nargs="+", metavar="PHASE", help="default: all; also opt2@opt4, opt1+bulb")
    scenes = "default: scene0 mandelbulb, and trio with --validate"
    add("--scene", nargs="+", metavar="SCENE", help=scenes)
    heights = f"picture height ({HEIGHT}; {STEPPED} with ptrace, some hundred thousand times slower)"
    add("-n", type=cli.at_least(1), metavar="HEIGHT", help=heights)
    add("--validate", action="store_true", help="against measurement, exit 1 beyond 1 %%")
    add("--backend", choices=BACKENDS, help="what measures, with --validate or --measure (blocks)")
    add("--measure", action="store_true", help="also measure the shipped build")
    add("--jobs", type=cli.at_least(1), default=len(os.sched_getaffinity(0)))
    add("--run", type=Path, metavar="DIR", help="for counts.json and validation.json; default: none")


def pairs(phases: Iterable[str] | None, scenes: Iterable[str]) -> list[tuple[Spec, Scene]]:
    """What can be counted: phases whose instructions this CPU has."""
    found = []
    for name in phases or registry.ladder():
        spec = Spec.parse(name)
        if missing := registry.missing_isa(spec):
            cli.say(f"left out: {spec} needs {', '.join(missing)}, which this CPU lacks")
            continue
        if "+" in spec.phase:
            build(spec, "render")  # its patched source, costs.def among it, is made by its build
        found.append(spec)
    return list(itertools.product(found, [registry.find_scene(name) for name in scenes]))


def in_parallel(work: Sequence[Callable[[], T]], jobs: int, about: str) -> list[T]:
    """Results of the calls in order, without what a phase refuses: counts do not depend on what else runs."""

    def one(call: Callable[[], T]) -> list[T]:
        try:
            return [call()]
        except DriverError as error:
            if error.status not in (NO_ISA, UNSUPPORTED):
                raise
            cli.say(f"left out: {error.message}")
            return []

    with ThreadPoolExecutor(jobs) as pool:
        return list(itertools.chain(*progress.each(pool.map(one, work), about, len(work))))


def validated(spec: Spec, scene: Scene, height: int, backend: str) -> list[Row]:
    """Rows of one picture: totals, and by blocks functions and their calls."""
    stated = flops.declared(spec, scene, height)
    shipped = flops.measure(backend, spec, scene, height)
    if backend != "blocks":
        return flops.compare(stated, shipped)
    calls = flops.measure(backend, spec, scene, height, "calls")
    return [*flops.compare(stated, shipped, calls), *flops.compare_calls(stated, calls)]


def measure(args: argparse.Namespace) -> Outcome:
    if args.backend and not (args.validate or args.measure):
        raise StudyError(f"--backend {args.backend} measures nothing by itself: add --validate or --measure")
    backend = args.backend or "blocks"
    height = args.n or (STEPPED if backend == "ptrace" else HEIGHT)
    target = store.Run.open(args.run) if args.run else None
    lacking = flops.missing(backend)
    if lacking and (args.validate or args.backend):
        raise StudyError(lacking, cli.CANNOT_RUN)
    scenes = args.scene or ["scene0", "mandelbulb", *(["trio"] if args.validate else [])]
    chosen = pairs(args.phase, scenes)
    if not chosen:
        raise StudyError("no phase can be counted here", cli.CANNOT_RUN)
    able = [pair for pair in chosen if costs.declares(pair[0].phase)]
    counted = [pair for pair in chosen if registry.find_phase(pair[0].phase).file("costs.def").is_file()]
    calls = [partial(flops.declared, *pair, height) for pair in counted]
    stated = in_parallel(calls, args.jobs, "count")
    # A phase that declares nothing has what the blocks executed for its FLOPs.
    wanted = chosen if args.measure else [pair for pair in chosen if pair not in able and not args.validate]
    work = [partial(flops.measure, backend, *pair, height) for pair in wanted if not lacking]
    made = in_parallel(work, args.jobs, "measure")
    rows: list[Row] = []
    if args.validate:
        if not able:
            raise StudyError(f"phases/{chosen[0][0].phase}/costs.def is missing: nothing to validate")
        checks = [partial(validated, *pair, height, backend) for pair in able]
        rows = list(itertools.chain(*in_parallel(checks, args.jobs, "validate")))
    if target:
        flops.write(target.path / "counts.json", stated, made)
        if args.validate:
            flops.write_validation(target.path / "validation.json", rows)
    bad, table = flops.failures(rows), table1.rows(stated, made)
    result = {"table1": table, "declared": stated, "measured": made, "rows": rows, "failed": len(bad)}
    if args.validate:
        lines = _validation(rows)
    else:
        several = [(table, columns.TABLE1), (table1.terms(stated), columns.TERMS), (made, columns.MEASURED)]
        lines = [show.markdown(show.table(some, shown)) for some, shown in several if some]
    general = dict.fromkeys(one.phase for one in [*stated, *made] if one.kernel)
    remarks = [f"{name}: its general code is counted, no kernel is generated for a scene" for name in general]
    if lacking and wanted:
        remarks.append(lacking)
    return Outcome(result, lines, args.run, remarks, _failed(bad))


def _validation(rows: Sequence[Row]) -> list[str]:
    listed = [row for row in rows if row.judged and not row.of_calls]
    equal = [row.within for row in rows if row.of_calls]
    said = [f"calls by name: {sum(equal)} of {len(equal)} functions equal"] if equal else []
    return [show.markdown(show.table(listed, columns.VALIDATION)), *said]


def _failed(bad: Sequence[Row]) -> list[str]:
    lines = [
        f"{row.phase} {row.scene} {row.scope} ({row.variant}): declared {row.counted:,}, {row.backend} "
        f"{row.measured:,}: {row.relative_difference:+.2%}, of which nothing explains {row.unexplained:+.2%}"
        for row in bad
    ]
    for phase in dict.fromkeys(row.phase.partition("+")[0] for row in bad):
        lines.append(f"phases/{phase}/costs.def: declare there what the code does (CONTRIBUTING.md)")
    return lines
