#!/usr/bin/env python3
"""The main job: build, sweep, verify, draw, report. `make study` calls it after installing what it needs."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from pathlib import Path

from study import cli
from study.build import build
from study.registry import ROOT, Spec, phases

SCRIPTS = Path(__file__).resolve().parent
SWEEP_SECONDS = (
    300  # of the ten minutes that a study may take on two cores; the rest is installing and verifying
)
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
FULL = {"sizes": [str(n) for n in range(100, 2001, 100)], "launches": "4"}  # the paper's sweep


def script(name: str, *arguments: str, capture: bool = False) -> subprocess.CompletedProcess[str]:
    """Run one of the scripts; its progress goes to the terminal, its JSON (if captured) comes back."""
    command = [sys.executable, str(SCRIPTS / f"{name}.py"), *arguments]
    done = subprocess.run(command, stdout=subprocess.PIPE if capture else None, text=True, check=False)
    if done.returncode not in (cli.OK, cli.FAILED):
        raise cli.StudyError(f"{name}.py ended with status {done.returncode}; see above", done.returncode)
    return done


def sweep_plan(height: int, scenes: list[str]) -> list[str]:
    """Arguments of a sweep whose headline is `height` pixels high: ten launches of each."""
    sizes = [str(height // 4), str(height // 2), str(height)]
    return ["--scene", *scenes, "-n", *sizes, "--launches", "10", "--long", str(LONG_FRAME)]


def choose_height(scenes: list[str], seconds: float) -> int:
    """The largest picture whose ten interleaved rounds fit the time, by the sweep's own calibration.

    The estimates come from frames at n = 45, which have more of edges than large ones: the sweep takes less.
    """
    for height in HEIGHTS:
        plan = script("sweep", *sweep_plan(height, scenes), "--dry-run", "--json", capture=True)
        if json.loads(plan.stdout)["estimated_s"] <= seconds:
            return height
    return HEIGHTS[-1]


def main() -> int:
    parser = cli.parser(
        __doc__ or "", {1: "done, and a phase is outside its tolerance or crashed: the report says which"}
    )
    parser.add_argument(
        "--full", action="store_true", help="the paper's sweep: n = 100 … 2000 by 100, four launches"
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
    options = parser.parse_args()
    begin = time.monotonic()

    def step(number: int, text: str) -> None:
        cli.say(f"[{number}/5] {text}  ({time.monotonic() - begin:.0f} s so far)")

    step(1, f"building {len(phases())} phases")
    for name in phases():
        build(Spec(name, name))
    if options.full:
        height = 720
        arguments = [
            "--scene",
            *options.scene,
            "-n",
            *FULL["sizes"],
            "--launches",
            FULL["launches"],
            "--long",
            "0.25",
        ]
    else:
        height = choose_height(options.scene, options.seconds)
        arguments = [*sweep_plan(height, options.scene), "--budget", str(options.seconds)]
    step(2, f"sweep, headline at n = {height}; a kill loses one frame, scripts/sweep.py --run goes on")
    swept = json.loads(
        script("sweep", *arguments, "--results", str(options.results), "--json", capture=True).stdout
    )
    run = swept["run"]
    step(3, f"verifying all phases on all scenes at n = {height}")
    antialias = "180" if options.full else "90"
    specs = [row["spec"] for row in swept["rows"] if row["spec"] != "baseline"]
    specs = [*dict.fromkeys(specs)]
    verified = script(
        "verify", "--phase", *specs, "-n", str(height), "--antialias-n", antialias, "--run", run
    )
    step(4, "pictures")
    script("pictures", "--run", run)
    step(5, "tables, plots, report")
    for name in ("tables", "plots", "report"):
        script(name, run)
    failed = bool(swept["failures"]) or verified.returncode != cli.OK
    page = ROOT / "report" / "out" / "index.html"
    cli.say(f"study: {page} after {time.monotonic() - begin:.0f} s; data in {run}")
    if failed:
        cli.say("study: a phase is outside its tolerance or crashed; the page shows which")
    if options.json:
        cli.emit({"run": run, "report": str(page), "height": height, "failed": failed})
    return cli.FAILED if failed else cli.OK


if __name__ == "__main__":
    cli.main(main)
