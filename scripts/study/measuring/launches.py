"""Times of a driver's launches: one launch, launches of several programs by turns, medians and gains."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from study.core import run
from study.core.registry import Scene, Spec
from study.measuring.schema import Gain, Timed
from study.numbers import stats
from study.numbers.schema import Interval

Size = tuple[int, int]  # width, height
Told = Mapping[str, str]  # variables of a driver's environment, which say how a phase is to work


class Frame(msgspec.Struct):
    """What experiments read of a driver's frame. Times in ns."""

    ns: float
    warmup: bool = False
    present_ns: float = 0
    update_ns: float = 0


class Made(msgspec.Struct):
    """What experiments read of a driver's record. Times in ns."""

    frames: list[Frame]
    settings: str | None = None
    display: str | None = None
    kernel: str | None = None
    kernel_compiler: str | None = None
    kernel_compile_ns: float | None = None  # null: this phase generates none
    prepare_ns: float = 0

    @property
    def timed(self) -> list[Frame]:
        return [frame for frame in self.frames if not frame.warmup]

    @property
    def ms(self) -> float:
        return float(np.median([frame.ns for frame in self.timed])) / 1e6

    @property
    def first_s(self) -> float:
        return self.frames[0].ns * 1e-9


def render(
    spec: Spec | str, path: Path, height: int, width: int | None = None, timed: bool = False, **how: Any
) -> Made:
    """run.render's record, typed. Raises DriverError."""
    return msgspec.convert(run.render(spec, path, height, width, timed=timed, **how), Made)


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
    how = {"cpu": run.FASTEST, "env_bytes": env_bytes, "reps": reps, "warmup": 1} | more
    return render(phase, scene.path, size[1], size[0], told=told, **how).ms


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
