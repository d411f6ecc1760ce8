"""Which functions take the time (Tables 2 and 4) and what bounds them (Table 3), beside the paper's."""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from study.bounds import profiles, topdown
from study.bounds.profiles import Sampled
from study.bounds.schema import Beside, Bound, Hotspots
from study.core import cli, machine, progress, registry, run, show, store
from study.core.cli import Outcome, StudyError
from study.core.registry import ROOT, Scene, Spec
from study.counting import blocks, elf, flops, perf, symbols
from study.experiments.hotspots import bounds_tables, tables

VARIANTS = ("shipped", "calls")
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


class Sampling:
    """Everything of one call; what is lacking is said once."""

    def __init__(self, args: argparse.Namespace) -> None:
        self.args = args
        self.record, self._said = Hotspots(), set()

    def _say(self, line: str) -> None:
        if line not in self._said:
            cli.say(line)
            self._said.add(line)

    def _instructions(self, spec: Spec, scene: Scene, variant: str) -> Counter[str]:
        """Of a frame by function, by the block counters; none where they cannot be had."""
        found: Counter[str] = Counter()
        try:
            for name, one in blocks.measure(spec, scene, self.args.n, variant).functions.items():
                found[symbols.canonical(name)] += one.instructions
        except StudyError as error:
            self._say(f"no instruction counts: {error}")
        return found

    def _lanes(self, spec: Spec, scene: Scene) -> dict[str, float | None]:
        """Lanes at useful work by function, of SIMD phases, by the counting build."""
        if registry.find_phase(spec.phase).lanes == 1:
            return {}
        try:
            made = flops.declared(spec, scene, self.args.n)
            return tables.lanes_active(made.by_function, flops.lanes_of(made))
        except StudyError as error:
            self._say(f"{spec}: no lane counts: {error}")
            return {}

    def _bound(self, spec: Spec, scene: Scene, sampled: Sampled) -> Bound:
        """One row of Table 3 and its regions: by the PMU where it can, else by the model."""
        folder = ROOT / "build" / str(spec)
        built = elf.read(folder / profiles.TARGETS["shipped"], folder / profiles.OBJECTS["shipped"])
        counted = self._instructions(spec, scene, "shipped")
        made = topdown.model(sampled, built, counted, self._say)
        try:
            if by_pmu := topdown.topdown(spec, scene, self.args.n):
                made.by, made.modelled_split = "pmu", made.split
                made.split, made.remark = by_pmu
        except StudyError as error:
            self._say(f"no top-down split by the PMU: {error}")
        return made

    def add(self, spec: Spec, scene: Scene) -> None:
        args = self.args
        by = {
            variant: profiles.measure(spec, scene, args.n, None, variant, args.samples, args.cpu)
            for variant in VARIANTS
        }
        self.record.profiles += [one.profile for one in by.values()]
        calls, shipped = by["calls"].profile, by["shipped"].profile
        self.record.beside["|".join(map(str, shipped.picture))] = Beside(
            per_cycle=tables.per_cycle(calls, self._instructions(spec, scene, "calls")),
            lanes_active=self._lanes(spec, scene),
        )
        if not args.no_bounds:
            try:
                self.record.bounds.append(self._bound(spec, scene, by["shipped"]))
            except StudyError as error:
                self._say(f"no bounds: {error}")


def text(record: Hotspots, rows: Sequence[tables.Row]) -> list[str]:
    """All tables for people, each with what it says and does not say."""
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
    pairs = [(Spec.parse(name), scene) for scene in scenes for name in args.phase or ladder]
    if lacking := perf.missing():
        raise StudyError(lacking, cli.CANNOT_RUN)
    sampling = Sampling(args)
    for spec, scene in progress.each([pair for pair in pairs if not skipped(pair[0])], "sample"):
        try:
            sampling.add(spec, scene)
        except run.DriverError as error:
            if error.status not in (run.NO_ISA, run.UNSUPPORTED):
                raise
            cli.say(f"{spec} {scene.name} left out: {error}")
    record = sampling.record
    if not record.profiles:
        raise StudyError("no phase can be sampled here", cli.CANNOT_RUN)
    if target:
        store.write_json(target.path / FILE, tables.merge(old or Hotspots(), record))
    few = [
        f"{one.phase} {one.scene} {one.variant}: {one.samples} samples only"
        for one in record.profiles
        if one.samples < min(ENOUGH, args.samples // 2)
    ]
    width = tables.core_width(machine.cpu()["microarchitecture"])
    rows = tables.table_rows(record, widest=width)
    result = {"hotspots": rows, "bounds": bounds_tables.rows(record), "record": record}
    result |= {"regions": bounds_tables.region_rows(record)}
    return Outcome(result, text(record, rows), args.run, few)


def skipped(spec: Spec) -> bool:
    """Says so and leaves out what this CPU lacks the instructions for."""
    if lacking := registry.missing_isa(spec):
        cli.say(f"{spec} left out: this CPU lacks {', '.join(lacking)}")
    return bool(lacking)
