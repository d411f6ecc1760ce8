"""The main job, which `make study` calls: build, sweep, verify, draw, report."""

import argparse
import math
import re
import shutil
import sys
import time
import traceback
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

import msgspec

from study.core import cli, commands, registry, store
from study.core.build import build, build_together
from study.core.cli import Outcome, StudyError
from study.core.registry import ROOT, Spec, cpu_supports
from study.core.run import USABLE
from study.core.run_schema import STUDY, Plan
from study.experiments import cuts, experiment
from study.experiments.experiment import DEPTHS, Call, Experiment, Study
from study.numbers import analysis, ladder, stats

PAGE = ROOT / "report" / "out" / "index.html"
PAGE_SECONDS = 480  # a page takes some twenty seconds: one with the sweep that is younger is left as it is
SWEEP_SECONDS = {"quick": 150, "standard": 240}  # of a sweep whose pictures are as large as fits
QUICK_ENDS = 460  # s: chapters that a quick study has not begun by then are left out, on slow machines
SLACK = 1.5  # of a quick sweep that other work slows down: without six launches there is no interval
LAUNCHES = {"quick": 6, "standard": 10}
FEW_FROM = 1.0  # s: a longer frame has three launches, which know it to a percent
LONG_FRAME = 0.25  # s: caches and branch predictors settle in milliseconds, so such a frame warms itself up
CALIBRATED = (45, 90)  # heights whose frames tell what larger ones take
HEIGHTS = (360, 320, 288, 256, 224, 192, 160, 128, 96, 64)  # of the headline
FIRST, FIRST_HEIGHT, FIRST_LAUNCHES = ROOT / "build" / "first-look", 90, 6
PART_HEIGHT = 180  # of a run that is made for single parts
FULL_SIZES, FULL_LAUNCHES, FULL_HEIGHT = [*range(100, 2001, 100)], 4, 720  # the paper's sweep
STATUSES = {
    cli.FAILED: "done, and a phase is outside its tolerance or crashed: the report says which",
    cli.CRASHED: "an experiment broke off; the other parts are done",
}


