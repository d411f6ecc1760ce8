"""The clocks that stood beside the times of a run, and launches whose clock is off from the others'."""

from dataclasses import dataclass

import numpy as np
import pandas as pd

TSC_OFF = 1e-4  # of the run's timer's rate: calibrations of one machine agree to 1e-6
CORE_OFF = 0.03  # of the core clock of the same configuration's launches


@dataclass(frozen=True)
class Off:
    """A launch whose clock (`what`, Hz) is off by `by` of the median of the others."""

    config: str
    spec: str
    scene: str
    launch: int
    what: str
    hz: float
    by: float

    def text(self) -> str:
        where = f"{self.spec} {self.scene} launch {self.launch}"
        return f"{where}: {self.what} {self.hz / 1e9:.4g} GHz, {100 * self.by:+.2g} % off the other launches"


def clocked(frames: pd.DataFrame) -> pd.DataFrame:
    """`frames` with core_hz (Hz), core_cycles and tsc_hz as floats: NaN where a clock was not measured."""

    def column(name: str) -> pd.Series:
        found = frames[name] if name in frames else pd.Series(np.nan, frames.index)
        return found.astype(float).where(lambda value: value > 0)

    hz = (column("core_hz_before") + column("core_hz_after")) / 2
    return frames.assign(core_hz=hz, core_cycles=column("core_cycles"), tsc_hz=column("tsc_hz"))


def off(frames: pd.DataFrame) -> list[Off]:
    """Timed launches whose timer is off from the run's rate, or whose core clock from its configuration's."""
    timed = clocked(frames[~frames.warmup.astype(bool)])
    by = timed.groupby(["config", "spec", "scene", "launch"], sort=False)
    launches = by[["tsc_hz", "core_hz"]].median().reset_index()
    cores = launches.groupby("config").core_hz.transform("median")
    found = []
    for what, hz, median, most in (
        ("timer", launches.tsc_hz, launches.tsc_hz.median(), TSC_OFF),
        ("core", launches.core_hz, cores, CORE_OFF),
    ):
        ratio = hz / median - 1
        far = launches.assign(hz=hz, ratio=ratio)[ratio.abs() > most]
        found += [Off(r.config, r.spec, r.scene, r.launch, what, r.hz, r.ratio) for r in far.itertuples()]
    return found


def without(frames: pd.DataFrame, launches: list[Off]) -> pd.DataFrame:
    names = {(one.config, one.launch) for one in launches}
    return frames[[key not in names for key in zip(frames.config, frames.launch, strict=True)]]
