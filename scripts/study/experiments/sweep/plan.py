"""What a sweep measures: configurations, their expected durations, what is skipped and why."""

from __future__ import annotations

import argparse
import dataclasses
import datetime
import hashlib
import itertools
import json
import time
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from study.core import cli, progress, run
from study.core.build import build
from study.core.registry import ROOT, Spec, cpu_supports, find_phase, find_scene, missing_isa, phases
from study.core.run import DriverError
from study.numbers import summary
from study.numbers.analysis import GENERATED, SECOND_BASE

CALIBRATION_HEIGHT = 45
NEAR = 10  # times --long: up to that a frame is timed at its own size before it counts as long


@dataclass(frozen=True)
class Config:
    """What one launch measures. `estimate_s`: seconds that a launch was expected to take; `once`: a single
    frame without warm-up, being a long one."""

    config: str
    spec: str
    phase: str
    flags_from: str
    scene: str
    scene_hash: str
    width: int
    height: int
    threads: int
    estimate_s: float
    once: bool = False

    @property
    def group(self) -> tuple[str, int, int]:
        """Configurations that are compared with each other: same scene and size."""
        return self.scene, self.width, self.height

    def __str__(self) -> str:
        threads = f" threads={self.threads}" if self.threads > 1 else ""
        return f"{self.spec} {self.scene} {self.width}x{self.height}{threads}"


def now() -> str:
    return datetime.datetime.now(datetime.UTC).isoformat(timespec="milliseconds")


def sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def overrides(plan: dict[str, Any]) -> dict[str, Any]:
    """The scene's limits that the command line changed (None: as the scene says)."""
    return {key: plan[key] for key in ("hit_distance", "max_steps")}


def wanted_specs(names: Iterable[str], second_base: bool) -> list[Spec]:
    """Specs without duplicates, then opt2 with each set of flags it is to be compared under.

    Two specs with the same sources and equal compiler flags are the same program; of opt2 no further one is
    built for flags that change no arithmetic.
    """
    found: dict[tuple[str, str], Spec] = {}

    def add(spec: Spec) -> None:
        flags = find_phase(spec.flags_from).cflags
        if flags == find_phase(spec.phase).cflags:
            spec = Spec(spec.phase, spec.phase)
        found.setdefault((spec.phase, flags), spec)

    for name in names:
        add(Spec.parse(name))
    if second_base and SECOND_BASE in phases():
        there = {summary.cflags(s.flags_from) for s in found.values() if s.phase == SECOND_BASE}
        there.add(summary.cflags(SECOND_BASE))
        for spec in list(found.values()):
            if (flags := summary.cflags(spec.flags_from)) not in there:
                there.add(flags)
                add(Spec(SECOND_BASE, spec.flags_from))
    return list(found.values())


def skip(plan: dict[str, Any], what: dict[str, Any], reason: str) -> None:
    """Record in the plan what cannot run here, and say so."""
    plan["skipped"].append(what | {"reason": reason})
    cli.say(f"skipped: {' '.join(str(value) for value in what.values())}: {reason}")


def fail(plan: dict[str, Any], what: dict[str, Any], error: DriverError) -> None:
    """Record a crash in the plan, and say so."""
    plan["failures"].append(what | {"status": error.status, "message": error.message, "time": now()})
    cli.say(f"failed: {what['spec']} {what['scene']}: {error.message}")


def make_plan(options: argparse.Namespace) -> dict[str, Any]:
    """The plan of a new run (plan.json), from the options of a sweep.

    Builds every spec and renders every scene once, tiny: what this CPU or a phase refuses is skipped
    with the reason, the rest gets an expected duration in proportion to its pixels; what would by that be
    too long for more than a frame, but not by far, that of a first frame of its size.
    """
    plan: dict[str, Any] = {"schema": 1}
    plan |= {key: getattr(options, key) for key in ("seed", "cpu", "launches", "reps", "warmup", "long")}
    plan |= {"budget_s": options.budget, **overrides(vars(options)), "began": now(), "finished": None}
    plan |= {
        "phases": {},
        "binaries": {},
        "configurations": [],
        "skipped": [],
        "failures": [],
        "not_reached": [],
    }
    specs = []
    for spec in wanted_specs(options.phase, options.second_base):
        if cpu_supports(spec):
            plan["binaries"][str(spec)] = sha256(build(spec))
            specs.append(spec)
            for name in (spec.phase, spec.flags_from):  # as they were: analysis reads the run alone
                phase = find_phase(name)
                place = phase.path.relative_to(ROOT)
                plan["phases"][name] = dataclasses.asdict(phase) | {"path": str(place)}
        else:
            skip(plan, {"spec": str(spec)}, f"this CPU lacks {', '.join(missing_isa(spec))}")
    scenes = [find_scene(name) for name in dict.fromkeys(options.scene)]
    cases = list(itertools.product(specs, scenes, dict.fromkeys(options.threads)))
    for spec, scene, threads in progress.each(cases, "calibrate"):
        tiny, _ = scene.size(CALIBRATION_HEIGHT)
        case = {"spec": str(spec), "scene": scene.name, "threads": threads}
        how = {"threads": threads, "cpu": options.cpu, **overrides(plan)}
        begin = time.perf_counter()
        try:
            picture = run.render(spec, scene.path, CALIBRATION_HEIGHT, tiny, **how)
        except DriverError as error:
            if error.status == cli.BAD_INPUT:
                raise
            if error.status in (run.NO_ISA, run.UNSUPPORTED):
                skip(plan, case, error.message)
            else:
                fail(plan, case, error)
            continue
        if (kernel := picture.get("kernel")) and kernel != GENERATED:
            cli.say(f"{spec} {scene.name}: no kernel for the scene, its general code runs ({kernel[9:]})")
        frame = picture["frames"][0]["ns"] / 1e9
        compiling = (picture.get("kernel_compile_ns") or 0) / 1e9  # once: the launches find it in the cache
        start = max(time.perf_counter() - begin - frame - compiling, 0)
        for width, height in dict.fromkeys(scene.size(height, width) for width, height in options.n):
            seconds = frame * width * height / (picture["width"] * picture["height"])
            if options.long is not None and options.long < seconds < NEAR * options.long:
                alone = how | {"reps": 1, "warmup": 0}
                try:  # a tiny frame's is no good guess of what costs per picture, tile or thread
                    seconds = run.render(spec, scene.path, height, width, **alone)["frames"][0]["ns"] / 1e9
                except DriverError as error:
                    fail(plan, case, error)
                    continue
            once = options.long is not None and seconds > options.long
            frames = 1 if once else options.reps + options.warmup
            of_scene = [scene.name, picture["scene_hash"]]  # two scenes may have one content
            asked = [spec.phase, spec.flags_from, *of_scene, width, height, threads]
            asked += overrides(plan).values()
            config = Config(
                config=hashlib.sha256(json.dumps(asked).encode()).hexdigest()[:12],
                **case,
                phase=spec.phase,
                flags_from=spec.flags_from,
                scene_hash=picture["scene_hash"],
                width=width,
                height=height,
                estimate_s=round(start + seconds * frames, 4),
                once=once,
            )
            plan["configurations"].append(dataclasses.asdict(config))
    return plan
