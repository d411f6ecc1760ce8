"""Columns of the roofline: shares of roofs (Tables 5 and 6), points."""

import math

from study.bounds.roof import Point
from study.bounds.roof_shares import NEAREST
from study.core import show
from study.core.show import Column, interval, number, percent, plain, whole, word

FOREIGN = ", not of what was timed"


def counted_by(point: Point) -> str:
    """The back end, with what speaks against trusting it."""
    states = {True: "", False: " (not calibrated here)", None: " (not yet validated)"}
    declared = point.backend == "declared"
    state = "" if declared else states[point.calibrated]
    other = f", scaled from n = {point.scaled_from_n}" if point.scaled_from_n else ""
    libm = "" if point.libm_counted or declared else ", without libm's inside"
    return f"{point.backend}{state}{other}{libm}{FOREIGN if point.foreign_counts else ''}"


def doubtful(point: Point, name: str) -> str:
    """Why a share of a roof is not to be believed, in a few words, or nothing."""
    above = getattr(point, name) > 1
    if name.startswith("share_of_least_roof") and point.least_bound == NEAREST:
        return "by wider accesses than its own" if above else ""
    return "above its roof" if above else ""


def _share(group: str, title: str, name: str) -> Column:
    def text(point: Point) -> str:
        value = getattr(point, name)
        why = doubtful(point, name) if value > 0 else ""
        return percent(value) + (f" ({why}!)" if why else "")

    return Column(group, title, text, lambda point: "bad" if doubtful(point, name) else "")


def _paper_percent(point: Point) -> str:
    return show.NOTHING if math.isnan(point.paper_share) else f"{100 * point.paper_share:.4g}\u00a0%"


def _bound(point: Point) -> str:
    unpriced = point.unpriced_share
    more = f" ({percent(unpriced)} of the FLOPs have no ceiling)" if unpriced > 0 else ""
    return word("mix_bound")(point) + more


PERFORMANCE = [
    Column("", "scene", word("scene")),
    Column("", "phase", word("phase")),
    Column("", "n", whole("height")),
    Column(
        "machine's convention", "flop/core cycle [95\u00a0%]", lambda r: interval(r, "flops_per_core_cycle")
    ),
    Column("machine's convention", "flop/timer cycle", plain("flops_per_tsc_cycle", 4)),
    _share("machine's convention", "share of AVX2 peak", "share_of_avx2_peak"),
    _share("machine's convention", "of the measured AVX2 roof", "share_of_avx2_roof"),
    Column("paper's rule", "flop/core cycle", plain("paper_rule_flops_per_core_cycle", 4)),
    Column("paper's rule", "flop/timer cycle", plain("paper_rule_flops_per_tsc_cycle", 4)),
    _share("paper's rule", "share of AVX2 peak", "paper_rule_share_of_avx2_peak"),
    _share("paper's rule", "of the measured AVX2 roof", "paper_rule_share_of_avx2_roof"),
    Column("the paper, i7-7700", "flop/cycle", plain("paper_flops_per_cycle", 4)),
    Column("the paper, i7-7700", "share of AVX2 peak", _paper_percent),
    Column("", "counted by", counted_by),
]
_LEAST_LOAD = "share_of_least_roof_load"
POINTS = [
    Column("", "scene", word("scene")),
    Column("", "phase", word("phase")),
    Column("", "n", whole("height")),
    Column("", "flop/core cycle [95\u00a0%]", lambda r: interval(r, "flops_per_core_cycle")),
    Column("", "bytes/pixel", lambda r: number(r.bytes / r.pixels, 4)),
    Column("", "flop/byte", plain("intensity")),
    Column("FMA roof", "own width, bits", whole("bits")),
    Column("FMA roof", "flop/core cycle", plain("fma_roof")),
    _share("FMA roof", "share of it", "share_of_fma_roof"),
    _share("FMA roof", "by the clock under vector load", "share_of_fma_roof_load"),
    _share("FMA roof", "share of AVX2's", "share_of_avx2_roof"),
    Column("FMA peak by the ports", "flop/core cycle", plain("fma_peak")),
    _share("FMA peak by the ports", "share of it", "share_of_fma_peak"),
    Column("roof of its own operations", "flop/core cycle", plain("mix_roof")),
    _share("roof of its own operations", "share of it", "share_of_mix_roof"),
    Column("roof of its own operations", "set by", _bound),
    Column("bandwidth roof by its own width, flop/core cycle", "L1", plain("L1_roof")),
    Column("bandwidth roof by its own width, flop/core cycle", "L2", plain("L2_roof")),
    Column("the lower of its operations' and L1's", "flop/core cycle", plain("least_roof")),
    _share("the lower of its operations' and L1's", "share of it", "share_of_least_roof"),
    _share("the lower of its operations' and L1's", "by the clock under vector load", _LEAST_LOAD),
    Column("the lower of its operations' and L1's", "set by", word("least_bound")),
    Column("", "counted by", counted_by),
]
