"""Single steps of the ladder: gain, error and FLOPs of each, beside what the paper credits to it."""

from __future__ import annotations

import argparse
import os
import secrets
from pathlib import Path

from study.core import cli, registry, run, show, store
from study.core.cli import Outcome, StudyError
from study.core.registry import Scene, Spec
from study.core.run import DriverError
from study.experiments import running
from study.experiments.ablations import chapter, ideas
from study.experiments.ablations import measure as ablations
from study.experiments.ablations.measure import Ablation, Case
from study.experiments.ablations.schema import SCHEMAS, Flops, Reason, Row
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
    add("--ideas", action="store_true", help="only ideas of phases, into ideas.json; no FLOPs")
    about = f"default: {' '.join(SCENES)}; with --ideas: those that each patch names"
    add("--scene", nargs="+", metavar="SCENE", help=about)
    about = f"height in pixels; default: {height}, with --ideas {tall}"
    add("-n", type=whole, metavar="HEIGHT", help=about)
    about = f"process launches of each; default: {launches}, with --ideas {many}"
    add("--launches", type=whole, help=about)
    add("--seed", type=int, default=secrets.randbelow(2**32), help="of order and padding; default: random")
    add("--run", type=Path, metavar="DIR", help="for ablations.json or ideas.json; default: build/ablations")
    add("--cpu", type=int, default=run.FASTEST, help="CPU to pin to; default: of a fast core")
    add("--no-flops", action="store_true", help="do not count FLOPs (saves the counting builds)")
    add("--jobs", type=whole, default=cores, help="built and verified at a time; default: CPUs")


