"""What a sweep measures: configurations, their expected durations, what is skipped and why."""

import argparse
import datetime
import hashlib
import itertools
import json
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import msgspec

from study.core import cli, progress, run
from study.core.build import build
from study.core.registry import ROOT, Scene, Spec, cpu_supports, find_phase, find_scene, missing_isa, phases
from study.core.run import DriverError
from study.core.run_schema import Configuration, Left, PhaseJson, Plan
from study.numbers import summary
from study.numbers.analysis import GENERATED, SECOND_BASE
from study.numbers.stats import FEWEST

CALIBRATION_HEIGHT = 45
NEAR = 10  # times --long: up to that a frame is timed at its own size before it counts as long


class One(msgspec.Struct):
    ns: float


class Tried(msgspec.Struct):
    frames: list[One]
    width: int
    height: int
    scene_hash: str
    kernel: str | None = None
    kernel_compile_ns: float | None = None

    @property
    def seconds(self) -> float:
        return self.frames[0].ns / 1e9


def now() -> str:
    return datetime.datetime.now(datetime.UTC).isoformat(timespec="milliseconds")


def sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def overrides(plan: Plan | argparse.Namespace) -> dict[str, Any]:
    """The scene's limits that the command line changed (None: as the scene says)."""
    return {"hit_distance": plan.hit_distance, "max_steps": plan.max_steps}


def wanted_specs(names: Iterable[str], second_base: bool) -> list[Spec]:
    """Specs without duplicates, then opt2 with each set of flags it is to be compared under. Two specs with
    the same sources and equal compiler flags are the same program; of opt2 no further one is built for flags
    that change no arithmetic."""
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


def skip(plan: Plan, left: Left) -> None:
    plan.skipped.append(left)
    what = [left.spec, left.scene, left.threads]
    cli.say(f"skipped: {' '.join(str(word) for word in what if word)}: {left.reason}")


def fail(plan: Plan, left: Left, error: DriverError) -> None:
    about = {"status": error.status, "message": error.message, "time": now()}
    plan.failures.append(msgspec.structs.replace(left, **about))
    cli.say(f"failed: {left.spec} {left.scene}: {error.message}")


def tried(plan: Plan, case: Left, scene: Scene, width: int, height: int, **more: int) -> Tried | None:
    """What the driver says of a picture; None, which stands in the plan, where it draws none."""
    how = {"threads": case.threads, "cpu": plan.cpu, **overrides(plan), **more}
    try:
        return msgspec.convert(run.render(Spec.parse(case.spec), scene.path, height, width, **how), Tried)
    except DriverError as error:
        if error.status == cli.BAD_INPUT:
            raise
        if error.status in (run.NO_ISA, run.UNSUPPORTED):
            skip(plan, msgspec.structs.replace(case, reason=error.message))
        else:
            fail(plan, case, error)
        return None


def make_plan(args: argparse.Namespace) -> Plan:
    """The plan of a new run (plan.json), from the options of a sweep. Builds every spec and renders every
    scene once, tiny: what this CPU or a phase refuses is skipped with the reason, the rest gets an expected
    duration in proportion to its pixels; what would by that be too long for more than a frame, but not by
    far, that of a first frame of its size."""
    same = ("seed", "cpu", "launches", "reps", "warmup", "long", "few", "hit_distance", "max_steps")
    plan = Plan(**{key: getattr(args, key) for key in same}, budget_s=args.budget, began=now())
    specs = []
    for spec in wanted_specs(args.phase, args.second_base):
        if not cpu_supports(spec):
            lacking = f"this CPU lacks {', '.join(missing_isa(spec))}"
            skip(plan, Left(spec=str(spec), reason=lacking))
            continue
        plan.binaries[str(spec)] = sha256(build(spec))
        specs.append(spec)
        for name in (spec.phase, spec.flags_from):  # as they were: analysis reads the run alone
            phase = find_phase(name)
            made = msgspec.structs.asdict(phase) | {"path": str(phase.path.relative_to(ROOT))}
            plan.phases[name] = msgspec.convert(made, PhaseJson)
    scenes = [find_scene(name) for name in dict.fromkeys(args.scene)]
    cases = list(itertools.product(specs, scenes, dict.fromkeys(args.threads)))
    for spec, scene, threads in progress.each(cases, "calibrate"):
        case = Left(spec=str(spec), scene=scene.name, threads=threads)

        begin = time.perf_counter()
        picture = tried(plan, case, scene, *scene.size(CALIBRATION_HEIGHT))
        if picture is None:
            continue
        if picture.kernel and picture.kernel != GENERATED:
            cli.say(
                f"{spec} {scene.name}: no kernel for the scene, its general code runs ({picture.kernel[9:]})"
            )
        # compiling happens once: the launches find it in the cache
        start = max(time.perf_counter() - begin - picture.seconds - (picture.kernel_compile_ns or 0) / 1e9, 0)
        for width, height in dict.fromkeys(scene.size(height, width) for width, height in args.n):
            seconds = picture.seconds * width * height / (picture.width * picture.height)
            if args.long is not None and args.long < seconds < NEAR * args.long:
                # a tiny frame's is no good guess of what costs per picture, tile or thread
                if (alone := tried(plan, case, scene, width, height, reps=1, warmup=0)) is None:
                    continue
                seconds = alone.seconds
            once = args.long is not None and seconds > args.long
            of_scene = [scene.name, picture.scene_hash]  # two scenes may have one content
            asked = [spec.phase, spec.flags_from, *of_scene, width, height, threads]
            asked += overrides(plan).values()
            plan.configurations.append(
                Configuration(
                    config=hashlib.sha256(json.dumps(asked).encode()).hexdigest()[:12],
                    spec=str(spec),
                    phase=spec.phase,
                    flags_from=spec.flags_from,
                    scene=scene.name,
                    scene_hash=picture.scene_hash,
                    width=width,
                    height=height,
                    threads=threads,
                    estimate_s=round(start + seconds * (1 if once else args.reps + args.warmup), 4),
                    once=once,
                    launches=FEWEST if args.few is not None and seconds > args.few else 0,
                )
            )
    return plan
