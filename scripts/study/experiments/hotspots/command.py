"""Which functions take the time, and what bounds each of them. Tables 2 to 4 stand beside the paper's."""

import argparse
import functools
import itertools
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from study.bounds import profiles
from study.bounds.profiles import Sampled
from study.bounds.schema import Beside, Bound, Hotspots
from study.core import cli, machine, progress, registry, run, show, store
from study.core.cli import Outcome, StudyError
from study.core.registry import ROOT, Scene, Spec
from study.counting import elf, flops, perf
from study.experiments import running
from study.experiments.hotspots import bounds_tables, tables

VARIANTS: tuple[Literal["calls", "shipped"], ...] = ("calls", "shipped")
ENOUGH = 1000  # samples: under them intervals are wider than what they are to tell apart
FILE = "hotspots.json"


def options(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("--phase", nargs="+", metavar="PHASE", help="phases, or opt2@opt3 (all of the ladder)")
    add("--scene", nargs="+", default=["scene0"], metavar="SCENE", help="scenes (scene0)")
    add("-n", type=cli.at_least(1), default=240, metavar="HEIGHT", help="picture height (%(default)s)")
    samples = "at least, of each build (%(default)s)"
    add("--samples", type=cli.at_least(100), default=3000, metavar="K", help=samples)
    add("--cpu", type=int, help="pin to this CPU")
    add("--run", type=Path, metavar="DIR", help="for hotspots.json; default: none")
    add("--no-bounds", action="store_true", help="without Table 3")


say = functools.cache(cli.say)  # what is lacking is said once


def instructions(spec: Spec, scene: Scene, height: int, variant: str) -> Counter[str]:
    """Instructions of a frame by function, by the block counters; none where they cannot be had."""
    found: Counter[str] = Counter()
    try:
        for name, one in flops.measure("blocks", spec, scene, height, variant).functions.items():
            found[elf.canonical(name)] += one.instructions
    except StudyError as error:
        say(f"no instruction counts: {error}")
    return found


def lanes(spec: Spec, scene: Scene, height: int) -> dict[str, float | None]:
    """Lanes at useful work by function, of SIMD phases, by the counting build."""
    if registry.find_phase(spec.phase).lanes == 1:
        return {}
    try:
        made = flops.declared(spec, scene, height)
        return tables.lanes_active(made.by_function, made.lanes)
    except StudyError as error:
        say(f"{spec}: no lane counts: {error}")
        return {}


def bound(spec: Spec, scene: Scene, height: int, sampled: Sampled) -> Bound:
    from study.bounds import topdown  # its decoder has no wheel for arm64

    folder = ROOT / "build" / str(spec)
    built = elf.read(folder / profiles.TARGETS["shipped"], folder / profiles.OBJECTS["shipped"])
    return topdown.model(sampled, built, instructions(spec, scene, height, "shipped"), say)


def add(record: Hotspots, spec: Spec, scene: Scene, args: argparse.Namespace) -> None:
    """Samples both builds, and what stands beside them."""
    calls, shipped = (
        profiles.measure(spec, scene, args.n, None, variant, args.samples, args.cpu) for variant in VARIANTS
    )
    record.profiles += [shipped.profile, calls.profile]
    record.beside["|".join(map(str, shipped.profile.picture))] = Beside(
        per_cycle=tables.per_cycle(calls.profile, instructions(spec, scene, args.n, "calls")),
        lanes_active=lanes(spec, scene, args.n),
    )
    if not args.no_bounds:
        try:
            record.bounds.append(bound(spec, scene, args.n, shipped))
        except StudyError as error:
            say(f"no bounds: {error}")


def text(record: Hotspots, rows: Sequence[tables.Row]) -> list[str]:
    parts = [show.markdown(show.table(rows, tables.COLUMNS)), tables.ABOUT]
    parts.append("\n".join(f"- {note}" for note in tables.notes(record)) + "\n")
    if record.bounds:
        parts.append(show.markdown(show.table(bounds_tables.rows(record), bounds_tables.COLUMNS)))
        parts.append(bounds_tables.ABOUT)
        parts += sorted({f"{one.remark}\n" for one in record.bounds if one.remark})
        if regions := bounds_tables.region_rows(record):
            parts.append(show.markdown(show.table(regions, bounds_tables.REGIONS)))
    return parts


def measure(args: argparse.Namespace) -> Outcome:
    target = store.Run.open(args.run) if args.run else None
    # What is there must be sound before minutes of sampling are added to it.
    old = Hotspots.load_if_there(target.path / FILE) if target else None
    ladder = [name for name, phase in registry.phases().items() if phase.family == "ladder"]
    scenes = [registry.find_scene(name) for name in args.scene]
    specs, lacks = running.programs(args.phase or ladder)
    for spec, why in lacks.items():
        cli.say(f"{spec} left out: {why}")
    if here := machine.not_x86():
        raise StudyError(
            f"functions are found in x86-64 programs alone; this machine is {here}", cli.CANNOT_RUN
        )
    if lacking := perf.missing():
        raise StudyError(lacking, cli.CANNOT_RUN)
    record = Hotspots()
    for scene, spec in progress.each(list(itertools.product(scenes, specs)), "sample"):
        try:
            add(record, spec, scene, args)
        except run.DriverError as error:
            if error.status not in (run.NO_ISA, run.UNSUPPORTED):
                raise
            cli.say(f"{spec} {scene.name} left out: {error}")
    if not record.profiles:
        raise StudyError("no phase can be sampled here", cli.CANNOT_RUN)
    if target:
        store.write_json(target.path / FILE, tables.merge(old or Hotspots(), record))
    enough = min(ENOUGH, args.samples // 2)
    thin = [one for one in record.profiles if one.samples < enough]
    few = [f"{one.phase} {one.scene} {one.variant}: {one.samples} samples only" for one in thin]
    rows = tables.table_rows(record, widest=tables.core_width(machine.cpu().microarchitecture))
    bounds, regions = bounds_tables.rows(record), bounds_tables.region_rows(record)
    result = {"hotspots": rows, "bounds": bounds, "record": record, "regions": regions}
    return Outcome(result, text(record, rows), args.run, few)
