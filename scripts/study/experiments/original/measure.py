"""The paper's own program, fetched, built and timed beside this project's phases.

The paper's public repository has a branch for each step. Each branch is built by its own makefile. Only its
configuration is set: one picture of one size. The program times itself by the timer, in its benchmark mode.
"""

from __future__ import annotations

import argparse
import functools
import math
import os
import re
import shutil
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from study.core import registry, run, show, store, temporary
from study.core.cli import CANNOT_RUN, StudyError
from study.core.host import child
from study.core.registry import ROOT, Scene, Spec
from study.measuring import paper_scenes
from study.numbers import beside, stats
from study.numbers.beside import OriginalRow
from study.numbers.schema import Interval
from study.pictures import images

REPOSITORY = "https://github.com/devnio/Optimized-CPU-Ray-Marcher.git"
# Phase of this project -> the commit of the paper's step: heads of master, master_opt1 … master_opt4.
COMMITS = {
    "baseline": "9dc4100",
    "opt1": "cda547c",
    "opt2": "d9bb75b",
    "opt3": "2e0b85c",
    "opt4": "e049ba6",
}
SCENES = ("scene0", "mandelbulb")  # the paper's own two; both projects hold the same numbers


def fetch(repository: str, folder: Path) -> None:
    """A clone of the public repository in `folder`, which is kept. StudyError where it cannot be had."""
    if (folder / ".git").is_dir():
        return
    shutil.rmtree(folder, ignore_errors=True)
    folder.parent.mkdir(parents=True, exist_ok=True)
    part = folder.with_suffix(".part")
    shutil.rmtree(part, ignore_errors=True)
    command = ["git", "clone", "--quiet", "--no-checkout", repository, str(part)]
    try:
        done = child.run(command, capture_output=True, text=True)
    except FileNotFoundError:
        raise StudyError("git is missing; install it by `apt-get install git`", CANNOT_RUN) from None
    if done.returncode:
        said = (done.stderr.strip().splitlines() or ["no message"])[-1]
        raise StudyError(f"{repository}: not fetched ({said}); --repository names a copy", CANNOT_RUN)
    part.rename(folder)


def configured(text: str, height: int) -> str:
    """config.h for one picture `height` rows high. StudyError where a setting is missing."""
    wanted = {"START_H_RESOLUTION": height, "END_H_RESOLUTION": height, "REPETITIONS": 1}
    wanted |= {"WARM_UP_REPETITIONS": 0}
    for name, value in wanted.items():
        text, found = re.subn(rf"(?m)^(#define {name}) +\S+", rf"\1 {value}", text)
        if found != 1:
            raise StudyError(f"the paper's config.h has {found} lines `#define {name}`; one was expected")
    return text


def build(repository: Path, phase: str, height: int) -> Path:
    """The step's program, built by its own makefile. StudyError with the compiler's last line."""
    folder = repository.parent / f"{phase}-{height}"
    program = folder / "build" / "raymarcher"
    if program.exists():
        return program
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    packed = child.run(
        ["git", "-C", str(repository), "archive", COMMITS[phase]], capture_output=True, check=False
    )
    if packed.returncode:
        raise StudyError(f"{repository}: lacks commit {COMMITS[phase]}, the paper's {phase}")
    child.run(["tar", "x", "-C", str(folder)], input=packed.stdout, check=True)
    config = folder / "include" / "config.h"
    config.write_text(configured(config.read_text(), height))
    (folder / "build" / "obj" / "geometry").mkdir(parents=True, exist_ok=True)
    made = child.run(
        ["make", "-s", "-C", str(folder / "build"), "raymarcher"], capture_output=True, text=True
    )
    if made.returncode:
        raise StudyError(f"the paper's {phase} does not compile: {made.stderr.strip().splitlines()[-1]}")
    return program


def launch(program: Path, scene: str, cpu: int, env_bytes: int = 0) -> tuple[int, np.ndarray]:
    """Timer cycles of one picture, and the picture as displayed: height × width × 3 bytes."""
    output = program.parents[1] / "output"
    shutil.rmtree(output, ignore_errors=True)
    done = child.run(
        [program, "benchmark", scene],
        cwd=program.parent,
        env=os.environ | {"STEPWISE_PADDING": "x" * env_bytes},
        capture_output=True,
        preexec_fn=functools.partial(os.sched_setaffinity, 0, {cpu}),
    )
    times, pictures = (sorted(output.rglob(name)) for name in ("measurements.csv", "out_*.png"))
    numbers = re.findall(r"\d+", times[0].read_text()) if times else []
    if done.returncode or len(numbers) < 2 or not pictures:
        raise StudyError(f"{program} benchmark {scene}: status {done.returncode}, {len(pictures)} pictures")
    return int(numbers[-2]), images.read_png(pictures[0])


