"""One picture by baseline and by a faster phase: their times, the error between."""

import argparse
import os
import time
from pathlib import Path
from types import SimpleNamespace

from study.core import cli, registry, temporary
from study.core.build import build, build_together
from study.core.cli import Outcome, StudyError
from study.core.registry import Scene, Spec
from study.core.run import FASTEST, USABLE, render
from study.pictures import images, panels

STEP, LARGEST = 36, 720  # heights that are whole in 16:9
MOST_SWITCHES = 20  # involuntary context switches a second that an idle machine has
SHARE = 0.5  # of the time for the baseline's frame; the rest: the other's two, metrics, drawing


def height_for(ns_per_pixel: float, seconds: float) -> int:
    """The largest height in steps of 36, from 36 to 720, whose 16:9 picture is rendered in `seconds`."""
    fits = (seconds * 1e9 / ns_per_pixel * 9 / 16) ** 0.5 if seconds > 0 else 0
    return int(min(LARGEST, max(STEP, fits // STEP * STEP)))


def able(wanted: Spec) -> Spec:
    """The phase asked for, else the furthest one before it in its family that this CPU can run."""
    lacking = " ".join(registry.missing_isa(wanted))
    if not lacking:
        return wanted
    asked = registry.find_phase(wanted.phase)
    family = [p for p in registry.phases().values() if p.family == asked.family and p.parent]
    before = [p.name for p in family if p.order < asked.order and registry.cpu_supports(p)]
    if not before:
        raise StudyError(f"{wanted} cannot run: this CPU lacks {lacking}", cli.CANNOT_RUN)
    cli.say(f"skipped {wanted}: this CPU lacks {lacking}; here is {before[-1]} instead")
    return Spec.parse(before[-1])


def shoot(spec: Spec, scene: Scene, height: int, out: Path | None = None, warmup: int = 0) -> SimpleNamespace:
    """One timed frame on one thread: the driver's facts, ns (of the frame) and ns_per_pixel."""
    facts = render(spec, scene.path, height, aov=True, out=out, warmup=warmup, cpu=FASTEST)
    frame = SimpleNamespace(**next(frame for frame in facts["frames"] if not frame["warmup"]))
    kept = ("width", "height", "threads", "isa", "precision", "lanes", "flags", "compiler", "libc")
    shot = SimpleNamespace(spec=str(spec), **{key: facts[key] for key in kept}, ns=frame.ns)
    shot.ns_per_pixel = frame.ns / (shot.width * shot.height)
    switched = frame.ctx_involuntary > MOST_SWITCHES * (1 + frame.ns / 1e9)
    shot.disturbed = switched or os.getloadavg()[0] > len(USABLE) + 1  # its own make is in the last minute's
    return shot


def speed(shot: SimpleNamespace) -> str:
    disturbed = " (disturbed by other programs)" if shot.disturbed else ""
    return f"{shot.ns / 1e6:,.0f} ms, {shot.ns_per_pixel:,.0f} ns/pixel{disturbed}"


def note(shot: SimpleNamespace) -> str:
    rays = f"{shot.lanes} {shot.precision} ray{'s' if shot.lanes > 1 else ''} at a time"
    return f"{speed(shot)}\none thread, {rays}"


def options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--phase", default="opt4", metavar="PHASE", help="the faster one; default: opt4")
    parser.add_argument("--scene", default="scene0", metavar="SCENE", help="default: scene0")
    parser.add_argument(
        "--budget", type=float, default=45, metavar="SECONDS", help="time to fill; default: 45"
    )
    out = registry.ROOT / "build" / "demo.png"
    parser.add_argument("-o", "--out", type=Path, default=out, metavar="PATH", help="default: build/demo.png")


def run(args: argparse.Namespace) -> Outcome:
    reference, spec = Spec.parse("baseline"), able(Spec.parse(args.phase))
    scene = registry.find_scene(args.scene)
    build_together([(needed, "render") for needed in (reference, spec)], len(USABLE))
    for needed in (reference, spec):
        build(needed)
    began = time.monotonic()
    trial = shoot(reference, scene, STEP, warmup=1)
    height = height_for(trial.ns_per_pixel, SHARE * args.budget)
    cli.say(f"rendering {scene.name} at n = {height} by {reference}, then by {spec}")
    with temporary.folder() as folder:
        files = folder / "a.exr", folder / "b.exr"
        slow, fast = shoot(reference, scene, height, files[0]), shoot(spec, scene, height, files[1], warmup=1)
        pictures = images.read(files[0]), images.read(files[1])
    metrics, ratio = images.compare(*pictures), slow.ns / fast.ns
    size = f"{slow.width}×{slow.height} pixels"
    faster = f"{ratio:,.1f} times as fast as {reference}"
    notes = note(slow), note(fast), "one frame each; make study has intervals"
    soft = scene.content.light.shadows == "soft" and registry.find_phase(spec.phase).draws_ideal
    shadow = f"; it draws the ideal soft shadow, {reference} the paper's estimate of it" * soft
    names, title = (str(reference), str(spec)), f"{scene.name}, {size}: {spec} is {faster}"
    panels.save(panels.pair(pictures, names, title, metrics, notes), args.out)
    found = {"schema": 1, "scene": scene.name, "reference": vars(slow), "phase": vars(fast), "speedup": ratio}
    found |= {**metrics, "seconds": time.monotonic() - began, "picture": args.out}
    lines = [f"{reference}, {scene.name}, {size}: {speed(slow)}"]
    lines += [f"{spec}: {speed(fast)}, {faster} (one thread each); {panels.error_text(metrics)}{shadow}"]
    return Outcome(found, lines, remarks=[f"picture: {args.out}"])
