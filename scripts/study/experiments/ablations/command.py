"""Gain and error of the ladder's single steps."""

import argparse
import itertools
import os
import secrets
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from study.core import cli, registry, run, show, store
from study.core.cli import Outcome, StudyError
from study.core.registry import Scene, Spec
from study.core.run import DriverError
from study.experiments import running
from study.experiments.ablations import chapter, counted, ideas
from study.experiments.ablations.measure import Ablation, Case, build_all, error_of, find, row_of, timed
from study.experiments.ablations.schema import SCHEMAS, Reason, Row
from study.pictures.gallery import Gallery

DESCRIPTION = """\
An ablation is a small patch kept with its phase, phases/NAME/ablations/TITLE.patch, and named NAME+TITLE.
Each is built, its picture held against the baseline's by the phase's tolerance, and timed next to the phase
that it is compared with: every program once a round, in random order, one frame per process launch. The gain
is the step's: the time without it over the time with it. With --ideas: the patches that take an idea out of
its phase, each on the scenes that it names; their table stands in the report and in the phases' lessons."""
STATUSES = {
    1: "an ablation does not apply, build or run, or is outside its tolerance",
    3: "nothing could run on this CPU",
}
SCENES = ("scene0", "mandelbulb")
SIZES = {False: (120, 10), True: (360, 20)}  # height, launches; ideas: the fastest phase's frame takes ms


def options(parser: argparse.ArgumentParser) -> None:
    add, whole = parser.add_argument, cli.at_least(1)
    cores = len(os.sched_getaffinity(0))
    (height, launches), (tall, many) = SIZES[False], SIZES[True]
    add("--phase", nargs="+", metavar="PHASE", help="opt2, or an ablation like opt2+horizontal; default: all")
    add("--ideas", action="store_true", help="only ideas of phases, into ideas.json")
    about = f"default: {' '.join(SCENES)}; with --ideas: those that each patch names"
    add("--scene", nargs="+", metavar="SCENE", help=about)
    add("-n", type=whole, metavar="HEIGHT", help=f"in pixels; default: {height}, with --ideas {tall}")
    add("--launches", type=whole, help=f"of each process; default: {launches}, with --ideas {many}")
    add("--seed", type=int, default=secrets.randbelow(2**32), help="of order and padding; default: random")
    add("--run", type=Path, metavar="DIR", help="for ablations.json or ideas.json; default: build/ablations")
    add("--cpu", type=int, default=run.FASTEST, help="CPU to pin to; default: of a fast core")
    parser.set_defaults(home="ablations")
    add("--jobs", type=whole, default=cores, help="built and verified at a time; default: CPUs")


