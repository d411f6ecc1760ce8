"""Runs of programs that are no phases: a folder with the files of a sweep, a line of frames for each launch.

The program's name stands as phase and its case (`n=128`, or "" for the only one) as scene; the picture is
1×1 pixels. So what reads a sweep reads such a run: compare, --history, --export, report, publish.
"""

import datetime
import hashlib
import json
from pathlib import Path
from typing import Any

from study.core import store
from study.core.run_schema import Configuration, Context, Plan, Program
from study.core.store import Run

NO_CLOCK = ("tsc_cycles", "tsc_hz", "core_hz_before", "core_hz_after", "core_cycles")
UNSAID = ("isa", "precision", "flags", "compiler", "libc")


def now() -> str:
    return datetime.datetime.now(datetime.UTC).isoformat(timespec="milliseconds")


def digest(*values: Any) -> str:
    return hashlib.sha256(json.dumps(values).encode()).hexdigest()


def configuration(program: Program, work: str = "", threads: int = 1) -> Configuration:
    """`work`: the same for programs whose times may be compared: digest of their input, of what is timed."""
    return Configuration(
        config=digest(program.name, program.case, program.command, work)[:12],
        spec=program.name,
        phase=program.name,
        flags_from=program.name,
        scene=program.case,
        scene_hash=digest(program.case, work)[:16],
        width=1,
        height=1,
        threads=threads,
    )


def begin(results: Path, slug: str, plan: Plan, context: Context) -> Run:
    """A new run below `results`/`slug`. Configurations that the plan lacks are made of its programs. Raises
    StudyError."""
    plan.configurations = plan.configurations or [configuration(one) for one in plan.programs]
    run = Run.create(results, slug)
    run.lock()
    store.write_json(run.path / "context.json", context)
    store.write_json(run.path / "plan.json", plan)
    return run


def end(run: Run, plan: Plan) -> None:
    """Ends a run after its last line. Whoever measured puts context.end into the context himself."""
    plan.finished = now()
    store.write_json(run.path / "plan.json", plan)
    run.close()


def line(
    of: Configuration, launch: int, ns: float, *, warmup: bool = False, frame: int = 0, **more: Any
) -> dict[str, Any]:
    """A line of frames.jsonl, for Run.append_frame: `launch` is the process, `frame` the value in it. `more`:
    keys of run_schema.Frame: round (by which programs of one run are paired), user_ns, cpu, time …"""
    about = {"schema": 1, "config": of.config, "launch": launch, "frame": frame, "warmup": warmup}
    about |= {"phase": of.phase, "flags_from": of.flags_from, "scene": of.scene, "scene_hash": of.scene_hash}
    about |= {"width": 1, "height": 1, "threads": of.threads, "ns": float(f"{ns:.12g}")}
    return {
        **about,
        "prepare_ns": 0,
        "present_ns": 0,
        **dict.fromkeys(NO_CLOCK, 0),
        **dict.fromkeys(UNSAID, ""),
        **more,
    }
