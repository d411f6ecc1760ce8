"""The main job: build, sweep, verify, draw, report. `make study` calls it after installing what it needs."""

from __future__ import annotations

import argparse
import json
import math
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from study.core import cli, registry, store
from study.core.build import build, build_together
from study.core.host import child
from study.core.registry import ROOT, Spec, cpu_supports
from study.core.run import USABLE
from study.experiments import cuts, experiment
from study.experiments.experiment import DEPTHS, Experiment, Study
from study.numbers import analysis, ladder

STEPWISE = ROOT / "scripts" / "stepwise"
PAGE = ROOT / "report" / "out" / "index.html"
PAGE_SECONDS = 240  # a page takes some twenty seconds: one that is younger is left as it is
SWEEP_SECONDS = {"quick": 75, "standard": 240}  # of a sweep whose pictures are as large as fits
SLACK = 1.5  # of a quick sweep that other work slows down: without six launches there is no interval
LAUNCHES = {"quick": 6, "standard": 10}
LONG_FRAME = 0.25  # s: caches and branch predictors settle in milliseconds, so such a frame warms itself up
CALIBRATED = (45, 90)  # heights whose frames tell what larger ones take
HEIGHTS = (360, 320, 288, 256, 224, 192, 160, 128, 96, 64)  # of the headline
FIRST, FIRST_HEIGHT, FIRST_LAUNCHES = ROOT / "build" / "first-look", 90, 6
PART_HEIGHT = 180  # of a run that is made for single parts
FULL = {"sizes": [str(n) for n in range(100, 2001, 100)], "launches": "4", "height": 720}  # the paper's sweep
CHECKED = (cli.OK, cli.FAILED)  # of commands that judge what they measure


class Crashed(cli.StudyError):
    """A command that ended by a bug or a signal and has judged nothing."""


def run_command(
    name: str, *arguments: str, capture: bool = False, accepted: Sequence[int] = (cli.OK,)
) -> subprocess.CompletedProcess[str]:
    """Runs a command of stepwise; its progress goes to the terminal, its output (if captured) comes back.

    Crashed where it crashed or was killed, StudyError for any other status that is not accepted.
    """
    command = [sys.executable, str(STEPWISE), name, *arguments]
    done = child.run(command, stdout=subprocess.PIPE if capture else None, text=True, timeout=math.inf)
    if done.returncode == cli.CRASHED:
        raise Crashed(f"stepwise {name} crashed; its traceback is above", cli.CRASHED)
    if done.returncode < 0:
        number = -done.returncode
        raise Crashed(f"stepwise {name} was killed by {signal.Signals(number).name}", cli.CRASHED)
    if done.returncode not in accepted:
        status = done.returncode
        raise cli.StudyError(f"stepwise {name} ended with status {status}; see above", status)
    return done


