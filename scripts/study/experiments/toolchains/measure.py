"""Every phase by every compiler and set of flags: what a flag buys, and at what price.

The paper compares GCC and ICC under three sets of flags without saying at what error. A program here is
(compiler, set of flags, phase), built into a folder of its own by the house's recipe with CFLAGS_MORE.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import subprocess
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from study.core import cli, progress, run
from study.core.cli import StudyError
from study.core.host import child
from study.core.registry import ROOT, Scene, Spec
from study.experiments.toolchains.schema import Toolchains
from study.numbers import stats
from study.pictures import images
from study.pictures.images import Picture
from study.truth import judging

COMPILERS = ("gcc", "clang", "icx")
# Behind the phase's own flags (-O3, its -m flags, -ffp-contract=off); a later flag wins.
SETS = {
    "as shipped": "",
    "the CPU's -m flags": "-march=native",
    "and contraction": "-march=native -ffp-contract=fast",
    "and fast-math": "-march=native -ffp-contract=fast -ffast-math",
}
BASE = "gcc", "as shipped"
WRONG = ("false_hits_ppm", "false_misses_ppm", "wrong_shape_ppm")
HITS = (*WRONG, "dt_p99")  # of the proved pixels


@dataclass(frozen=True)
class Program:
    """What is timed: a phase's sources by one compiler and one set of flags."""

    compiler: str
    flags: str  # key of SETS
    phase: str

    @property
    def folder(self) -> Path:
        return Path("build") / "toolchains" / f"{self.compiler}-{list(SETS).index(self.flags)}"

    @property
    def path(self) -> Path:
        return ROOT / self.folder / self.phase / "render"


def resolved(compiler: str) -> str:
    """What -march=native stands for on this CPU, as the compiler itself says it; "" if it does not."""
    command = [compiler, "-march=native", "-###", "-E", "-x", "c", "/dev/null"]
    try:
        said = subprocess.run(command, capture_output=True, text=True, timeout=30).stderr
    except (OSError, subprocess.TimeoutExpired):
        return ""
    words = said.replace('"', "").split()
    if "-target-cpu" in words:
        return f"-target-cpu {words[words.index('-target-cpu') + 1]}"
    return " ".join(dict.fromkeys(w for w in words if w.startswith("-m") and not w.startswith("-mno-")))


def present(names: list[str]) -> tuple[list[str], list[dict[str, str]]]:
    """Compilers that are there, and a reason for each that is not. gcc must be, asked for or not."""
    found = [name for name in names if shutil.which(name)]
    lacking = [
        {"compiler": name, "reason": f"{name} is not installed; it would add its programs to the table"}
        for name in names
        if name not in found
    ]
    if not shutil.which(BASE[0]):
        raise StudyError("gcc is missing: every ratio is over it; install gcc", cli.CANNOT_RUN)
    return found, lacking


def build(program: Program) -> str | None:
    """Builds it; None, or the last lines of what the compiler said."""
    command = ["make", "-s", "-C", str(ROOT), f"CC={program.compiler}", f"BUILD={program.folder}"]
    environment = os.environ | {"CFLAGS_MORE": SETS[program.flags]}
    done = child.run(
        [*command, str(program.folder / program.phase / "render")],
        capture_output=True,
        text=True,
        env=environment,
    )
    if done.returncode == 0:
        return None
    lines = [line for line in (done.stderr + done.stdout).splitlines() if line.strip()]
    return " / ".join(lines[-3:]) or f"make ended with status {done.returncode}"


def build_all(programs: list[Program], jobs: int) -> dict[Program, str]:
    """Builds all, one folder at a time in each job (they share common/). What cannot be built, with why."""
    folders: dict[Path, list[Program]] = {}
    for program in programs:
        folders.setdefault(program.folder, []).append(program)
    with ThreadPoolExecutor(jobs) as pool:
        made = pool.map(lambda group: [(p, build(p)) for p in group], folders.values())
        done = list(progress.each(made, "build", len(folders)))
    return {program: why for group in done for program, why in group if why}


def picture(program: Program, scene: Scene, height: int, folder: Path) -> Picture | StudyError:
    """Its picture with every plane, or why there is none."""
    out = folder / f"{program.folder.name}-{program.phase}-{scene.name}-{height}.exr"
    width, _ = scene.size(height)
    try:
        by = program.compiler
        run.execute(program.path, scene.path, height, width, aov=True, out=out, compiler=by)
        return images.read(out)
    except StudyError as error:
        return error


