"""Every phase by every compiler and set of flags: what a flag buys, and at what price.

The paper compares GCC and ICC under three sets of flags without saying at what error. A program here is
(compiler, set of flags, phase), built into a folder of its own by the house's recipe with CFLAGS_MORE.
"""

import contextlib
import math
import os
import shutil
import subprocess
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from study.core import cli, progress, run
from study.core.build import build
from study.core.cli import StudyError
from study.core.registry import ROOT, Scene, Spec
from study.experiments.toolchains.schema import Failure, Missing, Row
from study.numbers import stats
from study.numbers.schema import Interval
from study.pictures import images
from study.pictures.images import Picture
from study.truth import judging, truth

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
    compiler: str
    flags: str  # key of SETS
    phase: str

    def __str__(self) -> str:
        return f"{self.phase}, {self.compiler} {self.flags}"

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


def present(names: Iterable[str]) -> tuple[list[str], list[Missing]]:
    """Compilers that are there, and a reason for each that is not. gcc must be, asked for or not."""
    if not shutil.which(BASE[0]):
        raise StudyError("gcc is missing: every ratio is over it; install gcc", cli.CANNOT_RUN)
    reason = "it is not installed; it would add its programs to the table"
    lacking = [Missing(compiler=name, reason=reason) for name in names if not shutil.which(name)]
    return [name for name in names if shutil.which(name)], lacking


def built(programs: Iterable[Program]) -> tuple[list[Program], list[Failure]]:
    """Those that can be built, with as many jobs as there are CPUs, and why the others cannot."""
    able, failed = [], []
    for program in progress.each(list(programs), "build"):
        settings = (f"-j{os.cpu_count()}", f"CC={program.compiler}", f"CFLAGS_MORE={SETS[program.flags]}")
        try:
            build(program.phase, "render", str(program.folder), settings)
            able.append(program)
        except StudyError as error:
            reason = " / ".join(line.strip() for line in str(error).splitlines()[-3:])
            failed.append(Failure(program=str(program), reason=reason))
    return able, failed


def picture(program: Program, scene: Scene, height: int, folder: Path) -> Picture | StudyError:
    out = folder / f"{program.folder.name}-{program.phase}-{scene.name}-{height}.exr"
    width, _ = scene.size(height)
    try:
        by = run.compiled_by(program.compiler)
        run.render(program.path, scene.path, height, width, aov=True, out=out, told=by)
        return images.read(out)
    except StudyError as error:
        return error


def measure(
    programs: Sequence[Program], scene: Scene, height: int, launches: int, seed: int, cpu: int
) -> dict[Program, list[float]]:
    """Nanoseconds of one frame per process launch, every program once a round in random order."""
    width, _ = scene.size(height)

    def once(program: Program, padding: int) -> float:
        how = {"cpu": cpu, "env_bytes": padding, "told": run.compiled_by(program.compiler)}
        made = run.render(program.path, scene.path, height, width, **how)
        return float(made["frames"][0]["ns"])

    return run.interleaved(programs, launches, seed, cpu, once, f"time {scene.name}")


def changed(one: Picture, other: Picture) -> float:
    """Share of pixels with any bit of colour, depth or shape changed."""
    differs = np.zeros(one["R"].shape, bool)
    for name in ("R", "G", "B", "Z", "id"):
        a, b = (p[name].astype(np.float32).view(np.uint32) for p in (one, other))
        differs |= a != b
    return float(differs.mean())


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def row(
    program: Program,
    scene: Scene,
    height: int,
    times: Mapping[Program, list[float]],
    pictures: Mapping[Program, Picture],
    exact: Picture | None,
) -> Row:
    """One line. `speedup`: over gcc as shipped, of the same phase. Errors: to truth, where there is one.

    Those leave out what truth does not know (judging.metrics); `non_finite` is of this picture alone.
    """
    base = Program(*BASE, program.phase)
    mine, theirs = pictures[program], pictures[base]
    shipped = images.compare(theirs, mine)
    made = Row(
        compiler=program.compiler,
        flags=program.flags,
        more=SETS[program.flags],
        phase=program.phase,
        scene=scene.name,
        n=height,
        ms=Interval.of(stats.median_interval([ns / 1e6 for ns in times[program]])),
        speedup=Interval.of(stats.ratio_interval(times[base], times[program])),
        changed_fraction=changed(theirs, mine),
        non_finite=images.non_finite(mine),
        psnr_to_shipped_db=_finite(shipped["psnr_db"]),
        rmse_to_shipped=_finite(shipped["rmse"]),
    )
    if exact is not None:
        error = judging.metrics(exact, mine, fractal=scene.fractal)
        colours = error["antialiased"] if scene.fractal else error
        made.truth_psnr_db, made.truth_rmse = (_finite(colours[name]) for name in ("psnr_db", "rmse"))
        for name in HITS:
            setattr(made, f"truth_{name}", _finite(error[name]))
    return made


def truth_of(scene: Scene, height: int) -> Picture | None:
    """Truth's picture (study.truth.truth); None, with a word, where it has none."""
    with contextlib.suppress(StudyError):
        return truth.picture(scene, scene.size(height))
    cli.say(f"no truth of {scene.name}: errors to it are left out")
    return None


def programs(compilers: list[str], sets: list[str], specs: list[Spec]) -> list[Program]:
    """All of them; for every phase the base is among them, whatever was asked for."""
    wanted = [Program(*BASE, spec.phase) for spec in specs]
    wanted += [Program(c, f, spec.phase) for spec in specs for c in compilers for f in sets]
    return list(dict.fromkeys(wanted))
