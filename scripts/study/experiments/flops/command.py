"""FLOPs by the paper's method (Table 1), and declared × counted against what a back end measures."""

from __future__ import annotations

import itertools
import os
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from study.core import cli, progress, registry, show, store
from study.core.build import build
from study.core.cli import StudyError
from study.core.registry import Scene, Spec
from study.core.run import NO_ISA, UNSUPPORTED, DriverError
from study.counting import flops, libm
from study.counting.counts import Measured
from study.counting.flops import BACKENDS, Row
from study.experiments.flops import columns as flops_columns
from study.experiments.flops import table1

HEIGHT = 720  # of the paper's pictures
SLOW = {"qemu": (24, "a hundred"), "ptrace": (18, "some hundred thousand")}  # height; times slower
MATH_SAID = "calls of math.h, by function and in all: {} of {} within 1 % of the calls into libm"


def pairs(phases: Iterable[str] | None, scenes: Iterable[str]) -> list[tuple[Spec, Scene]]:
    """What can be counted: phases that have a costs.def and whose instructions this CPU has."""
    found = []
    for name in phases or registry.ladder():
        spec = Spec.parse(name)
        if "+" in spec.phase:
            build(spec, "render-count")  # its patched source, costs.def among it, is made by its build
        if not registry.find_phase(spec.phase).file("costs.def").is_file():
            text = (
                f"phases/{spec.phase}/costs.def is missing: FLOPs per function, see common/counting/flops.h"
            )
            if phases:
                raise StudyError(text)
            cli.say(f"left out: {text}")
        elif missing := registry.missing_isa(spec):
            cli.say(f"left out: {spec} needs {', '.join(missing)}, which this CPU lacks")
        else:
            found.append(spec)
    return list(itertools.product(found, [registry.find_scene(name) for name in scenes]))


def in_parallel(work: list, jobs: int, about: str) -> list:
    """Results of the calls in order: counts do not depend on what else runs. What a phase refuses is None."""

    def one(call):
        try:
            return call()
        except DriverError as error:
            if error.status not in (NO_ISA, UNSUPPORTED):
                raise
            cli.say(f"left out: {error.message}")
            return None

    with ThreadPoolExecutor(jobs) as pool:
        return list(progress.each(pool.map(one, work), about, len(work)))


def measurements(
    chosen: list[tuple[Spec, Scene]], backend: str, height: int, variants: tuple[str, ...], jobs: int
) -> dict[str, list[Measured | None]]:
    """Variant → one measurement per pair."""
    return {
        variant: in_parallel(
            [lambda p=p, v=variant: flops.measure(backend, *p, height, v) for p in chosen],
            jobs,
            f"measure {variant}",
        )
        for variant in variants
    }


