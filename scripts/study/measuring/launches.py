"""Times of a driver's launches: one launch, launches of several programs by turns, medians and gains."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from study.core import run
from study.core.registry import Scene, Spec
from study.measuring.schema import Gain, Timed
from study.numbers import stats
from study.numbers.schema import Interval

Size = tuple[int, int]  # width, height
Told = Mapping[str, str]  # variables of a driver's environment, which say how a phase is to work


def milliseconds(
    phase: Spec | str,
    scene: Scene,
    size: Size,
    reps: int,
    env_bytes: int = 0,
    told: Told | None = None,
    **more: Any,
) -> float:
    """Median time of a launch's frames, on as many CPUs as it has threads. Raises StudyError."""
    how = {"cpu": run.FASTEST, "env_bytes": env_bytes, "reps": reps, "warmup": 1, "timed": False} | more
    return run.median_ms(run.render(phase, scene.path, size[1], size[0], told=told, **how))


def interleaved(
    cases: Mapping[str, Callable[[int], float]], launches: int, seed: int
) -> dict[str, list[float]]:
    """run.interleaved of cases by name, each a function of the bytes that its environment is padded with."""
    return run.interleaved(list(cases), launches, seed, run.FASTEST, lambda name, pad: cases[name](pad))


def timed(times: Sequence[float]) -> Timed:
    found = Interval.of(stats.median_interval(times))
    return Timed(ms=found.value, ms_low=found.low, ms_high=found.high, launches=list(times))


def gain(base: Sequence[float], mine: Sequence[float]) -> Gain:
    """How many times as fast `mine` is."""
    found = Interval.of(stats.ratio_interval(base, mine))
    return Gain(gain=found.value, gain_low=found.low, gain_high=found.high)