class Study:
    """The ablations that can be measured here; the others with the reason."""

    def __init__(self, args: argparse.Namespace) -> None:
        self.args = args
        for name in args.scene or []:
            ideas.check_scene(name)
        run.cpu_set(args.cpu, 1)
        self.found, broken = ablations.find(args.phase)
        if args.ideas or not args.phase:
            self.found = [one for one in self.found if bool(one.idea) == args.ideas]
        self.failures = [Reason(ablation=name, reason=str(error)) for name, error in broken.items()]
        self.skipped: list[Reason] = []
        lacking = " ".join(registry.missing_isa(Spec.parse(registry.BASE)))
        if lacking:
            raise StudyError(f"{registry.BASE} cannot run: this CPU lacks {lacking}", cli.CANNOT_RUN)
        self._drop_unable()
        self._drop_unbuilt()

    def _drop(self, ablation: Ablation, reason: str, into: list[Reason]) -> None:
        into.append(Reason(ablation=str(ablation.spec), reason=reason))
        self.found.remove(ablation)

    def _drop_unable(self) -> None:
        for ablation in list(self.found):
            for spec in (ablation.spec, ablation.against):
                if lacking := registry.missing_isa(spec):
                    self._drop(ablation, f"this CPU lacks {' '.join(lacking)}", self.skipped)
                    break

    def _drop_unbuilt(self) -> None:
        targets = ["render"] if self.args.no_flops else ["render", "render-count"]
        problems = ablations.build_all(self.specs(), targets, self.args.jobs)
        for ablation in list(self.found):
            for spec in (ablation.spec, ablation.against):
                if error := problems.get((spec, "render")):
                    self._drop(ablation, str(error), self.failures)
                    break
        for (spec, target), error in problems.items():
            if target == "render-count":
                cli.say(f"no FLOPs of {spec}: {str(error).splitlines()[-1].strip()}")

    def specs(self) -> list[Spec]:
        """Every program, the baseline first."""
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

    @staticmethod
    def _cases(ablation: Ablation, scene: Scene) -> list[Case]:
        return [(ablation.against, scene.name), (ablation.spec, scene.name)]

    def _refused(self, ablation: Ablation, scene: Scene, refused: dict[Case, DriverError]) -> bool:
        """Whether a picture that the row needs could not be had: then the row is a failure, or skipped."""
        for case in [(ablation.reference, scene.name), *self._cases(ablation, scene)]:
            if error := refused.get(case):
                into = self.skipped if error.status in (run.NO_ISA, run.UNSUPPORTED) else self.failures
                why = f"{case[0]} on {case[1]}: {error}"
                into.append(Reason(ablation=str(ablation.spec), reason=why))
                return True
        return False

    def _flops(self, pairs: list[tuple[Ablation, Scene]], cases: list[Case]) -> list[dict[Case, Flops]]:
        """FLOPs by case for each pair: declared ones, or measured where one of the two declares none."""
        if self.args.no_flops:
            return [{} for _ in pairs]
        declared = ablations.count(cases, self.args.n, self.args.jobs)
        lacking = [a.costs or not declared.keys() >= {*self._cases(a, s)} for a, s in pairs]
        both = zip(pairs, lacking, strict=True)
        without = [case for pair, lacks in both if lacks for case in self._cases(*pair)]
        measured = ablations.measure_flops(dict.fromkeys(without), self.args.n)
        return [measured if lacks else declared for lacks in lacking]

    def measure(self) -> list[Row]:
        """All rows. Raises DriverError."""
        args, pairs = self.args, self.pairs()
        cases: list[Case] = list(dict.fromkeys(case for pair in pairs for case in self._cases(*pair)))
        folder = args.run or registry.ROOT / "build" / "ablations"
        gallery = Gallery(folder / "images" if args.run else folder, self.specs())
        sizes = {scene.name: scene.size(args.n) for _, scene in pairs}
        references = dict.fromkeys((ablation.reference, scene.name) for ablation, scene in pairs)
        all_cases = dict.fromkeys([*references, *cases])
        tasks = [(spec, ideas.find_scene(name), sizes[name]) for spec, name in all_cases]
        refused = gallery.render_all(tasks, args.jobs)
        pairs = [pair for pair in pairs if not self._refused(*pair, refused)]
        cases = [case for case in cases if any(case in self._cases(*pair) for pair in pairs)]
        judged = {
            (who, case): None
            for one, scene in pairs
            for case in self._cases(one, scene)
            for who in (one.reference, one.against)
        }
        metrics = {
            (who, case): ablations.error_of(gallery, who, case[0], ideas.find_scene(case[1]), sizes[case[1]])
            for who, case in judged
        }
        flops = self._flops(pairs, cases)
        times = ablations.measure(cases, args.n, args.launches, args.seed, args.cpu)
        return [
            ablations.row(a, s, sizes[s.name], times, metrics, counted)
            for (a, s), counted in zip(pairs, flops, strict=True)
        ]


def measure(args: argparse.Namespace) -> Outcome:
    height, launches = SIZES[args.ideas]
    args.n, args.launches = args.n or height, args.launches or launches
    args.no_flops = args.no_flops or args.ideas
    study = Study(args)
    if not study.pairs():
        if study.failures:
            raise StudyError("\n".join(map(str, study.failures)))
        if study.skipped:
            raise StudyError(f"nothing to measure: {study.skipped[0].reason}", cli.CANNOT_RUN)
        raise StudyError(f"no ablation of these matters on {', '.join(args.scene or SCENES)}")
    rows = study.measure()
    kind = chapter.KINDS[0 if args.ideas else 1]
    about = {"reference": registry.BASE, "n": args.n, **running.about(args)}
    result = SCHEMAS[kind.file](**about, rows=rows, skipped=study.skipped, failures=study.failures)
    folder = args.run or registry.ROOT / "build" / "ablations"
    store.write_json(folder / kind.file, cli.plain(result))
    table = show.markdown(show.table(rows, kind.columns)) if rows else "nothing was measured"
    failed = [
        f"{row.ablation} on {row.scene}: {'; '.join(row.failed)}" for row in rows if row.verdict == "OUTSIDE"
    ]
    failed += map(str, study.failures)
    remarks = [f"skipped {one}" for one in study.skipped]
    return Outcome(
        result, [table, kind.about.format(n=args.n, launches=args.launches)], folder, remarks, failed
    )