def main() -> int:
    parser = cli.parser(__doc__, {1: "a count is further than 1 % from what was measured"})
    parser.add_argument("--phase", nargs="+", metavar="PHASE", help="default: all; also opt2@opt4, opt1+bulb")
    parser.add_argument(
        "--scene", nargs="+", metavar="SCENE", help="default: scene0 mandelbulb, and trio with --validate"
    )
    slow = [f"{height} with {name}, {times} times slower" for name, (height, times) in SLOW.items()]
    heights = f"picture height ({'; '.join([str(HEIGHT), *slow])})"
    parser.add_argument("-n", type=int, metavar="HEIGHT", help=heights)
    parser.add_argument("--validate", action="store_true", help="against measurement, exit 1 beyond 1 %%")
    parser.add_argument(
        "--backend", choices=BACKENDS, help="what measures, with --validate or --measure (blocks)"
    )
    parser.add_argument("--measure", action="store_true", help="also measure the shipped build")
    parser.add_argument("--jobs", type=int, default=len(os.sched_getaffinity(0)))
    parser.add_argument(
        "--run", type=Path, metavar="DIR", help="for counts.json and validation.json; default: none"
    )
    args = parser.parse_args()
    if args.backend and not (args.validate or args.measure):
        raise StudyError(f"--backend {args.backend} measures nothing by itself: add --validate or --measure")
    args.backend = args.backend or "blocks"
    if args.n is None:
        args.n = SLOW.get(args.backend, (HEIGHT,))[0]
    if args.n < 1 or args.jobs < 1:
        raise StudyError("-n and --jobs: whole numbers from 1 are required")
    target = store.Run.open(args.run) if args.run else None
    if (args.validate or args.measure) and (lacking := flops.missing(args.backend)):
        raise StudyError(lacking, cli.CANNOT_RUN)
    if args.backend in SLOW and args.n > SLOW[args.backend][0]:
        height, times = SLOW[args.backend]
        cli.say(f"{args.backend} is {times} times slower than the machine: -n {height} is enough")
    scenes = args.scene or ["scene0", "mandelbulb", *(["trio"] if args.validate else [])]
    chosen = pairs(args.phase, scenes)
    if not chosen:
        raise StudyError("no phase can be counted here", cli.CANNOT_RUN)
    stated = in_parallel(
        [lambda p=p: flops.declared(p[0], p[1], *reversed(p[1].size(args.n))) for p in chosen],
        args.jobs,
        "count",
    )
    for name in dict.fromkeys(one["phase"] for one in stated if one is not None and one.get("kernel")):
        cli.say(f"{name}: its general code is counted, no kernel is generated for a scene (STEPWISE_CC=none)")
    functions = args.backend in flops.WITH_FUNCTIONS
    variants = (
        ("shipped", "calls")[: 1 + functions] if args.validate else ("shipped",) if args.measure else ()
    )
    measured = measurements(chosen, args.backend, args.n, variants, args.jobs)
    rows: list[Row] = []
    for i, one in enumerate(stated):
        if args.validate and one is not None:
            shipped, calls = measured["shipped"][i], measured["calls"][i] if functions else None
            if shipped is None:
                raise StudyError(
                    f"{chosen[i][0]}: the build for {args.backend} refuses what the phase renders"
                )
            rows += flops.compare(one, shipped, calls)
            if calls is not None:
                rows += [
                    row | {"scope": f"calls of {row['scope']}"} for row in flops.compare_calls(one, calls)
                ]
                rows += [*libm.compare(one, shipped), *libm.compare(one, calls)]
    counted = [one for one in stated if one is not None]
    made = [m for m in measured.get("shipped", []) if m is not None]
    if target:
        flops.write(target.path / "counts.json", counted, made)
        if args.validate:
            flops.write_validation(target.path / "validation.json", rows)
    bad = flops.failures(rows)
    table = table1.rows(counted)
    if args.json:
        found = {"table1": table, "declared": counted, "measured": [one.to_json() for one in made]}
        cli.emit(found | {"rows": rows, "failed": len(bad)}, args.run)
    elif args.validate:
        apart = ("calls of", libm.MATH)
        listed = [row for row in rows if row["judged"] and not row["scope"].startswith(apart)]
        print(show.markdown(show.table(listed, flops_columns.VALIDATION)))
        for title, said in (("calls of", "calls by name: {} of {} functions equal"), (libm.MATH, MATH_SAID)):
            of = [row["within"] for row in rows if row["scope"].startswith(title)]
            if of:
                print(said.format(sum(of), len(of)))
    else:
        print(show.markdown(show.table(table, flops_columns.TABLE1)))
        print(show.markdown(show.table(table1.terms(counted), flops_columns.TERMS)))
        if readings := table1.readings(counted):
            print(show.markdown(show.table(readings, flops_columns.READINGS)))
        if made:
            print(show.markdown(show.table([flops.summary(one) for one in made], flops_columns.MEASURED)))
    for row in bad:
        cli.say(
            f"{row['phase']} {row['scene']} {row['scope']} ({row['variant']}): declared {row['counted']:,}, "
            f"{row['backend']} {row['measured']:,}: {row['relative_difference']:+.2%}, of which nothing "
            f"explains {row['unexplained']:+.2%}"
        )
    for phase in dict.fromkeys(row["phase"].partition("+")[0] for row in bad):
        cli.say(f"phases/{phase}/costs.def: declare there what the code does (CONTRIBUTING.md, residues.def)")
    return cli.FAILED if bad else cli.OK