class Study:
    """The ablations that can be measured here; the others with the reason."""

    def __init__(self, args: argparse.Namespace) -> None:
        self.args = args
        for name in args.scene or []:
            ideas.check_scene(name)
        run.cpu_set(args.cpu, 1)
        self.found, broken = find(args.phase)
        if args.ideas or not args.phase:
            self.found = [one for one in self.found if bool(one.idea) == args.ideas]
        self.failures = [Reason(ablation=name, reason=str(error)) for name, error in broken.items()]
        self.skipped: list[Reason] = []
        unable = {spec: " ".join(registry.missing_isa(spec)) for spec in self.specs()}
        if lacking := unable[Spec.parse(registry.BASE)]:
            raise StudyError(f"{registry.BASE} cannot run: this CPU lacks {lacking}", cli.CANNOT_RUN)
        self.drop({s: f"this CPU lacks {what}" for s, what in unable.items() if what}, self.skipped)
        self.drop(build_all(self.specs(), args.jobs), self.failures)

    def drop(self, reasons: Mapping[Spec, object], into: list[Reason]) -> None:
        for one in list(self.found):
            if reason := reasons.get(one.spec) or reasons.get(one.against):
                into.append(Reason(ablation=str(one.spec), reason=str(reason)))
                self.found.remove(one)

    def specs(self) -> list[Spec]:
        wanted = [spec for a in self.found for spec in (a.against, a.spec)]
        return list(dict.fromkeys([Spec.parse(registry.BASE), *wanted]))

    def pairs(self) -> list[tuple[Ablation, Scene]]:
        """Rows to be: each ablation on the scenes where its step can matter."""
        found = []
        for one in self.found:
            wanted = self.args.scene or (one.scenes if self.args.ideas else SCENES)
            names = [name for name in dict.fromkeys(wanted) if not one.scenes or name in one.scenes]
            found += [(one, ideas.find_scene(name)) for name in names]
        return found

    def _refused(self, ablation: Ablation, scene: Scene, refused: dict[Case, DriverError]) -> bool:
        """Whether a picture that the row needs could not be had; where not, that is noted."""
        for spec in (ablation.reference, ablation.against, ablation.spec):
            if error := refused.get((spec, scene.name)):
                into = self.skipped if error.status in (run.NO_ISA, run.UNSUPPORTED) else self.failures
                why = f"{spec} on {scene.name}: {error}"
                into.append(Reason(ablation=str(ablation.spec), reason=why))
                return True
        return False

    def measure(self) -> list[Row]:
        """All rows. Raises DriverError."""
        args, pairs = self.args, self.pairs()
        folder = args.run or registry.ROOT / "build" / "ablations"
        gallery = Gallery(folder / "images" if args.run else folder, self.specs())
        tasks = [
            (spec, scene, scene.size(args.n))
            for one, scene in pairs
            for spec in (one.reference, one.against, one.spec)
        ]
        refused = gallery.render_all(tasks, args.jobs)
        pairs = [pair for pair in pairs if not self._refused(*pair, refused)]
        metrics: dict[tuple[Spec, Case], dict[str, Any]] = {}
        for one, scene in pairs:
            for who, spec in itertools.product((one.reference, one.against), (one.against, one.spec)):
                if (key := (who, (spec, scene.name))) not in metrics:
                    metrics[key] = error_of(gallery, who, spec, scene, scene.size(args.n))
        cases = dict.fromkeys((spec, scene.name) for one, scene in pairs for spec in (one.against, one.spec))
        times = timed(list(cases), args.n, args.launches, args.seed, args.cpu)
        return [row_of(one, scene, scene.size(args.n), times, metrics) for one, scene in pairs]


def measure(args: argparse.Namespace) -> Outcome:
    height, launches = SIZES[args.ideas]
    args.n, args.launches = args.n or height, args.launches or launches
    study = Study(args)
    if not study.pairs():
        if study.failures:
            raise StudyError("\n".join(map(str, study.failures)))
        if study.skipped:
            raise StudyError(f"nothing to measure: {study.skipped[0].reason}", cli.CANNOT_RUN)
        raise StudyError(f"no ablation of these matters on {', '.join(args.scene or SCENES)}")
    kind = chapter.KINDS[0 if args.ideas else 1]
    folder = running.folder(args, kind.file)
    rows = study.measure()
    about = {"reference": registry.BASE, "n": args.n, **running.about(args)}
    if args.ideas:
        names = [name for phase in dict.fromkeys(row.against for row in rows) for name in counted.of(phase)]
        about["counted"] = counted.measure(names, args.launches, args.seed, args.cpu)
    result = SCHEMAS[kind.file](**about, rows=rows, skipped=study.skipped, failures=study.failures)
    store.write_json(folder / kind.file, cli.plain(result))
    lines = [show.markdown(show.table(rows, kind.columns)) if rows else "nothing was measured"]
    lines.append(kind.about.format(n=args.n, launches=args.launches))
    outside = [row for row in rows if row.verdict == "OUTSIDE"]
    failed = [f"{row.ablation} on {row.scene}: {'; '.join(row.failed)}" for row in outside]
    failed += map(str, study.failures)
    return Outcome(result, lines, folder, [f"skipped {one}" for one in study.skipped], failed)
