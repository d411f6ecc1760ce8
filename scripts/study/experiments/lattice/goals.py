"""The goal on CPU-RTRM's scene."""

from __future__ import annotations

from collections.abc import Iterable

from study.core import show
from study.experiments import goal
from study.experiments.lattice import measure as lattice
from study.numbers import verdicts
from study.numbers.analysis import Data
from study.numbers.stats import Interval

RTRM = 14.0  # times CPU-RTRM's own figures


def reached(data: Data) -> Iterable[goal.Goal]:
    result = lattice.read(data.path / lattice.FILE)
    for threads in (1, 2):
        row = lattice.best(result, threads)
        if row is None:
            continue
        ms = goal.interval(row, "ms", "")
        ratio = Interval(*(row["program_ms"] / x for x in (ms.value, ms.high, ms.low)), 0, ms.sufficient)
        other = f"CPU-RTRM's {row['program_ms']:g} ms (another machine: the value decides)"
        name = f"lattice over {other}, threads {threads}"
        error = f"{show.number(row['psnr_db'])} dB to ground truth"
        verdict = verdicts.MET if ratio.value >= RTRM else verdicts.MISSED
        yield goal.Goal(name, RTRM, ratio, verdict, row["phase"], beside=error, ours=True)
