"""Programs of two checkouts, launched by turns: what one run each made look slower is measured in one."""

import hashlib
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from study.core import run, store
from study.core.cli import StudyError
from study.core.registry import ROOT, find_scene
from study.core.store import Run
from study.measuring import launches
from study.measuring.changes import Key, Samples
from study.numbers.stats import ENOUGH

MORE = 2  # times the launches of the first measurement


def program(measured: Run, checkout: Path, spec: str) -> Path:
    """What the run launched, in the checkout that built it. StudyError where it is another one, or gone."""
    path = checkout.resolve() / "build" / spec / "render"
    try:
        digest = hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError as error:
        raise StudyError(f"{path}: {error.strerror}; --confirm names the checkout of {measured}") from None
    if digest != measured.plan.binaries.get(spec):
        raise StudyError(f"{path}: not the program that {measured} measured; measure that run again")
    return path


def by_turns(base: Run, other: Run, checkout: Path, keys: Iterable[Key], seed: int) -> dict[Key, Samples]:
    """Configuration → ns of a frame, by launch, of the base's program and of this checkout's, in one
    interleaved run by the plan of `other`. Raises StudyError."""
    plan, keys = other.plan, list(keys)
    store.known_scenes(other.path)
    programs = {
        (key, side): program(measured, folder, key[4])
        for key in keys
        for side, measured, folder in ((0, base, checkout), (1, other, ROOT))
    }
    once = {(c.scene, c.width, c.height, c.threads, c.spec) for c in plan.configurations if c.once}
    cpu = run.FASTEST if plan.cpu is None else plan.cpu

    def launch(item: tuple[Key, int], env_bytes: int) -> float:
        scene, width, height, threads, _ = key = item[0]
        how: dict = {"threads": threads, "cpu": cpu, "env_bytes": env_bytes}
        how |= {"hit_distance": plan.hit_distance, "max_steps": plan.max_steps}
        how |= {"reps": 1, "warmup": 0} if key in once else {"reps": plan.reps, "warmup": plan.warmup}
        made = launches.render(programs[item], find_scene(scene).path, height, width, timed=True, **how)
        return made.ms * 1e6

    count = MORE * max(plan.launches, ENOUGH)
    found = run.interleaved(list(programs), count, seed, cpu, launch, "confirm")
    return {key: (np.array(found[key, 0]), np.array(found[key, 1])) for key in keys}