def measure(
    programs: list[Program], scene: Scene, height: int, launches: int, seed: int, cpu: int
) -> dict[Program, list[float]]:
    """Nanoseconds of one frame per process launch, every program once a round in random order."""
    width, _ = scene.size(height)

    def once(program: Program, padding: int) -> float:
        how = {"cpu": cpu, "env_bytes": padding, "compiler": program.compiler}
        made = run.execute(program.path, scene.path, height, width, **how)
        return float(made["frames"][0]["ns"])

    return run.interleaved(programs, launches, seed, cpu, once, f"time {scene.name}")


def changed(one: Picture, other: Picture) -> float:
    """Share of pixels with any bit of colour, depth or shape changed."""
    differs = np.zeros(one["R"].shape, bool)
    for name in ("R", "G", "B", "Z", "id"):
        a, b = (p[name].astype(np.float32).view(np.uint32) for p in (one, other))
        differs |= a != b
    return float(differs.mean())


def row(
    program: Program,
    scene: Scene,
    height: int,
    times: dict[Program, list[float]],
    pictures: dict[Program, Picture],
    truth: Picture | None,
) -> dict[str, Any]:
    """One line. `speedup`: over gcc as shipped, of the same phase. Errors: to truth, where there is one.

    Those leave out what truth does not know (judging.metrics); `non_finite` is of this picture alone.
    """
    base = Program(*BASE, program.phase)
    about = {"compiler": program.compiler, "flags": program.flags, "more": SETS[program.flags]}
    mine, theirs = pictures[program], pictures[base]
    shipped = images.compare(theirs, mine)
    found = {
        **about,
        "phase": program.phase,
        "scene": scene.name,
        "n": height,
        "ms": stats.median_interval([ns / 1e6 for ns in times[program]]),
        "speedup": stats.ratio_interval(times[base], times[program]),
        "changed_fraction": changed(theirs, mine),
        "non_finite": images.non_finite(mine),
        "psnr_to_shipped_db": shipped["psnr_db"],
        "rmse_to_shipped": shipped["rmse"],  # JSON's null PSNR is infinite where this is 0, else no number
    }
    if truth is not None:
        error = judging.metrics(truth, mine, fractal=scene.fractal)
        colours = error["antialiased"] if scene.fractal else error
        found |= {f"truth_{name}": colours[name] for name in ("psnr_db", "rmse")}
        found |= {f"truth_{name}": error[name] for name in HITS}
    return found


def read(path: Path) -> dict[str, Any]:
    """toolchains.json. StudyError for another thing's JSON, or one of which the rows are gone."""
    return Toolchains.read(path)


def truth_of(scene: Scene, height: int) -> Picture | None:
    """Truth's picture (study.truth.truth); None, with a word, where it has none."""
    from study.truth import truth

    with contextlib.suppress(StudyError):
        return truth.picture(scene, scene.size(height))
    cli.say(f"no truth of {scene.name}: errors to it are left out")
    return None


COLUMNS = [
    ("scene", "scene"),
    ("phase", "phase"),
    ("compiler", "compiler"),
    ("flags", "flags"),
    ("ms", "ms [95 %]"),
    ("speedup", "× over gcc as shipped"),
    ("changed", "pixels changed %"),
    ("to_shipped", "dB to shipped"),
    ("to_truth", "dB to ground truth"),
    ("wrong", "hits and shapes wrong ppm"),
]


def shown(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The rows as people read them."""

    def decibels(value: float | None) -> str | None:
        return None if value is None else "∞" if value == np.inf else f"{value:.1f}"

    def wrong(one: dict[str, Any]) -> str | None:
        values = [one.get(f"truth_{name}") for name in WRONG]
        return None if None in values or not np.isfinite(values).all() else f"{sum(values):.0f}"

    return [
        {
            **one,
            "changed": f"{100 * one['changed_fraction']:.3g}",
            "to_shipped": decibels(one["psnr_to_shipped_db"]),
            "to_truth": decibels(one.get("truth_psnr_db")),
            "wrong": wrong(one),
        }
        for one in rows
    ]


def programs(compilers: list[str], sets: list[str], specs: list[Spec]) -> list[Program]:
    """All of them; for every phase the base is among them, whatever was asked for."""
    wanted = [Program(*BASE, spec.phase) for spec in specs]
    wanted += [Program(c, f, spec.phase) for spec in specs for c in compilers for f in sets]
    return list(dict.fromkeys(wanted))
