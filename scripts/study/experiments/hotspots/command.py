"""Which functions take the time (Tables 2 and 4) and what bounds them (Table 3), beside the paper's."""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from study.bounds import profiles
from study.bounds import topdown as bounds
from study.core import cli, machine, progress, registry, run, show, store
from study.core.cli import StudyError
from study.core.registry import ROOT, Scene, Spec
from study.counting import elf, perf, symbols
from study.experiments.hotspots import bounds_tables as bounds_page
from study.experiments.hotspots import chapter as hotspots_chapter
from study.experiments.hotspots import tables as hotspots

VARIANTS = ("shipped", "calls")
ENOUGH = 1000  # samples: under them intervals are wider than what they are to tell apart

Row = dict[str, Any]


def counted(spec: Spec, scene: Scene, args: Any, variant: str, said: set[str]) -> dict[str, int]:
    """Instructions of a frame by function, by the block counters; none where they cannot be had."""
    try:
        blocks = importlib.import_module("study.counting.blocks")
        if lacking := blocks.missing():
            raise StudyError(lacking)
        wide, high = scene.size(args.n)
        found: dict[str, int] = {}
        for name, counts in blocks.measure(spec, scene.path, high, wide, variant=variant).functions.items():
            plain = symbols.canonical(name)
            found[plain] = found.get(plain, 0) + counts.instructions
        return found
    except ImportError:
        return {}
    except StudyError as error:
        if str(error) not in said:
            cli.say(f"no instruction counts: {error}")
            said.add(str(error))
        return {}


def lanes(spec: Spec, scene: Scene, args: Any, said: set[str]) -> dict[str, float]:
    """Lanes at useful work by function, of SIMD phases, by the counting build."""
    if registry.find_phase(spec.phase).lanes == 1:
        return {}
    try:
        wide, high = scene.size(args.n)
        made = run.render(spec, scene.path, high, wide, target="render-count")
        return hotspots.lanes_active(made["by_function"])
    except (StudyError, KeyError) as error:
        if str(error) not in said:
            cli.say(f"{spec}: no lane counts: {error}")
            said.add(str(error))
        return {}


def bound(spec: Spec, scene: Scene, profile: profiles.Profile, args: Any, said: set[str]) -> Row:
    """One row of Table 3 and its regions: by the PMU where it can, else by the model."""

    def say(line: str) -> None:
        if line not in said:
            cli.say(line)
            said.add(line)

    folder = ROOT / "build" / str(spec)
    built = elf.read(folder / "render-lines", folder / profiles.OBJECTS["shipped"])
    instructions = counted(spec, scene, args, "shipped", said)
    made = bounds.model(profile, built, instructions, say, osaca=not args.no_osaca)
    try:
        if by_pmu := bounds.topdown(spec, scene, args.n):
            made |= {"by": "pmu", "modelled_split": made["split"]} | by_pmu
    except StudyError as error:
        say(f"no top-down split by the PMU: {error}")
    return made


def measure(pairs: Sequence[tuple[Spec, Scene]], args: Any) -> Row:
    """Everything of one call, as hotspots.json has it."""
    record: Row = {"schema": 1, "profiles": [], "beside": {}, "bounds": []}
    said: set[str] = set()
    for spec, scene in progress.each(pairs, "sample"):
        try:
            by = {
                variant: profiles.measure(spec, scene, args.n, None, variant, args.samples, args.cpu)
                for variant in VARIANTS
            }
        except run.DriverError as error:
            if error.status in (run.NO_ISA, run.UNSUPPORTED):
                cli.say(f"{spec} {scene.name} left out: {error}")
                continue
            raise
        record["profiles"] += [profile.to_json() for profile in by.values()]
        calls, shipped = by["calls"], by["shipped"]
        key = "|".join(map(str, (scene.name, spec, shipped.width, shipped.height)))
        record["beside"][key] = {
            "per_cycle": hotspots.per_cycle(calls, counted(spec, scene, args, "calls", said)),
            "lanes_active": lanes(spec, scene, args, said),
        }
        if not args.no_bounds:
            try:
                record["bounds"].append(bound(spec, scene, shipped, args, said))
            except StudyError as error:
                if str(error) not in said:
                    cli.say(f"no bounds: {error}")
                    said.add(str(error))
    return record


