"""What disturbed a run's timed frames, and which phases its launches cannot tell apart, in sentences."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, groupby

import numpy as np
import pandas as pd

from study.numbers import clocks, stats
from study.numbers.analysis import Cell, Data

PREEMPTIONS = 20  # per second; a quiet machine has a few
UNUSED, OVERHEAD = 0.01, 200_000  # of a launch whose CPUs others did not get: share, and ns of launching
TOLD = ("user_ns", "system_ns", "unused_ns", "ctx_voluntary", "ctx_involuntary")  # what tells interruptions


@dataclass(frozen=True)
class Noise:
    """Counts over the timed frames, 0 where the run does not tell."""

    frames: int
    launches: int
    seconds: float
    steal_ticks: int
    ctx_voluntary: int
    ctx_involuntary: int
    faults_major: int


def counted(data: Data) -> Noise:
    timed = data.frames[~data.frames.warmup.astype(bool)]
    names = ("steal_ticks", "ctx_voluntary", "ctx_involuntary", "faults_major")
    counts = {name: int(timed[name].sum()) if name in timed else 0 for name in names}
    launches = timed.groupby(["config", "launch"]).ngroups
    return Noise(len(timed), launches, float(timed.ns.sum() / 1e9), **counts)


def remarks(frames: pd.DataFrame, cells: Sequence[Cell]) -> list[str]:
    """One sentence each for slow first launches, outliers, stolen time and other processes. Outlier: ten
    robust standard deviations (1.4826 times the median absolute deviation, hyperfine's rule) and 5 % away
    from the median: a quiet machine's smallest wobble is none."""
    found = [text for cell in cells for text in _outliers(cell)]
    if frames.empty:
        return found
    if off := {(one.config, one.launch) for one in clocks.off(frames)}:
        ran = f"launch{'es' * (len(off) > 1)} ran at another clock than the others"
        found.append(f"{len(off)} {ran} (scripts/stepwise compare says which)")
    return [*found, *others(frames)]


def _taken(launches: pd.DataFrame) -> pd.Series:
    """How often others switched each launch out: never if a program had its CPUs all the time, for then its
    own threads and processes did. If it waited for anything (two voluntary switches or more), one is of its
    launcher, which wakes when the program has started."""
    if not {*TOLD} <= {*launches}:
        return launches.ctx_involuntary
    whole = launches.unused_ns <= OVERHEAD + UNUSED * (launches.user_ns + launches.system_ns)
    return (launches.ctx_involuntary - (launches.ctx_voluntary > 1)).clip(0).mask(whole, 0)


def interrupted(launches: pd.DataFrame) -> pd.Series:
    """Whether other processes took each launch's CPUs, each more than PREEMPTIONS times a second; False where
    the run does not tell."""
    if not {*TOLD} <= {*launches}:
        return pd.Series(False, launches.index)
    had = launches.user_ns + launches.system_ns + launches.unused_ns
    return _taken(launches) > PREEMPTIONS * 1e-9 * had


def others(frames: pd.DataFrame) -> list[str]:
    """One sentence each for stolen time and for other processes."""
    seconds, found = float(frames.ns.sum()) * 1e-9, []
    if "steal_ticks" in frames and (steal := frames.steal_ticks.sum() * 0.01 / seconds) > 0.01:
        found.append(f"the hypervisor took {steal:.3f} s of all CPUs' time a second measured (steal)")
    if "ctx_involuntary" in frames:
        often = _taken(frames).sum() / seconds
        if often > PREEMPTIONS:
            found.append(f"other processes took the measured CPU {often:.0f} times a second")
    return found


def _outliers(cell: Cell) -> list[str]:
    values = cell.values.ns.to_numpy(float)
    if len(values) < 3:
        return []
    name = f"{cell.spec} {cell.scene} n={cell.height} threads={cell.threads}"
    middle = np.median(values)
    off = np.abs(values - middle)
    far = (off > 14.826 * np.median(off)) & (off > 0.05 * middle)
    found = []
    if far[0] and values[0] > middle:
        found.append(f"{name}: the first launch took {values[0] / middle:.2f} times the median")
    if far[1:].any():
        found.append(f"{name}: {far[1:].sum()} of {len(values)} launches are outliers")
    return found


def indistinguishable(cells: Sequence[Cell]) -> list[str]:
    """A sentence for each comparison with pairs of specs that the launches cannot tell apart."""
    found = []

    def key(cell: Cell) -> tuple:
        return *cell.picture, cell.threads

    for (scene, width, height, threads), some in groupby(sorted(cells, key=lambda c: (key(c), c.spec)), key):
        where, mine = f"{scene} {width}x{height}, threads {threads}", list(some)
        if min(len(cell.values) for cell in mine) < stats.FEWEST:
            found.append(f"{where}: under {stats.FEWEST} launches, so no two phases can be told apart")
            continue
        ratios = [(f"{a.spec} and {b.spec}", b.over(a)) for a, b in combinations(mine, 2)]
        if told := [f"{who} ({ratio.text()})" for who, ratio in ratios if not ratio.excludes_one]:
            found.append(f"{where}: noise hides the difference (and ratio of times) of {', '.join(told)}")
    return found
