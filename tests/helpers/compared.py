"""Runs whose times are made up, and their comparison."""

import subprocess

import complete
import emitted
import numpy as np

from study.core import store
from study.core.run_schema import Frame
from study.core.store import Run
from study.measuring import changes, two_runs

CONTEXT = {"cpu": {"model": "Some CPU"}, "git": {"commit": "1" * 40, "dirty": False}, "libc": "glibc 2.36"}
LINE = {"schema": 1, "scene_hash": "aa", "width": 16, "height": 9, "threads": 1, "steal_ticks": 0}
LINE |= {"hit_distance": 1e-6, "max_steps": 3000, "flags": "-O3", "compiler": "gcc 12", "libc": "2.36"}

NO_CLOCK = dict.fromkeys(("tsc_hz", "core_hz_before", "core_hz_after", "core_cycles"), 0.0)  # as untimed


def make_run(folder, times, context=None, launches=8, **line) -> Run:
    """A run with the given milliseconds of each (phase, scene), 1 % of noise and a slow warm-up frame."""
    made = Run(folder)
    store.write_json(made.path / "plan.json", {})
    store.write_json(made.path / "context.json", CONTEXT | (context or {}))
    whole = complete.filled(LINE | NO_CLOCK, Frame)
    noise = 1 + 0.01 * np.random.default_rng(1).standard_normal(launches)
    for (phase, scene), ms in times.items():
        for launch in range(launches):
            for frame in (-1, 0):
                facts = {"phase": phase, "flags_from": phase, "scene": scene, "config": phase + scene}
                facts |= {"launch": launch, "frame": frame, "warmup": frame < 0}
                ns = 1_000_000_000 if frame < 0 else round(ms * 1e6 * noise[launch])
                made.append_frame(whole | facts | {"ns": ns} | line)
    made.close()
    return made


def run(*words: object) -> subprocess.CompletedProcess[str]:
    return emitted.ran("compare", *words)


def sides(*runs, leave_out=False) -> list[two_runs.Side]:
    return [two_runs.read(letter, run.path, leave_out) for letter, run in zip("ABC", runs, strict=False)]


def rows(*runs, by="time", least=0.0, least_work=0.001) -> dict:
    base, *others = sides(*runs)
    found = [row for other in others for row in changes.rows(base, other, by, least, False)]
    return {(row.spec, row.scene): row for row in changes.judged(found, by, least_work, least)}