def table(record: Row) -> list[Row]:
    """Rows of Tables 2 and 4 of this machine."""
    return hotspots.table_rows(record, widest=hotspots.core_width(machine.cpu()["microarchitecture"]))


def text(record: Row) -> str:
    """All tables for people, each with what it says and does not say."""
    parts = [show.markdown(show.table(table(record), hotspots.COLUMNS)), hotspots.ABOUT]
    parts.append("\n".join(f"- {note}" for note in hotspots.notes(record)) + "\n")
    if record["bounds"]:
        parts.append(show.markdown(show.table(bounds_page.rows(record), bounds_page.COLUMNS)))
        parts.append(bounds_page.ABOUT)
        parts += sorted({f"{one['remark']}\n" for one in record["bounds"] if one.get("remark")})
        regions = bounds_page.region_rows(record)
        if regions:
            parts.append(show.markdown(show.table(regions, bounds_page.REGIONS)))
    return "\n".join(parts)


def main() -> int:
    parser = cli.parser(__doc__)
    parser.add_argument(
        "--phase", nargs="+", metavar="PHASE", help="phases, or opt2@opt3 (all of the ladder)"
    )
    parser.add_argument("--scene", nargs="+", default=["scene0"], metavar="SCENE", help="scenes (scene0)")
    parser.add_argument("-n", type=int, default=240, metavar="HEIGHT", help="picture height (%(default)s)")
    parser.add_argument(
        "--samples", type=int, default=3000, metavar="K", help="at least, of each build (%(default)s)"
    )
    parser.add_argument("--cpu", type=int, help="pin to this CPU")
    parser.add_argument("--run", type=Path, metavar="DIR", help="for hotspots.json; default: none")
    parser.add_argument("--no-bounds", action="store_true", help="without Table 3")
    parser.add_argument("--no-osaca", action="store_true", help="Table 3 without OSACA, half a minute faster")
    args = parser.parse_args()
    if not 1 <= args.n <= 32768:
        raise StudyError(f"-n: a height of 1 to 32768 pixels is required, not {args.n}")
    if not 100 <= args.samples <= 1_000_000:
        raise StudyError(f"--samples: 100 to 1000000 are required, not {args.samples}")
    target = store.Run.open(args.run) if args.run else None
    if target:
        hotspots_chapter.hot(
            target.path
        )  # what is there must be sound before minutes of sampling are added to it
    ladder = [name for name, phase in registry.phases().items() if phase.family == "ladder"]
    scenes = [registry.find_scene(name) for name in args.scene]
    pairs = [(Spec.parse(name), scene) for scene in scenes for name in args.phase or ladder]
    if lacking := perf.missing():
        raise StudyError(lacking, cli.CANNOT_RUN)
    record = measure([pair for pair in pairs if not skipped(pair[0])], args)
    if not record["profiles"]:
        raise StudyError("no phase can be sampled here", cli.CANNOT_RUN)
    if target:
        path = target.path / "hotspots.json"
        store.write_json(path, hotspots.merge(hotspots.read(path), record))
    for one in record["profiles"]:
        if one["samples"] < min(ENOUGH, args.samples // 2):
            cli.say(f"{one['phase']} {one['scene']} {one['variant']}: {one['samples']} samples only")
    if args.json:
        rows = {"hotspots": table(record), "bounds": bounds_page.rows(record)}
        cli.emit(rows | {"regions": bounds_page.region_rows(record), "record": record}, args.run)
    else:
        print(text(record), end="")
    return cli.OK


def skipped(spec: Spec) -> bool:
    """Says so and leaves out what this CPU lacks the instructions for."""
    if lacking := registry.missing_isa(spec):
        cli.say(f"{spec} left out: this CPU lacks {', '.join(lacking)}")
    return bool(lacking)