def difference(theirs: np.ndarray, ours: np.ndarray) -> tuple[float | None, float, int]:
    """How two pictures differ as displayed: PSNR in dB (peak 255; None: identical), share of pixels more than
    one step of 1/255 apart, and the largest step. StudyError where the sizes differ."""
    if theirs.shape != ours.shape:
        raise StudyError(f"pictures of {theirs.shape[:2]} and {ours.shape[:2]} pixels cannot be compared")
    psnr, _, over = images.metrics(theirs, ours, 1, 255)
    largest = int(np.abs(theirs.astype(int) - ours.astype(int)).max())
    return (psnr if largest else None), over, largest


def scene_of(name: str, programs: Iterable[Path]) -> Scene:
    """The scene that both projects hold, or a file of the paper's, converted; each step gets it."""
    if name in SCENES:
        return registry.find_scene(name)
    folders = [program.parents[1] / "scenes" for program in programs]
    found = {path.stem: path for folder in folders for path in sorted(folder.glob("*.json"))}
    if name not in found:
        raise StudyError(f"the paper's program has no scene {name!r}; there are {', '.join(sorted(found))}")
    data = paper_scenes.converted(paper_scenes.read(found[name]), found[name])
    path = ROOT / "build" / "original" / f"{name}.json"
    store.write_json(path, data)
    text = found[name].read_bytes()
    for folder in folders:
        (folder / f"{name}.json").write_bytes(text)
    return Scene(name, path, data, any(shape["type"] == "mandelbulb" for shape in data["shapes"]))


def measure(program: Path, scene: Scene, phase: str, args: argparse.Namespace) -> OriginalRow:
    """One phase and scene, both programs interleaved on one CPU: ms with intervals, and ours over theirs."""
    cpu, spec = run.FASTEST, Spec.parse(phase)
    wide, high = scene.size(args.n)
    theirs_picture = np.empty(0)
    tsc_hz = math.nan

    def once(who: str, padding: int) -> float:
        nonlocal theirs_picture, tsc_hz
        if who == "theirs":
            cycles, theirs_picture = launch(program, scene.name, cpu, padding)
            return float(cycles)
        (frame,) = run.frames(spec, scene.path, high, wide, cpu=cpu, env_bytes=padding, reps=1)
        tsc_hz = frame["tsc_hz"]
        return float(frame["tsc_cycles"])

    cycles = run.interleaved(("theirs", "ours"), args.launches, args.seed, cpu, once, f"{phase} {scene.name}")
    with temporary.folder() as folder:
        out = folder / "ours.ppm"
        run.render(spec, scene.path, high, wide, out=out, timed=False, display=True)
        psnr, over, largest = difference(theirs_picture, images.read_ppm(out))
    theirs, ours = ([1e3 * one / tsc_hz for one in cycles[who]] for who in ("theirs", "ours"))
    return OriginalRow(
        phase=phase,
        scene=scene.name,
        commit=COMMITS[phase],
        n=high,
        width=wide,
        theirs_launches_ms=theirs,
        ours_launches_ms=ours,
        theirs_ms=Interval.of(stats.median_interval(theirs)),
        ours_ms=Interval.of(stats.median_interval(ours)),
        ours_over_theirs=Interval.of(stats.ratio_interval(ours, theirs, args.seed)),
        psnr_display_db=psnr,
        fraction_over_1_255=over,
        largest=largest,
    )


def sentence(row: OriginalRow) -> str:
    psnr = "identical" if row.psnr_display_db is None else f"PSNR {row.psnr_display_db:.1f} dB"
    return (
        f"{row.phase} on {row.scene}, {row.width}×{row.n}: {show.spread(row.ours_ms)} ms, the paper's "
        f"program {show.spread(row.theirs_ms)} ms, ratio {show.spread(row.ours_over_theirs)}; as displayed: "
        f"{psnr}, {show.percent(row.fraction_over_1_255)} of the pixels off by more than 1/255"
    )


def folder_of(repository: str) -> Path:
    """Where the clone of that repository is kept."""
    return ROOT / "build" / "original" / ("repository" if repository == REPOSITORY else "copy")


def called(repository: str) -> str:
    """A repository as a file may say it: a folder of this machine is nobody else's business."""
    return repository if "://" in repository else f"a local copy of {REPOSITORY}"


def others(path: Path, height: int, phases: Sequence[str], scenes: Sequence[str]) -> list[OriginalRow]:
    """The rows of an earlier original.json of that height that these phases and scenes do not make anew."""
    again = {(phase, scene) for phase in phases for scene in scenes}
    earlier = beside.originals(path.parent)
    return [row for row in earlier if row.n == height and (row.phase, row.scene) not in again]
