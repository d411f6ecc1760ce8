#!/usr/bin/env python3
"""When a kernel generated for a scene has paid for its compilation: frames against the general code's time.

Both phases are timed interleaved, each launch a process of its own. The kernel is compiled once, into a new
cache, and set-up is what the driver says it took; the other launches find it there.
"""

from __future__ import annotations

import math
import os
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from study import cli, registry, stats, store
from study.build import build
from study.cli import StudyError
from study.registry import Scene, Spec
from study.run import USABLE, frames, interleaved, render


def break_even(setup_s: float, general_ms: float, generated_ms: float) -> float:
    """Frames after which set-up and generated frames take less than general ones; inf: never."""
    gain = (general_ms - generated_ms) / 1e3
    return math.ceil(setup_s / gain) if gain > 0 else math.inf


def set_up(spec: Spec, scene: Scene) -> dict[str, Any]:
    """The driver's account of the kernel, made and found again. StudyError: it fell back, and why."""
    made = render(spec, scene.path, 36)
    if made["kernel"] is None:
        raise StudyError(f"{spec} generates no kernels; opt10_scene does")
    found = render(spec, scene.path, 36)
    for facts in (made, found):
        if facts["kernel"] != "generated":
            return {"generated": False, "reason": facts["kernel"]}
    return {
        "generated": True,
        "compiler": made["kernel_compiler"],
        "hash": made["kernel_hash"],
        "compile_s": made["kernel_compile_ns"] / 1e9,
        "generate_ms": made["kernel_generate_ns"] / 1e6,
        "load_ms": found["kernel_load_ns"] / 1e6,
    }


def measure(specs: tuple[Spec, Spec], scene: Scene, height: int, launches: int, reps: int) -> dict[str, Any]:
    """One scene: set-up, medians in ms with their intervals, frames to break even."""
    found = {"scene": scene.name, "height": height, **set_up(specs[1], scene)}
    if not found["generated"]:
        return found

    def once(spec: Spec, env_bytes: int) -> float:
        lines = frames(spec, scene.path, height, cpu=USABLE[-1], env_bytes=env_bytes, reps=reps, warmup=2)
        return float(np.median([line["ns"] for line in lines if not line["warmup"]])) / 1e6

    times = interleaved(specs, launches, 1, USABLE[-1], once, scene.name)
    general, generated = (stats.median_interval(times[spec]) for spec in specs)
    found |= {"general_ms": general.value, "general_interval": [general.low, general.high]}
    found |= {"generated_ms": generated.value, "generated_interval": [generated.low, generated.high]}
    found["gain"] = general.value / generated.value
    frames_needed = break_even(found["compile_s"], general.value, generated.value)
    return {**found, "break_even_frames": frames_needed if math.isfinite(frames_needed) else None}


def text(found: dict[str, Any]) -> str:
    head = f"{found['scene']}, n = {found['height']}"
    if not found["generated"]:
        return f"{head}: no kernel ({found['reason']})"
    needed = found["break_even_frames"]
    return (
        f"{head}: general {found['general_ms']:.2f} ms, generated {found['generated_ms']:.2f} ms "
        f"({found['gain']:.2f}×); compiled in {found['compile_s']:.2f} s, "
        f"found again in {found['load_ms']:.2f} ms; "
        + (f"breaks even after {needed:,} frames" if needed else "never breaks even")
    )


def run() -> int:
    parser = cli.parser(__doc__)
    parser.add_argument("--phase", default="opt10_scene", metavar="SPEC", help="default: opt10_scene")
    parser.add_argument("--against", default="opt9_convex", metavar="SPEC", help="default: opt9_convex")
    parser.add_argument("--scene", nargs="+", default=["scene0"], metavar="NAME", help="default: scene0")
    parser.add_argument("-n", "--height", type=cli.at_least(1), default=720, help="default: 720")
    parser.add_argument("--launches", type=cli.at_least(1), default=5, help="of each phase; default: 5")
    parser.add_argument("--reps", type=cli.at_least(1), default=10, help="frames of each launch; default: 10")
    parser.add_argument("-o", "--out", type=Path, metavar="JSON", help="written there too")
    args = parser.parse_args()
    specs = Spec.parse(args.against), Spec.parse(args.phase)
    scenes = [registry.find_scene(name) for name in args.scene]
    for spec in specs:
        build(spec)
    with tempfile.TemporaryDirectory() as cache:
        os.environ["STEPWISE_CACHE"] = cache
        found = [measure(specs, scene, args.height, args.launches, args.reps) for scene in scenes]
    result = {"schema": 1, "phase": str(specs[1]), "against": str(specs[0]), "scenes": found}
    if args.out:
        store.write_json(args.out, result)
    if args.json:
        cli.emit(result)
    else:
        print("\n".join(map(text, found)))
    return cli.OK


if __name__ == "__main__":
    cli.main(run)
