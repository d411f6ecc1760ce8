"""The main job: build, sweep, verify, draw, report. `make study` calls it after installing what it needs."""

from __future__ import annotations

import argparse
import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from study.bounds import ceilings
from study.core import cli, store
from study.core.build import build
from study.core.registry import ROOT, Spec, cpu_supports
from study.core.registry import ladder as rungs  # beside the module of that name
from study.counting.flops import read as read_counts
from study.experiments.sweep import ladder
from study.numbers import analysis

STEPWISE = ROOT / "scripts" / "stepwise"
SWEEP_SECONDS = (
    240  # of the quarter of an hour or so that a study takes on two cores; the rest is verifying and counting
)
SCALING_SECONDS = 300  # of the growth of the first and the last two rungs
LONG_FRAME = 0.25  # s: caches and branch predictors settle in milliseconds, so such a frame warms itself up
HEIGHTS = (
    360,
    320,
    288,
    256,
    224,
    192,
    160,
    128,
    96,
    64,
)  # of the headline, and half and a quarter of it beside
QUICK_HEIGHT = 180  # of a run that is made for a single part
VALIDATION_HEIGHT = 90
TRUTH_HEIGHT = 180  # scene0's truth: half a minute on two cores
FULL = {"sizes": [str(n) for n in range(100, 2001, 100)], "launches": "4"}  # the paper's sweep


class Crashed(cli.StudyError):
    """A script that ended by a bug or a signal and has judged nothing."""


def script(
    name: str, *arguments: str, capture: bool = False, accepted: tuple[int, ...] = (cli.OK,)
) -> subprocess.CompletedProcess[str]:
    """Run one of the scripts; its progress goes to the terminal, its output (if captured) comes back.

    Crashed where the script crashed or was killed, StudyError for any other status that is not accepted.
    """
    command = [sys.executable, str(STEPWISE), name, *arguments]
    done = subprocess.run(command, stdout=subprocess.PIPE if capture else None, text=True, check=False)
    if done.returncode == cli.CRASHED:
        raise Crashed(f"stepwise {name} crashed; its traceback is above", cli.CRASHED)
    if done.returncode < 0:
        number = -done.returncode
        raise Crashed(f"stepwise {name} was killed by {signal.Signals(number).name}", cli.CRASHED)
    if done.returncode not in accepted:
        raise cli.StudyError(
            f"stepwise {name} ended with status {done.returncode}; see above", done.returncode
        )
    return done


CHECKED = (cli.OK, cli.FAILED)  # of scripts that judge what they measure


