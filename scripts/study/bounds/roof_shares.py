"""The roofs over a timed configuration and its shares of them: arithmetic, bandwidth, peaks, clocks.

The roof of a phase's own operation mix. A picture takes at least as many core cycles as the busiest of these
resources, each at its measured throughput (common/ceilings), one instruction per `bits` of lanes:

    divider               divisions and square roots, which one unit does
    multiply              multiplications and FMAs, which the same units do
    add, minmax, rsqrt    each by itself
    issue                 all of them and comparisons, at the most instructions per cycle of any kind

    mix roof = FLOPs / the largest of them;  share of it = those cycles / the cycles measured

That is a bound and no estimate. Additions may have units of their own or not, so they are added to
multiplications under `issue` only; latencies, branches, moves, shuffles, integers and memory are left out.
Masked lanes count as far as they are active, so of masked code the bound is lower still. There is none where
more than 5 % of the FLOPs have no ceiling: hardware events tell no kind, some neither precision nor width.

The bandwidth roof of a level is flop/byte times the most of its load, store and copy by accesses as wide as
the phase's own arithmetic (of any width where that was not measured). Widths of accesses are not counted:
what is copied by wider ones may pass it, so of scalar code it is an estimate. Every byte passes L1, which
the least roof has in it therefore; the levels behind it bound only what comes out of them.

    least roof = the lower of the mix roof and L1's;  set by: the resource, or L1

Peaks: "FMA roof" is measured, "peak" what the ports allow (bounds.peaks). Cycles are of the clock of scalar
code, taken beside each frame; 512-bit code may run on a lower one, and "under load" counts by that, taken
before each launch's frames: cycles = ns × core_hz_load.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import pandas as pd

from study.bounds import ceilings, peaks
from study.bounds.ceilings import LEVELS, Ceilings
from study.counting.decode import FLOPS
from study.numbers.analysis import Cell

RESOURCES = {
    **{"div": "divider", "sqrt": "divider", "mul": "multiply", "fma": "multiply"},
    **{"add": "add", "minmax": "minmax", "rsqrt": "rsqrt"},
}
ISSUE = "issue"
NEAREST = LEVELS[0]  # what every byte passes
ELEMENT = {**peaks.ELEMENT, "half": 16, "extended": 80}
MOST_UNPRICED = 0.05  # of the FLOPs
PEAK_BITS = 256  # the paper's share of peak: of AVX2, whatever a phase itself uses
SHARES = (
    *("share_of_fma_roof", "share_of_mix_roof", "share_of_avx2_roof"),
    *("share_of_fma_peak", "share_of_avx2_peak"),
)

Row = dict[str, Any]


@dataclass(frozen=True)
class Mix:
    """Least core cycles of counted operations, by resource; `unpriced`: share of FLOPs without a ceiling."""

    flops: int
    cycles: dict[str, float]
    unpriced: float

    @property
    def bound(self) -> str | None:
        return max(self.cycles, key=self.cycles.__getitem__, default=None)

    @property
    def roof(self) -> float:
        """Flop per core cycle; NaN where too little has a ceiling for a bound of the whole."""
        least = self.cycles[self.bound] if self.bound else 0
        return self.flops / least if least > 0 and self.unpriced <= MOST_UNPRICED else math.nan


def mix(lanes: Mapping[tuple[str, str, int], int], limits: Ceilings) -> Mix:
    """`lanes`: (kind, precision, bits) → operations, lane by lane, as in study.counting.counts."""
    cycles: dict[str, float] = defaultdict(float)
    flops = unpriced = 0
    for (kind, precision, bits), n in lanes.items():
        flops += FLOPS[kind] * n
        if kind == "any" or precision not in ELEMENT or bits <= 0:  # hardware events that tell less apart
            unpriced += FLOPS[kind] * n
            continue
        instructions = n * ELEMENT[precision] / bits
        issue, rate = limits.issue(precision, bits), limits.rate(kind, precision, bits)
        if issue > 0:
            cycles[ISSUE] += instructions / issue
        if kind in RESOURCES:
            if rate > 0:
                cycles[RESOURCES[kind]] += instructions / rate
            else:
                unpriced += FLOPS[kind] * n
    return Mix(flops, dict(cycles), unpriced / flops if flops else math.nan)


def below(row: Row, operations: Any, limits: Ceilings | None, cpu: Mapping[str, Any]) -> Row:
    """The roofs and peaks of a row, and its shares of them. `operations`: its lanes, or None."""
    nan, speed = math.nan, row["flops_per_core_cycle"]
    precision, bits = row["precision"], row["bits"]
    made: Row = {}
    for name, width in (("fma", bits), ("avx2_fma", PEAK_BITS)):
        made[f"{name}_roof"] = limits.flops("fma", precision, width) if limits else nan
        made[f"{name}_peak"] = peaks.peak(cpu, "fma", precision, width)
    for name, of in (("fma", "fma"), ("avx2", "avx2_fma")):
        for what in ("roof", "peak"):
            made[f"share_of_{name}_{what}"] = speed / made[f"{of}_{what}"]
    own = mix(operations, limits) if limits and operations is not None else Mix(0, {}, nan)
    made |= {"mix_roof": own.roof, "share_of_mix_roof": speed / own.roof}
    made["mix_bound"] = own.bound if own.roof > 0 else None
    made["unpriced_share"] = own.unpriced
    for level in LEVELS:
        made[f"{level}_roof"] = row["intensity"] * (limits.bandwidth_by(level, bits) if limits else nan)
    least = {made["mix_bound"]: own.roof, NEAREST: made[f"{NEAREST}_roof"]}
    least = {name: roof for name, roof in least.items() if roof > 0}
    made["least_bound"] = min(least, key=least.__getitem__, default=None)
    made["least_roof"] = least.get(made["least_bound"], nan)
    made["share_of_least_roof"] = speed / made["least_roof"]
    return made


def under_load(row: Row, cell: Cell, limits: Ceilings | None) -> Row:
    """The clock under vector load over the one that core cycles are of, and shares by it; NaN where no load
    was tried (scalar code). `load_clock_ceilings`: by the clock that ceilings.json has for that load.
    """
    nan = math.nan
    clock = cell.values["core_cycles"] / cell.values["ns"] * 1e9
    loads = cell.values["core_hz_load"] if "core_hz_load" in cell.values else 0 * clock
    ratio = (loads / clock)[loads > 0]
    made = {"load_clock": ratio.median(), "load_clock_least": ratio.min()} if len(ratio) else {}
    there = ((limits.data.get("core_hz_load") or {}).get(str(row["bits"])) if limits else None) or nan
    made["load_clock_ceilings"] = there / clock.median() if made else nan
    made = {"load_clock": nan, "load_clock_least": nan} | made
    for name in ("fma", "least"):
        roof = row[f"{name}_roof"]
        made[f"share_of_{name}_roof_load"] = row["flops_per_core_cycle"] / made["load_clock"] / roof
    return made


def clocks(table: pd.DataFrame) -> list[str]:
    """By how much the clock under vector load was below the one that cycles are counted by, per width."""
    said: list[str] = []
    if table.empty:
        return said
    for bits, rows in table[table["load_clock"] > 0].groupby("bits"):
        frames = f"before the frames {rows['load_clock'].median():.3f} of it, by the median of these rows"
        frames += f" (least {rows['load_clock_least'].min():.3f})"
        lower = rows["load_clock_ceilings"].min()
        if lower > 0 and abs(lower - 1) > ceilings.CLOCK:
            frames += f"; {lower:.3f} while the ceilings were measured, by which shares would be up to "
            frames += f"{1 / lower:.3f} times those given" if lower < 1 else "no higher"
        said.append(f"Core cycles are of scalar code's clock. Under a load of {bits} bits it was {frames}.")
    return said
