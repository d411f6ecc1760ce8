"""The claims register of what other articles built: CPU-RTRM, integers, packets, rods. As claims.register."""

from __future__ import annotations

import math
import statistics
from typing import Any

from study.claims.compilers import known
from study.core import show
from study.experiments.fixed import measure as fixed
from study.experiments.lattice import measure as lattice
from study.experiments.moving import measure as moving
from study.experiments.packets import measure as packets
from study.experiments.rods import measure as rods
from study.numbers import stats
from study.numbers.analysis import Data
from study.numbers.stats import Interval
from study.numbers.verdicts import (
    FAILS,
    NEAR,
    NEVER,
    PART,
    Found,
    figure,
    judged,
    missing,
    reached,
    sized,
    timed,
)

Claim = dict[str, Any]


def rtrm(data: Data, claim: Claim) -> Found:
    """Beside figures of another machine: that decides nothing. The figure is of the claim's phase; without
    a time of it the fastest one's stands in the words alone."""
    result = lattice.read(data.path / lattice.FILE)
    named = [r for r in result["rows"] if (r["phase"], r["threads"]) == (claim["phase"], 2) and r["program"]]
    fastest = lattice.best(result, 2)
    if fastest is None:
        return missing("time of scene lattice on two threads")
    other = f"{fastest['phase']} {fastest['program']:.2f}×"
    if not named:
        text = f"{other} its figure of another machine; no time of {claim['phase']} on two threads"
        return Found(text, NEVER, claim["note"], n=fastest["n"])
    one, ends = named[0], (named[0]["program_low"], named[0]["program_high"])
    low, high = (end if known(end) else math.nan for end in ends)
    text = f"{one['program']:.2f}× its figure of another machine; {other}"
    return Found(text, NEVER, claim["note"], one["program"], low, high, one["n"])


def integers(data: Data, claim: Claim) -> Found:
    """Beside figures of 35 cores of another CPU: that decides nothing. Fewer frames than the article's are
    another stretch of the animation, whose frames drift: no ratio then."""
    result = fixed.read(data.path / fixed.FILE)
    mine = [r for r in result.get("animation", []) if (r["phase"], r["n"]) == (claim["phase"], claim["n"])]
    mine = [r for r in mine if r.get("shadows", True)]
    if not mine:
        return missing(f"frames of {claim['scene']} at n = {claim['n']:.0f}")
    said = result["article"]
    one = max(mine, key=lambda row: (row.get("frames") == said["frames"], row["threads"]))
    cores = f"{one['threads']} thread{'s' * (one['threads'] > 1)}"
    beside = moving.per_article(one, said)
    if beside == show.NOTHING:
        beside = f"{one.get('frames', '?')} frames of {one.get('width', '?')}×{one['n']}, no ratio"
    mean = one["ms"].get("mean", one["ms"]["p50"])  # the article's is one; older files have none
    text = f"{mean:.1f} ms on {cores}: {beside}"
    text += f" (5 to 95 % of its frames: {one['ms']['p5']:.1f} to {one['ms']['p95']:.1f} ms)"
    return Found(text, NEVER, claim["note"], mean, n=one["n"])  # of one process: no interval


def linear(data: Data, claim: Claim) -> Found:
    """The gain of the most threads over one, per thread, of the longest frame: waking is no work."""
    made: list[tuple[float, Interval, str, int]] = []
    for drawn in packets.read(data.path / packets.FILE)["drawn"]:
        by = {t["threads"]: t for r in drawn["rows"] if r["phase"] == claim["phase"] for t in r["threads"]}
        if len(by) > 1 and 1 in by:
            most = max(by)
            gain = stats.ratio_interval(by[1]["launches"], by[most]["launches"])
            share = Interval(
                gain.value / most, gain.low / most, gain.high / most, gain.launches, gain.sufficient
            )
            longest = statistics.median(by[1]["launches"])
            what = f"{drawn['scene']} at n = {drawn['n']} ({longest:.2g} ms)"
            text = f"{gain.value:.2f}× on {most} threads, {what}"
            made.append((longest, share, text, drawn["n"]))
    if not made:
        return missing(f"time of {claim['phase']} on several threads")
    _, share, text, n = max(made, key=lambda one: one[0])
    verdict, why = reached(share, claim["value"] / NEAR)
    if verdict == FAILS and share.low > 0.5 * claim["value"]:
        verdict, why = PART, f"more than half of linear; {why}"
    return figure(share, text, verdict, why, n)


def rods_fewer(data: Data, claim: Claim) -> Found:
    own = rods.read(data.path / rods.FILE).get("own")
    if not own:
        return missing(rods.FILE)
    counts = [own[name]["evaluations"] for name in ("pixels", "rods")]
    text = f"{counts[0]:.3g} evaluations a pixel against {counts[1]:.3g}: {own['fewer']:.3g}×"
    verdict, why = judged(own["fewer"], claim["value"])
    return sized(Found(text, verdict, why, own["fewer"], n=own["n"]), claim["n"])


def rods_gain(data: Data, claim: Claim) -> Found:
    own = rods.read(data.path / rods.FILE).get("own")
    if not own:
        return missing(rods.FILE)
    times = [own[name]["ms"] for name in ("pixels", "rods")]
    ends = [end if known(end) else math.nan for end in (own["gain_low"], own["gain_high"])]
    text = f"{own['gain']:.2f}×: {times[0]:.3g} ms per pixel, {times[1]:.3g} ms by rods"
    verdict, why = judged(own["gain"], claim["value"])
    return sized(timed(Found(text, verdict, why, own["gain"], *ends, own["n"])), claim["n"])
