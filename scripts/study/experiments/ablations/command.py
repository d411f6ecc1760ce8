"""Single steps of the ladder: gain, error and FLOPs of each, beside what the paper credits to it."""

from __future__ import annotations

import argparse
import os
import secrets
from pathlib import Path

from study.core import cli, machine, registry, run, store
from study.core.cli import StudyError
from study.core.registry import Scene, Spec
from study.core.run import DriverError
from study.experiments.ablations import ideas
from study.experiments.ablations import measure as ablations
from study.experiments.ablations.measure import Ablation, Case
from study.numbers import summary
from study.pictures.gallery import Gallery

DESCRIPTION = """\
An ablation is a small patch kept with its phase, phases/NAME/ablations/TITLE.patch, and named NAME+TITLE.
Each is built, its picture held against the baseline's by the phase's tolerance, and timed next to the phase
that it is compared with: every program once a round, in random order, one frame per process launch. The gain
is the step's: the time without it over the time with it. With --ideas: the patches that take an idea out of
its phase, each on the scenes that it names; their table stands in the report and in the phases' lessons."""

SCENES = ("scene0", "mandelbulb")


def arguments(argv: list[str] | None = None) -> argparse.Namespace:
    statuses = {1: "an ablation does not apply, build or run, or is outside its tolerance"}
    parser = cli.parser(DESCRIPTION, statuses | {3: "nothing could run on this CPU"})
    add = parser.add_argument
    add("--phase", nargs="+", metavar="PHASE", help="opt2, or an ablation like opt2+horizontal; default: all")
    add("--ideas", action="store_true", help="only ideas of phases, into ideas.json; no FLOPs")
    about = f"default: {' '.join(SCENES)}; with --ideas: those that each patch names"
    add("--scene", nargs="+", metavar="SCENE", help=about)
    add("-n", type=cli.at_least(1), default=120, metavar="HEIGHT", help="height in pixels; default: 120")
    add("--launches", type=cli.at_least(1), default=10, help="process launches of each; default: 10")
    add("--seed", type=int, help="of order and padding; default: random")
    add("--cpu", type=int, default=run.FASTEST, help="CPU to pin to; default: of a fast core")
    add("--no-flops", action="store_true", help="do not count FLOPs (saves the counting builds)")
    add("--run", type=Path, metavar="DIR", help="for ablations.json or ideas.json; default: build/ablations")
    cores = len(os.sched_getaffinity(0))
    add(
        "--jobs",
        type=cli.at_least(1),
        default=cores,
        help="built and verified at a time; default: CPUs",
    )
    return parser.parse_args(argv)


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
        self.failures = [{"ablation": name, "reason": str(error)} for name, error in broken.items()]
        self.skipped: list[dict[str, str]] = []
        lacking = " ".join(registry.missing_isa(Spec.parse(registry.BASE)))
        if lacking:
            raise StudyError(f"{registry.BASE} cannot run: this CPU lacks {lacking}", cli.CANNOT_RUN)
        self._drop_unable()
        self._drop_unbuilt()

    def _drop(self, ablation: Ablation, reason: str, into: list[dict[str, str]]) -> None:
        into.append({"ablation": str(ablation.spec), "reason": reason})
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
                into.append({"ablation": str(ablation.spec), "reason": f"{case[0]} on {case[1]}: {error}"})
                return True
        return False

    def _flops(self, pairs: list[tuple[Ablation, Scene]], cases: list[Case]) -> list[dict]:
        """FLOPs by case: declared ones of all, measured ones of what has no declared costs."""
        if self.args.no_flops:
            return [{}, {}]
        without = dict.fromkeys(case for a, s in pairs if a.costs for case in self._cases(a, s))
        declared = ablations.count(cases, self.args.n, self.args.jobs)
        return [declared, ablations.measure_flops(without, self.args.n)]

    def measure(self) -> list[dict]:
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
        declared, measured = self._flops(pairs, cases)
        times = ablations.measure(cases, args.n, args.launches, args.seed, args.cpu)
        return [
            ablations.row(a, s, sizes[s.name], times, metrics, measured if a.costs else declared)
            for a, s in pairs
        ]


def main() -> int:
    args = arguments()
    args.seed = secrets.randbelow(2**32) if args.seed is None else args.seed
    args.no_flops = args.no_flops or args.ideas
    study = Study(args)
    if not study.pairs():
        for item in study.failures[1:]:
            cli.say(f"FAIL {item['ablation']}: {item['reason']}")
        if study.failures:
            raise StudyError(study.failures[0]["reason"])
        if study.skipped:
            raise StudyError(f"nothing to measure: {study.skipped[0]['reason']}", cli.CANNOT_RUN)
        raise StudyError(f"no ablation of these matters on {', '.join(args.scene or SCENES)}")
    rows = study.measure()
    settings = {key: getattr(args, key) for key in ("n", "launches", "seed", "cpu")}
    result = {"schema": 1, "reference": registry.BASE, **settings, "context": machine.context(), "rows": rows}
    result |= {"skipped": study.skipped, "failures": study.failures}
    folder = args.run or registry.ROOT / "build" / "ablations"
    path = folder / (ideas.FILE if args.ideas else "ablations.json")
    store.write_json(path, result)
    report(result, folder, args.json)
    outside = any(row["verdict"] == "OUTSIDE" for row in rows)
    return cli.FAILED if outside or study.failures else cli.OK


def report(result: dict, folder: Path, as_json: bool) -> None:
    """The table, or everything as JSON; then what each step is, and what failed."""
    rows = result["rows"]
    if as_json:
        cli.emit(result, folder)
    else:
        print(summary.table(ablations.shown(rows), ablations.COLUMNS) if rows else "nothing was measured")
        print(
            f"n = {result['n']}, {result['launches']} launches of one frame. The gain is the step's, "
            "whichever side has it; FLOPs ×: machine FLOPs with the step over those without it. "
            "Errors: linear RGB against baseline, or against a phase that has no tolerance to baseline."
        )
        for row in {row["ablation"]: row for row in rows}.values():
            print(f"{row['ablation']}: {row['what']}. Paper: {row['paper']}")
    for row in rows:
        if row["verdict"] == "OUTSIDE":
            cli.say(f"FAIL {row['ablation']} on {row['scene']}: {'; '.join(row['failed'])}")
    for item in result["failures"]:
        cli.say(f"FAIL {item['ablation']}: {item['reason']}")
    for item in result["skipped"]:
        cli.say(f"skipped {item['ablation']}: {item['reason']}")