def sweep_plan(height: int, scenes: list[str]) -> list[str]:
    """Arguments of a sweep whose headline is `height` pixels high: ten launches of each."""
    sizes = [str(height // 4), str(height // 2), str(height)]
    return ["--scene", *scenes, "-n", *sizes, "--launches", "10", "--long", str(LONG_FRAME)]


def newest(options: argparse.Namespace) -> tuple[Path | None, int]:
    """The newest run below the results and the height of its headline; none without a timed frame."""
    try:
        data = analysis.load(store.latest(options.results).path)
    except cli.StudyError:
        return None, 0
    sizes = [ladder.headline_size(data, scene) for scene in options.scene]
    return (None, 0) if None in sizes else (data.path, max(size[1] for size in sizes if size))


def choose_height(scenes: list[str], seconds: float) -> int:
    """The largest picture whose ten interleaved rounds fit the time, by the sweep's own calibration.

    The estimates come from frames at n = 45, which have more of edges than large ones: the sweep takes less.
    """
    for height in HEIGHTS:
        plan = script("sweep", *sweep_plan(height, scenes), "--dry-run", "--json", capture=True)
        if json.loads(plan.stdout)["estimated_s"] <= seconds:
            return height
    return HEIGHTS[-1]


def sweep(options: argparse.Namespace) -> dict[str, Any]:
    """Times every phase into a new run: what the sweep says of it, and the headline's height."""
    if options.full:
        height = 720
        arguments = ["--scene", *options.scene, "-n", *FULL["sizes"], "--launches", FULL["launches"]]
        arguments += ["--long", str(LONG_FRAME)]
    elif options.part:  # only to stand under the part asked for
        height = QUICK_HEIGHT
        arguments = ["--scene", *options.scene, "-n", str(height // 2), str(height), "--launches", "6"]
        arguments += ["--long", str(LONG_FRAME)]
    else:
        height = choose_height(options.scene, options.seconds)
        arguments = [*sweep_plan(height, options.scene), "--budget", str(options.seconds)]
    cli.say(f"headline at n = {height}; a kill loses one frame, scripts/stepwise sweep --run goes on")
    done = script(
        "sweep", *arguments, "--results", str(options.results), "--json", capture=True, accepted=CHECKED
    )
    return json.loads(done.stdout) | {"height": height}


def verify(run: Path, options: argparse.Namespace, height: int, specs: list[str]) -> bool:
    antialias = "180" if options.full else "90"
    done = script(
        "verify",
        "--phase",
        *specs,
        "-n",
        str(height),
        "--antialias-n",
        antialias,
        "--run",
        str(run),
        accepted=CHECKED,
    )
    return done.returncode == cli.OK


def flops(run: Path, options: argparse.Namespace, height: int) -> bool:
    """Table 1 at the paper's size; what was executed at the headline's; the one against the other, small."""
    script("flops", "--scene", *options.scene, "-n", "720", "--run", str(run), capture=True)
    measure(run, options, height)
    small = ["-n", str(VALIDATION_HEIGHT), "--validate", "--run", str(run)]
    return script("flops", *small, capture=True, accepted=CHECKED).returncode == cli.OK


def measure(run: Path, options: argparse.Namespace, height: int) -> None:
    """What every timed program executes for a picture of that height."""
    specs = dict.fromkeys(cell.spec for cell in analysis.load(run).cells if cell.scene in options.scene)
    size = ["-n", str(height), "--measure", "--run", str(run)]
    script("flops", "--scene", *options.scene, "--phase", *specs, *size, capture=True)


def roofline(run: Path, options: argparse.Namespace, height: int) -> bool:
    script("ceilings", "--run", str(run), capture=True)
    if not read_counts(run / "counts.json")[1]:
        measure(run, options, height)
    return True


def hotspots(run: Path, options: argparse.Namespace, height: int) -> bool:
    scenes = options.scene if options.full else options.scene[:1]
    quick = [] if options.full else ["--no-osaca", "--samples", "1500"]  # OSACA: half a minute a phase
    accepted = (cli.OK, cli.CANNOT_RUN)  # without perf the study goes on; the script has said so
    # Table 3 is about one step, structs to arrays, which the ladder's opt2 has among others.
    names = [*rungs(), *(["opt1+arrays"] if "opt1" in rungs() else [])]
    names = [name for name in names if cpu_supports(Spec.parse(name))]
    script(
        "hotspots",
        "--phase",
        *names,
        "--scene",
        *scenes,
        *quick,
        "--run",
        str(run),
        capture=True,
        accepted=accepted,
    )
    return True


def ablations(run: Path, options: argparse.Namespace, height: int) -> bool:
    """At the script's own size and launches: at n = 90 and six half of the steps could not be told."""
    return script("ablations", "--run", str(run), capture=True, accepted=CHECKED).returncode == cli.OK


def ideas(run: Path, options: argparse.Namespace, height: int) -> bool:
    """At a size at which the fastest phase's frame takes milliseconds."""
    return judged("ablations", "--ideas", "-n", "360", "--launches", "20", "--run", str(run))


def accuracy(run: Path, options: argparse.Namespace, height: int) -> bool:
    """Every phase against truth, and the Mandelbulb's convergence; all scenes where it was asked for."""
    scenes = [] if options.part or options.full else ["--scene", *dict.fromkeys([*options.scene, "trio"])]
    size = ["-n", "720" if options.full else str(TRUTH_HEIGHT)]
    convergence = ["--convergence"] if options.part or options.full else []
    return judged("accuracy", *scenes, *size, *convergence, "--run", str(run))


def stability(run: Path, options: argparse.Namespace, height: int) -> bool:
    # Three strengths of each would say where a phase fails to six decades, and once not at all.
    return judged("stability", "--run", str(run))


def pareto(run: Path, options: argparse.Namespace, height: int) -> bool:
    """Every scene and the whole grid, in a budget of its own, where it was asked for; else a few points."""
    quick = ["--scene", *options.scene, "-n", "64", "--hit-distance", "1e-2", "1e-4", "--max-steps", "64"]
    return judged("pareto", *([] if options.part or options.full else quick), "--run", str(run))


def functions(run: Path, options: argparse.Namespace, height: int) -> bool:
    return judged("functions", *([] if options.part or options.full else ["--quick"]), "--run", str(run))


def scaling(run: Path, options: argparse.Namespace, height: int) -> bool:
    """The growth of every program, or in five minutes that of the first and the last two rungs."""
    names = [name for name in rungs() if cpu_supports(Spec.parse(name))]
    quick = ["--phase", *dict.fromkeys([names[0], *names[-2:]]), "--seconds", str(SCALING_SECONDS)]
    return judged(
        "scaling", *(["--full"] if options.full else [] if options.part else quick), "--run", str(run)
    )


def views(run: Path, options: argparse.Namespace, height: int) -> bool:
    """Every rung on views it was not tuned on, or in two minutes and a half the newest ones."""
    return judged("views", *(["--full"] if options.part or options.full else []), "--run", str(run))


def frames(run: Path, options: argparse.Namespace, height: int) -> bool:
    """Frames a second of the newest phases, of all with threads where it was asked for."""
    seconds = "600" if options.part or options.full else "45"
    return judged("frames", "--seconds", seconds, "--run", str(run))


def breakeven(run: Path, options: argparse.Namespace, height: int) -> bool:
    """When compiling for a scene has paid; a CPU or a tree that lacks the phase goes on without."""
    done = script("breakeven", "--run", str(run), capture=True, accepted=(*CHECKED, cli.CANNOT_RUN))
    return done.returncode != cli.FAILED


def drjit(run: Path, options: argparse.Namespace, height: int) -> bool:
    accepted = (*CHECKED, cli.CANNOT_RUN)  # without Dr.Jit or LLVM the study goes on; the script has said so
    done = script("drjit", "--run", str(run), capture=True, accepted=accepted)
    return done.returncode != cli.FAILED


def toolchains(run: Path, options: argparse.Namespace, height: int) -> bool:
    return judged("toolchains", "--run", str(run))


# What other articles built: each script writes its own file and judges it.
SYSTEMS = ("rods", "throttle", "lattice", "fixed", "packets", "systems")


def systems(run: Path, options: argparse.Namespace, height: int) -> bool:
    accepted = (*CHECKED, cli.CANNOT_RUN)  # a CPU that lacks what one of them needs: its script has said so
    done = [script(name, "--run", str(run), capture=True, accepted=accepted) for name in SYSTEMS]
    return all(one.returncode != cli.FAILED for one in done)


def judged(name: str, *arguments: str) -> bool:
    """Runs a script that judges what it measures: whether all is well."""
    return script(name, *arguments, capture=True, accepted=CHECKED).returncode == cli.OK


# What a run can be given besides its times, in this order.
PARTS: dict[str, tuple[str, Callable[[Path, argparse.Namespace, int], bool]]] = {
    "flops": ("counting FLOPs, bytes and instructions", flops),
    "roofline": ("ceilings of this machine", roofline),
    "hotspots": ("hotspots, and a model of what bounds them", hotspots),
    "ablations": ("single steps put in and taken out", ablations),
    "ideas": ("each idea taken out of its phase", ideas),
    "accuracy": ("every phase against truth", accuracy),
    "stability": ("hard cases", stability),
    "pareto": ("speed against error", pareto),
    "functions": ("functions: speed against ulp", functions),
    "views": ("views that nothing was tuned on", views),
    "frames": ("frames a second", frames),
    "breakeven": ("when code generated for a scene has paid", breakeven),
    "scaling": ("how cost grows", scaling),
    "drjit": ("our phases beside Dr.Jit", drjit),
    "toolchains": ("compilers and flags", toolchains),
    "systems": ("systems of other articles", systems),
}
# Minutes of building, and what has to be installed: by make ideas, toolchains and drjit, and with --full.
ON_REQUEST = {"ideas", "toolchains", "drjit", "systems"}


def arguments() -> argparse.Namespace:
    parser = cli.parser(
        __doc__ or "",
        {
            cli.FAILED: "done, and a phase is outside its tolerance or crashed: the report says which",
            cli.CRASHED: "a script of the study crashed, or this one; the other parts are done",
        },
    )
    parser.add_argument(
        "--full", action="store_true", help="the paper's sweep: n = 100 … 2000 by 100, four launches"
    )
    parser.add_argument(
        "--part",
        action="append",
        choices=PARTS,
        help="only this, for the newest run (a quick one is made where there is none), and the report",
    )
    parser.add_argument(
        "--scene", nargs="+", default=["scene0", "mandelbulb"], metavar="NAME", help="scenes to time"
    )
    parser.add_argument(
        "--seconds", type=float, default=SWEEP_SECONDS, help="for the sweep; default: %(default)s"
    )
    parser.add_argument(
        "--results", type=Path, default=ROOT / "results", metavar="DIR", help="parent of the run's folder"
    )
    return parser.parse_args()


@dataclass
class Wrong:
    """What went wrong in a study: checks that failed, and scripts that crashed, a sentence each."""

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


def ladder_run(options: argparse.Namespace, step: Callable[[str], None], wrong: Wrong) -> tuple[Path, int]:
    """Sweep, verification and pictures of a new run: its folder and the height."""
    step("sweep")
    swept = sweep(options)
    run, height = Path(swept["run"]), swept["height"]
    if swept["failures"]:
        wrong.failed.append("a phase crashed")
    specs = [*dict.fromkeys(row["spec"] for row in swept["rows"] if row["spec"] != "baseline")]
    step(f"verifying all phases on all scenes at n = {height}")
    wrong.hold(lambda: verify(run, options, height, specs), "a phase is outside its tolerance")
    if not options.part:
        step("pictures")
        wrong.hold(lambda: bool(script("pictures", "--run", str(run))), "pictures: see above")
    return run, height


def main() -> int:
    options, begin = arguments(), time.monotonic()

    def step(text: str) -> None:
        cli.say(f"[{time.monotonic() - begin:.0f} s] {text}")

    step(f"building {len(rungs())} phases")
    for name in rungs():
        build(Spec(name, name))
    wrong = Wrong()
    run, height = newest(options) if options.part else (None, 0)
    if run is None:
        run, height = ladder_run(options, step, wrong)
    for name in options.part or [name for name in PARTS if options.full or name not in ON_REQUEST]:
        text, part = PARTS[name]
        step(text)
        wrong.hold(partial(part, run, options, height), f"{name}: see above")
    step("tables, plots, report")
    complete = read_counts(run / "counts.json")[1] and (run / ceilings.FILE).exists()
    counted = ["roofline"] * bool(complete)
    for name in ("tables", "plots", *counted, "report"):
        script(name, str(run), capture=True)
    page = ROOT / "report" / "out" / "index.html"
    cli.say(f"study: {page} after {time.monotonic() - begin:.0f} s; data in {run}")
    for sentence in wrong.failed:
        cli.say(f"study: {sentence}; the page shows which")
    for sentence in wrong.crashed:
        cli.say(f"study: {sentence}")
    if options.json:
        about = {"run": run, "report": str(page), "height": height}
        cli.emit(about | {"failed": bool(wrong.failed), "crashed": wrong.crashed})
    return wrong.status()
