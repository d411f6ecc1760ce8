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

import math
import statistics
from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from study.bounds import ceilings, peaks
from study.bounds.ceilings import LEVELS, Ceilings
from study.counting.schema import FLOPS
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

nan = math.nan


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


@dataclass(frozen=True, kw_only=True)
class Roofs:
    """The roofs and peaks of a configuration in flop per core cycle, and its shares of them."""

    fma_roof: float
    fma_peak: float
    avx2_fma_roof: float
    avx2_fma_peak: float
    share_of_fma_roof: float
    share_of_fma_peak: float
    share_of_avx2_roof: float
    share_of_avx2_peak: float
    mix_roof: float
    share_of_mix_roof: float
    mix_bound: str | None
    unpriced_share: float
    L1_roof: float
    L2_roof: float
    L3_roof: float
    memory_roof: float
    least_bound: str | None
    least_roof: float
    share_of_least_roof: float


def below(
    speed: float,
    intensity: float,
    precision: str,
    bits: int,
    operations: Mapping[tuple[str, str, int], int] | None,
    limits: Ceilings | None,
    cpu: Any,
) -> Roofs:
    """`speed`: flop per core cycle; `operations`: what was counted, lane by lane, or None."""
    roof, wide = (limits.flops("fma", precision, of) if limits else nan for of in (bits, PEAK_BITS))
    peak, wide_peak = (peaks.peak(cpu, "fma", precision, of) for of in (bits, PEAK_BITS))
    own = mix(operations, limits) if limits and operations is not None else Mix(0, {}, nan)
    bound = own.bound if own.roof > 0 else None
    levels = {name: intensity * (limits.bandwidth_by(name, bits) if limits else nan) for name in LEVELS}
    least = {name: of for name, of in ((bound, own.roof), (NEAREST, levels[NEAREST])) if of > 0}
    least_bound = min(least, key=least.__getitem__, default=None)
    least_roof = least.get(least_bound, nan)
    return Roofs(
        fma_roof=roof,
        fma_peak=peak,
        avx2_fma_roof=wide,
        avx2_fma_peak=wide_peak,
        share_of_fma_roof=speed / roof,
        share_of_fma_peak=speed / peak,
        share_of_avx2_roof=speed / wide,
        share_of_avx2_peak=speed / wide_peak,
        mix_roof=own.roof,
        share_of_mix_roof=speed / own.roof,
        mix_bound=bound,
        unpriced_share=own.unpriced,
        **{f"{name}_roof": of for name, of in levels.items()},
        least_bound=least_bound,
        least_roof=least_roof,
        share_of_least_roof=speed / least_roof,
    )


@dataclass(frozen=True, kw_only=True)
class Clocks:
    """The clock under vector load over the one that core cycles are of, and shares by it; NaN where no load
    was tried (scalar code). `load_clock_ceilings`: by the clock that ceilings.json has for that load.
    """

    load_clock: float
    load_clock_least: float
    load_clock_ceilings: float
    share_of_fma_roof_load: float
    share_of_least_roof_load: float


def under_load(speed: float, bits: int, roofs: Roofs, cell: Cell, limits: Ceilings | None) -> Clocks:
    clock = cell.values.core_cycles / cell.values.ns * 1e9
    loads = cell.values.core_hz_load if "core_hz_load" in cell.values else 0 * clock
    ratio = (loads / clock)[loads > 0]
    median, least = (ratio.median(), ratio.min()) if len(ratio) else (nan, nan)
    there = ((limits.core_hz_load or {}).get(str(bits)) if limits else None) or nan
    return Clocks(
        load_clock=median,
        load_clock_least=least,
        load_clock_ceilings=there / clock.median() if len(ratio) else nan,
        share_of_fma_roof_load=speed / median / roofs.fma_roof,
        share_of_least_roof_load=speed / median / roofs.least_roof,
    )


def clocks(points: Iterable[Any]) -> list[str]:
    """How much the clock under vector load was below the one that cycles of points (study.bounds.roof) are
    counted by, per width."""
    loaded = [one for one in points if one.load_clock > 0]
    said: list[str] = []
    for bits in sorted({one.bits for one in loaded}):
        mine = [one for one in loaded if one.bits == bits]
        median = statistics.median(one.load_clock for one in mine)
        frames = f"before the frames {median:.3f} of it, by the median of these rows"
        frames += f" (least {min(one.load_clock_least for one in mine):.3f})"
        lower = min((one.load_clock_ceilings for one in mine if one.load_clock_ceilings > 0), default=nan)
        if lower > 0 and abs(lower - 1) > ceilings.CLOCK:
            frames += f"; {lower:.3f} while the ceilings were measured, by which shares would be up to "
            frames += f"{1 / lower:.3f} times those given" if lower < 1 else "no higher"
        said.append(f"Core cycles are of scalar code's clock. Under a load of {bits} bits it was {frames}.")
    return said