def sweep_plan(height: int, scenes: Sequence[str], launches: int) -> list[str]:
    """Arguments of a sweep whose headline is `height` pixels high, with half and a quarter of it beside."""
    sizes = [str(height // 4), str(height // 2), str(height)]
    return ["--scene", *scenes, "-n", *sizes, "--launches", str(launches), "--long", str(LONG_FRAME)]


def newest(options: argparse.Namespace) -> tuple[Path | None, int]:
    """The newest run below the results and the height of its headline; none without a timed frame."""
    try:
        data = analysis.load(store.latest(options.results).path)
    except cli.StudyError:
        return None, 0
    sizes = [ladder.headline_size(data, scene) for scene in options.scene]
    return (None, 0) if None in sizes else (data.path, max(size[1] for size in sizes if size))


def choose_height(scenes: Sequence[str], seconds: float, launches: int) -> int:
    """The largest picture whose interleaved rounds fit the time, by the sweep's own calibration.

    Two sizes of each program tell its start and its frame apart; a frame's time goes with its pixels.
    """
    least, more = CALIBRATED
    plan = ["--scene", *scenes, "-n", str(least), str(more), "--launches", "1"]
    found = json.loads(run_command("sweep", *plan, "--dry-run", "--json", capture=True).stdout)["result"]
    frames = found["reps"] + found["warmup"]
    programs: dict[tuple[str, str], dict[int, float]] = {}
    for one in found["configurations"]:
        programs.setdefault((one["spec"], one["scene"]), {})[one["height"]] = one["estimate_s"]

    def launch(by_height: dict[int, float], height: int) -> float:
        frame = (by_height[more] - by_height[least]) / frames / (more**2 - least**2) * height**2
        start = max(by_height[least] - frame * frames * (least / height) ** 2, 0)
        return start + frame * (1 if frame > LONG_FRAME else frames)

    def total(height: int) -> float:
        sizes = (height // 4, height // 2, height)
        return launches * sum(launch(program, n) for program in programs.values() for n in sizes)

    return next((height for height in HEIGHTS if total(height) <= seconds), HEIGHTS[-1])


def sweep(options: argparse.Namespace) -> dict[str, Any]:
    """Times every phase into a new run: its folder, what crashed, and the headline's height."""
    if options.depth == "full":
        height = FULL["height"]
        arguments = ["--scene", *options.scene, "-n", *FULL["sizes"], "--launches", FULL["launches"]]
        arguments += ["--long", str(LONG_FRAME)]
    elif options.part:  # only to stand under the part asked for
        height = PART_HEIGHT
        arguments = ["--scene", *options.scene, "-n", str(height // 2), str(height), "--launches", "6"]
        arguments += ["--long", str(LONG_FRAME)]
    else:
        launches = LAUNCHES[options.depth]
        height = choose_height(options.scene, options.budget, launches)
        most = options.budget * (SLACK if options.depth == "quick" else 1)
        arguments = [*sweep_plan(height, options.scene, launches), "--budget", str(most)]
    cli.say(
        f"headline at n = {height}; a kill loses one frame, scripts/stepwise sweep --run DIR --resume goes on"
    )
    arguments += ["--results", str(options.results), "--json"]
    done = run_command("sweep", *arguments, capture=True, accepted=CHECKED)
    said = json.loads(done.stdout)
    return {"run": said["run"], "failures": said["result"]["failures"], "height": height}


def counting(run: Path) -> list[tuple[Spec, str]]:
    """The builds of what a quick study counts and samples, all in one make: a core each."""
    timed = dict.fromkeys(cell.spec for cell in analysis.load(run).cells)
    made = [(Spec.parse(name), "render-blocks") for name in timed]
    made += [(Spec(name, name), "render-count") for name in registry.ladder()]
    few = [Spec(name, name) for name in cuts.three()]
    return made + [(spec, f"render-{kind}") for spec in few for kind in ("calls", "lines", "blocks-calls")]


def measure(one: Experiment, study: Study) -> bool:
    """Runs an experiment's commands: whether all is well. Raises Crashed, or StudyError for what broke."""
    good = True
    for call in one.calls(study):
        accepted = (cli.OK, *[cli.FAILED] * call.judges, *[cli.CANNOT_RUN] * call.may_lack)
        done = run_command(call.command, *call.arguments, capture=True, accepted=accepted)
        good &= done.returncode != cli.FAILED
    return good


def chosen(options: argparse.Namespace) -> list[Experiment]:
    """The experiments that this study has, in its order; the sweep is made before."""
    known = experiment.find_all()
    if options.part:
        return [known[name] for name in known if name in options.part and name != "sweep"]
    level = DEPTHS.index(options.depth)
    return [one for one in known.values() if one.depth and DEPTHS.index(one.depth) <= level and one.turn]


def arguments() -> argparse.Namespace:
    parser = cli.parser(
        __doc__ or "",
        {
            cli.FAILED: "done, and a phase is outside its tolerance or crashed: the report says which",
            cli.CRASHED: "a command of the study crashed, or this one; the other parts are done",
        },
    )
    add = parser.add_argument
    about = "quick: 10 minutes; standard: 40; full: the paper's sweep, hours; default: %(default)s"
    add("--depth", choices=DEPTHS, default="quick", help=about)
    about = "only this, for the newest run (a small one is made where there is none), and the report"
    add("--part", action="append", choices=experiment.find_all(), metavar="NAME", help=about)
    add("--scene", nargs="+", default=["scene0", "mandelbulb"], metavar="SCENE", help="scenes to time")
    about = "for the sweep; default: 75 (quick), 240 (standard)"
    add("--budget", type=cli.at_least(1, float), metavar="SECONDS", help=about)
    add("--results", type=Path, default=ROOT / "results", metavar="DIR", help="parent of the run's folder")
    options = parser.parse_args()
    options.budget = options.budget or SWEEP_SECONDS.get(options.depth)
    return options


@dataclass
class Wrong:
    """What went wrong in a study: checks that failed, and commands that crashed, a sentence each."""

    failed: list[str] = field(default_factory=list)
    crashed: list[str] = field(default_factory=list)

    def hold(self, good: Callable[[], bool], sentence: str) -> None:
        """Note the sentence if the check fails. A crash is noted as a crash, and the study goes on."""
        try:
            if not good():
                self.failed.append(sentence)
        except Crashed as error:
            self.crashed.append(str(error))

    def status(self) -> int:
        return cli.CRASHED if self.crashed else cli.FAILED if self.failed else cli.OK


def report(run: Path, left: Sequence[str]) -> None:
    """The page as far as it goes; it names what is still to come."""
    run_command("report", str(run), *(["--running", *left] if left else []), capture=True)


def finish(run: Path) -> None:
    """The page, and its tables and figures also with the run."""
    report(run, [])
    run_command("plots", str(run), "--only", "speed-against-error", capture=True)  # which no chapter has
    for name in ("tables", "figures"):
        if (PAGE.parent / name).is_dir():
            shutil.copytree(PAGE.parent / name, run / name, dirs_exist_ok=True)


def first_look(options: argparse.Namespace, specs: Sequence[Spec], left: Sequence[str]) -> None:
    """A page within a minute and a half: small pictures, few launches, a run of its own below build/."""
    plan = ["--scene", options.scene[0], "-n", str(FIRST_HEIGHT), "--launches", str(FIRST_LAUNCHES)]
    plan += ["--phase", *map(str, specs), "--long", str(LONG_FRAME), "--results", str(FIRST)]
    said = json.loads(run_command("sweep", *plan, "--json", capture=True, accepted=CHECKED).stdout)
    about = f"the study itself (this page is a first look: {len(specs)} phases, {FIRST_HEIGHT} pixels high, "
    report(Path(said["run"]), [f"{about}{FIRST_LAUNCHES} launches)", *left])
    cli.say(f"first look: {PAGE}")


def main() -> int:
    options, begin = arguments(), time.monotonic()

    def step(text: str) -> None:
        cli.say(f"[{time.monotonic() - begin:.0f} s] {text}")

    shutil.rmtree(PAGE.parent, ignore_errors=True)  # what is of another run must not stand beside this one's
    names = registry.ladder()
    parts = chosen(options)
    if not options.part:
        step("a first look")
        specs = [Spec(name, name) for name, phase in names.items() if not phase.variants]
        build_together([(spec, "render") for spec in specs], len(USABLE))
        first_look(options, [spec for spec in specs if cpu_supports(spec)], [one.what for one in parts])
    step(f"building {len(names)} phases")
    specs = [Spec(name, name) for name in names]
    build_together([(spec, "render") for spec in specs], len(USABLE))
    for spec in specs:
        build(spec)
    wrong = Wrong()
    old = options.part and "sweep" not in options.part
    run, height = newest(options) if old else (None, 0)
    if run is None:
        step("times of every phase")
        swept = sweep(options)
        run, height = Path(swept["run"]), swept["height"]
        if swept["failures"]:
            wrong.failed.append("a phase crashed")
        if options.depth == "quick" and not options.part:
            cuts.note(run, "sweep", experiment.find_all()["sweep"].cut)
    study = Study(run, options.scene, height, options.depth, bool(options.part))
    drawn = -math.inf if options.part else begin  # the first look is a page
    for number, one in enumerate(parts):
        if time.monotonic() - drawn >= PAGE_SECONDS:
            report(run, [other.what for other in parts[number:]])
            drawn = time.monotonic()
        if number == 0 and study.quick:
            step("building what counts")
            build_together(counting(run), len(USABLE))
        step(one.what)
        wrong.hold(partial(measure, one, study), f"{one.name}: see above")
        cuts.note(run, one.name, one.cut if study.quick else "")
    step("tables, plots, report")
    finish(run)
    cli.say(f"study: {PAGE} after {time.monotonic() - begin:.0f} s; data in {run}")
    for sentence in wrong.failed:
        cli.say(f"study: {sentence}; the page shows which")
    for sentence in wrong.crashed:
        cli.say(f"study: {sentence}")
    if options.json:
        about = {"report": PAGE, "height": height}
        cli.emit(about | {"failed": wrong.failed, "crashed": wrong.crashed}, run)
    return wrong.status()