def options(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    about = "quick: 10 minutes; standard: 40; full: the paper's sweep, hours; default: %(default)s"
    add("--depth", choices=DEPTHS, default="quick", help=about)
    about = "only this, for the newest run (a small one is made where there is none), and the report"
    add("--part", action="append", choices=experiment.find_all(), metavar="NAME", help=about)
    add("--scene", nargs="+", default=["scene0", "mandelbulb"], metavar="SCENE", help="scenes to time")
    about = "for the sweep; default: 150 (quick), 240 (standard)"
    add("--budget", type=cli.at_least(1, float), metavar="SECONDS", help=about)
    add("--results", type=Path, default=ROOT / "results", metavar="DIR", help="parent of the run's folder")


def call(name: str, *words: str | Path | int) -> Outcome:
    return commands.called(name, list(map(str, words)))[0]


def swept(scenes: Sequence[str], sizes: Sequence[int], launches: int, *more: str | Path) -> Outcome:
    plan = ["--scene", *scenes, "-n", *sizes, "--launches", launches, "--long", LONG_FRAME, "--few", FEW_FROM]
    return call("sweep", *map(str, plan), *more)


def newest(args: argparse.Namespace) -> tuple[Path | None, int]:
    """The newest run below the results and the height of its headline; none without a timed frame."""
    try:
        data = analysis.load(store.latest(args.results).path)
    except StudyError:
        return None, 0
    sizes = [ladder.headline_size(data, scene) for scene in args.scene]
    return (None, 0) if None in sizes else (data.path, max(size[1] for size in sizes if size))


def heights(height: int, depth: str) -> list[int]:
    """What is timed with the headline: a quick study's series of heights is the scaling chapter's alone."""
    return [height] if depth == "quick" else [height // 4, height // 2, height]


def choose_height(scenes: Sequence[str], seconds: float, launches: int, depth: str) -> int:
    """The largest picture whose interleaved rounds fit the time, by the sweep's own calibration.

    Two sizes of each program tell its start and its frame apart; a frame's time goes with its pixels.
    """
    least, more = CALIBRATED
    plan = msgspec.convert(swept(scenes, CALIBRATED, 1, "--dry-run").result, Plan)
    frames = plan.reps + plan.warmup
    programs: dict[tuple[str, str], dict[int, float]] = {}
    for one in plan.configurations:
        programs.setdefault((one.spec, one.scene), {})[one.height] = one.estimate_s

    def launched(by_height: dict[int, float], height: int) -> float:
        frame = (by_height[more] - by_height[least]) / frames / (more**2 - least**2) * height**2
        start = max(by_height[least] - frame * frames * (least / height) ** 2, 0)
        count = min(stats.FEWEST if frame > FEW_FROM else launches, launches)
        return count * (start + frame * (1 if frame > LONG_FRAME else frames))

    def total(height: int) -> float:
        return sum(launched(program, n) for program in programs.values() for n in heights(height, depth))

    return next((height for height in HEIGHTS if total(height) <= seconds), HEIGHTS[-1])


def sweep(args: argparse.Namespace) -> tuple[Outcome, int]:
    """Times every phase into a new run, and the headline's height."""
    more: list[str | Path] = ["--results", args.results]
    if args.depth == "full":
        sizes, launches = FULL_SIZES, FULL_LAUNCHES
        height = FULL_HEIGHT
    elif args.part:  # only to stand under the part asked for
        height, launches = PART_HEIGHT, 6
        sizes = [height // 2, height]
    else:
        launches = LAUNCHES[args.depth]
        height = choose_height(args.scene, args.budget, launches, args.depth)
        sizes = heights(height, args.depth)
        more += ["--budget", str(args.budget * (SLACK if args.depth == "quick" else 1))]
        more += ["--no-second-base"] if args.depth == "quick" else []
    return swept(args.scene, sizes, launches, *more), height


def counting(run: Path) -> list[tuple[Spec, str]]:
    """The builds of what a quick study counts and samples, all in one make: a core each."""
    timed = dict.fromkeys(cell.spec for cell in analysis.load(run).cells)
    made = [(Spec.parse(name), "render-blocks") for name in timed]
    made += [(Spec(name, name), "render-count") for name in cuts.counted()]
    few = [Spec(name, name) for name in cuts.three()[:2]]
    return made + [(spec, f"render-{kind}") for spec in few for kind in ("calls", "lines", "blocks-calls")]


def chosen(args: argparse.Namespace) -> list[Experiment]:
    """The experiments that this study has, in its order; the sweep is made before."""
    known = experiment.find_all()
    if args.part:
        return [known[name] for name in known if name in args.part and name != "sweep"]
    level = DEPTHS.index(args.depth)
    return [one for one in known.values() if one.depth and DEPTHS.index(one.depth) <= level and one.turn]


@dataclass
class Wrong:
    """What went wrong in a study, a sentence each: checks that failed, and commands that broke off."""

    failed: list[str] = field(default_factory=list)
    broken: list[str] = field(default_factory=list)

    def measure(self, one: Experiment, study: Study) -> None:
        """Runs an experiment's commands. What breaks one ends that experiment alone."""
        for each in one.commands(study):
            try:
                self._call(one, each)
            except StudyError as error:
                if each.may_lack and error.exit_status == cli.CANNOT_RUN:
                    cli.say(f"{each.command}: {error}")
                else:
                    self.broken.append(f"stepwise {each.command}: {error}")
            except Exception as error:
                traceback.print_exc()
                self.broken.append(f"stepwise {each.command} crashed: {type(error).__name__}")

    def _call(self, one: Experiment, each: Call) -> None:
        outcome = call(each.command, *each.arguments)
        for text in [*outcome.remarks, *outcome.failed]:
            cli.say(text)
        if outcome.ended == cli.FAILED and each.judges:
            self.failed.append(f"{one.name}: {'; '.join(outcome.failed[:1]) or 'a check failed'}")
        elif outcome.ended and not (outcome.ended == cli.CANNOT_RUN and each.may_lack):
            self.broken.append(f"stepwise {each.command} ended with status {outcome.ended}")

    def status(self) -> int:
        return cli.CRASHED if self.broken else cli.FAILED if self.failed else cli.OK


def report(run: Path, left: Sequence[str]) -> None:
    """The page as far as it goes; it names what is still to come."""
    with cli.heard(lambda _: None):  # the page has its remarks
        call("report", run, *(["--running", *left] if left else []))


def finish(run: Path) -> None:
    report(run, [])
    for name in ("tables", "figures"):
        for file in filter(Path.is_file, (PAGE.parent / name).rglob("*")):
            store.write_bytes(run / file.relative_to(PAGE.parent), file.read_bytes())


class Chapter:
    """A line of the terminal: what is measured, then what came out. Remarks are kept for the page."""

    def __init__(self, begin: float, title: str) -> None:
        self.begin, self.title, self.result = begin, title, ""
        self.remarks: list[str] = []
        self.heard = cli.heard(self.remarks.append)

    def __enter__(self) -> Self:
        if sys.stderr.isatty():
            print(f"\r\033[K{self.title} …", end="", file=sys.stderr, flush=True)
        self.heard.__enter__()
        return self

    def __exit__(self, kind: type[BaseException] | None, *how: Any) -> None:
        self.heard.__exit__(kind, *how)
        if kind:  # it is the last thing that is said
            return cli.say("\n".join(["", *self.remarks[-3:]]))
        line = f"[{time.monotonic() - self.begin:3.0f} s] {self.title}" + f": {self.result}" * bool(
            self.result
        )
        cli.say("\r\033[K" * sys.stderr.isatty() + line)


def came_out(run: Path, one: Experiment) -> str:
    """The first clause of what the experiment's first chapter answers."""
    if not one.sections:
        return ""
    try:
        answer = one.sections[0][1](analysis.load(run)).answer
    except StudyError as error:
        return str(error)
    return re.split(r"[.;] ", f"{answer} ")[0].rstrip(" .")


def first_look(scene: str, specs: Sequence[Spec], left: Sequence[str]) -> None:
    """A page within a minute and a half: small pictures, few launches, a run of its own below build/."""
    more = ["--phase", *map(str, specs), "--results", str(FIRST)]
    made = swept([scene], [FIRST_HEIGHT], FIRST_LAUNCHES, *more)
    about = f"the study itself (this page is a first look: {len(specs)} phases, {FIRST_HEIGHT} pixels high, "
    assert made.run
    report(made.run, [f"{about}{FIRST_LAUNCHES} launches)", *left])


def run(args: argparse.Namespace) -> Outcome:
    args.budget = args.budget or SWEEP_SECONDS.get(args.depth)
    begin = time.monotonic()
    for scene in args.scene:
        registry.find_scene(scene)  # before the last page goes

    shutil.rmtree(PAGE.parent, ignore_errors=True)  # what is of another run must not stand beside this one's
    names, parts = registry.ladder(), chosen(args)
    if not args.part:
        with Chapter(begin, "a first look") as chapter:
            specs = [Spec(name, name) for name, phase in names.items() if not phase.variants]
            build_together([(spec, "render") for spec in specs], len(USABLE))
            first_look(args.scene[0], [spec for spec in specs if cpu_supports(spec)], [p.what for p in parts])
            chapter.result = f"{PAGE}, which grows"
    with Chapter(begin, f"building {len(names)} phases"):
        specs = [Spec(name, name) for name in names]
        build_together([(spec, "render") for spec in specs], len(USABLE))
        for spec in specs:
            build(spec)
    wrong = Wrong()
    old = args.part and "sweep" not in args.part
    folder, height = newest(args) if old else (None, 0)
    if folder is None:
        timing = experiment.find_all()["sweep"]
        with Chapter(begin, timing.what) as chapter:
            made, height = sweep(args)
            assert made.run
            folder = made.run
            if not analysis.load(folder).cells:
                raise StudyError("no phase was timed: a round takes longer than --budget", cli.CANNOT_RUN)
            chapter.result = came_out(folder, timing)
        if made.ended:
            wrong.failed.append("a phase crashed")
        quick = args.depth == "quick" and not args.part
        cuts.note(folder, "sweep", timing.cut if quick else "", [*chapter.remarks, *made.remarks])
    study = Study(folder, args.scene, height, args.depth, bool(args.part))
    drawn, late = -math.inf, []  # without the sweep
    for number, one in enumerate(parts):
        if study.quick and number > 1 and time.monotonic() - begin > QUICK_ENDS:  # pictures are always judged
            late.append(one.name)
            continue
        if time.monotonic() - drawn >= PAGE_SECONDS:
            report(folder, [other.what for other in parts[number:]])
            drawn = time.monotonic()
        if number == 0 and study.quick:
            with Chapter(begin, "building what counts"):
                build_together(counting(folder), len(USABLE))
        with Chapter(begin, one.what) as chapter:
            wrong.measure(one, study)
            chapter.result = came_out(folder, one)
        cuts.note(folder, one.name, one.cut if study.quick else "", chapter.remarks)
    if late:
        cuts.note(folder, "study", "", [left := f"left out, ten minutes are over: make {' '.join(late)}"])
        cli.say(left)
    with Chapter(begin, "tables and report"):
        finish(folder)
    if remarks := cuts.remarks(folder):
        cli.say(f"{len(remarks)} remarks: {folder / STUDY}")
    cli.say(f"data: {folder}")
    cli.say(f"page: {PAGE} (open it in a browser: xdg-open {PAGE})")
    said = [f"study: {text}; the page shows which" for text in wrong.failed]
    said += [f"study: {text}" for text in wrong.broken]
    result: dict[str, Any] = {"report": PAGE, "height": height}
    result |= {"failed": wrong.failed, "crashed": wrong.broken}
    return Outcome(result, run=folder, remarks=said, status=wrong.status())
