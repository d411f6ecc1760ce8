"""The papers' statements (results/paper/claims.csv) held against a run. Another machine may say otherwise.

Here those that a sweep checks; the others are study.claims.register's.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import pandas as pd

from study.claims import register
from study.claims.claim import Claim, read
from study.core import show
from study.core.show import Column, whole, word
from study.numbers import ladder, paper, stats, verdicts
from study.numbers.analysis import Cell, Data
from study.numbers.stats import Interval
from study.numbers.verdicts import FAILS, HOLDS, NEVER, UNSURE, Found, figure, judged, missing, sized

ABOUT = ("text", "quote", "source", "line", "scene", "command", "note", "unit")
EVEN = 1.10  # what counts as the same time: a clock or a page can be worth several percent
LEAST = 100  # the papers' smallest picture height
NO_CELLS = "such frames"


@dataclass(frozen=True)
class Checked:
    """A claim (what it states: `stated` in `unit`, up to `stated_n`; `elsewhere`: what the paper's tables and
    program have), and what came out here: `here` in words; `value`, `low` and `high` in that unit; `n`."""

    text: str
    quote: str
    source: str
    line: int
    scene: str
    command: str
    note: str
    unit: str
    stated: float
    stated_n: float
    elsewhere: str
    here: str
    verdict: str
    why: str
    value: float
    low: float
    high: float
    n: int | None


def check(data: Data, rows: pd.DataFrame) -> list[Checked]:
    theirs = paper.ladder().set_index(["scene", "phase"])
    made = []
    for claim in read():
        what = claim.quantity
        found = CHECKS[what](data, rows, claim) if what in CHECKS else register.CHECKS[what](data, claim)
        if found.verdict == NEVER and not found.why:
            found = found._replace(why=claim.note)
        about = {name: getattr(claim, name) for name in ABOUT}
        about |= {"stated": claim.value, "stated_n": claim.n, "elsewhere": _elsewhere(theirs, claim)}
        made.append(Checked(**about, **found._asdict()))
    return made


def _figure(row: Checked) -> str:
    if math.isnan(row.value):
        return show.NOTHING
    ends = "" if math.isnan(row.low) else f" [{show.number(row.low)}, {show.number(row.high)}]"
    return f"{show.number(row.value)}{ends}"


def mark(row: Checked) -> str:
    return {HOLDS: "good", FAILS: "bad"}.get(row.verdict, "")


def _verdict(row: Checked) -> str:
    return {"good": "✓ ", "bad": "✗ "}.get(mark(row), "") + row.verdict


COLUMNS = [
    Column("the claim", "paper", word("text")),
    Column("the claim", "in its words", lambda r: f"“{r.quote}”"),
    Column("the claim", "source", word("source")),
    Column("the claim", "line", whole("line")),
    Column("the claim", "scene", word("scene")),
    Column("the claim", "stated", lambda r: show.NOTHING if math.isnan(r.stated) else f"{r.stated:g}"),
    Column("the claim", "unit", word("unit")),
    Column("", "to test it", lambda r: f"`{r.command}`" if r.command else show.NOTHING),
    Column("what came out here", "in that unit [95\u00a0%]", _figure),
    Column("what came out here", "in words", lambda r: r.here or show.NOTHING),
    Column("", "verdict", _verdict, mark),
    Column("", "why", lambda r: r.why or show.NOTHING),
]


def _elsewhere(theirs: pd.DataFrame, claim: Claim) -> str:
    """What the paper's tables imply and what its authors' program does, run again."""
    scene, phase, base = claim.scene, claim.phase, claim.base
    if claim.quantity == "speedup":
        implied, rerun = (
            theirs[name][scene, phase] / theirs[name][scene, base] for name in ("implied", "rerun")
        )
        return f"by its tables {implied:.3g}×; its program, run again: {rerun:.3g}×"
    if claim.quantity == "scene_ratio":
        names = ("cycles_per_pixel", "rerun_tsc_cycles_per_pixel")
        implied, rerun = (theirs[name][scene, phase] / theirs[name][base, phase] for name in names)
        return f"by its tables {implied:.2f}×; its program, run again: {rerun:.2f}×"
    if claim.quantity == "exact":
        row = theirs.loc[(scene, phase)]
        return (
            f"its program, run again: {row['rerun_psnr_display_db']:g} dB, "
            f"{show.percent(row['rerun_over_display'])} of the pixels off by more than 1/255 (display)"
        )
    return ""


def _sizes(data: Data, *wanted: tuple[str, str]) -> list[tuple[int, int]]:
    """Sizes at which every (scene, spec) was measured on one thread, smallest first."""
    sets = [
        {(c.height, c.width) for c in data.cells if (c.scene, c.spec, c.threads) == (scene, spec, 1)}
        for scene, spec in wanted
    ]
    return sorted(set.intersection(*sets))


def _at(data: Data, scene: str, spec: str, size: tuple[int, int]) -> Cell:
    cell = data.cell(scene, spec, *size)
    assert cell is not None  # _sizes found it
    return cell


def _times(ratio: Interval) -> str:
    return ratio.text().replace(" ", "× ", 1)


def _speedup(data: Data, rows: pd.DataFrame, claim: Claim) -> Found:
    """Speed-up by time, at the size of the ladder: with lanes a small n gains less, as the paper says."""
    scene, phase, base = claim.scene, claim.phase, claim.base
    shown = ladder.ladders(rows).get(scene, pd.DataFrame(columns=["height", "width"]))
    sizes = set(zip(shown["height"], shown["width"], strict=True))
    if not sizes & set(_sizes(data, (scene, phase), (scene, base))):
        return missing(NO_CELLS)
    size = sizes.pop()
    cell = _at(data, scene, phase, size)
    ratio = cell.over(_at(data, scene, base, size))
    verdict, why = verdicts.reached(ratio, claim.value)
    if verdict == FAILS and int(cell.facts.lanes or 1) > 1 and size[0] < claim.n:
        verdict, why = UNSURE, f"{why}, and a smaller n gains less"
    text = f"{phase} over {base}: {_times(ratio)}"
    return sized(figure(ratio, text, verdict, why, size[0]), claim.n)


def _scene_ratio(data: Data, rows: pd.DataFrame, claim: Claim) -> Found:
    """Times of `scene` over those of the scene `base`."""
    scene, phase, base = claim.scene, claim.phase, claim.base
    sizes = _sizes(data, (scene, phase), (base, phase))
    if not sizes:
        return missing(NO_CELLS)
    ratio = _at(data, base, phase, sizes[-1]).over(_at(data, scene, phase, sizes[-1]))
    text, value = f"{_times(ratio)} its time, at n = {sizes[-1][0]}", claim.value
    verdict, why = verdicts.near(ratio.value, value)
    if verdict == FAILS and ratio.low <= value <= ratio.high:
        verdict, why = UNSURE, f"{value:g} is within the interval"
    return sized(figure(ratio, text, verdict, why, sizes[-1][0]), claim.n)


def _constant(data: Data, rows: pd.DataFrame, claim: Claim) -> Found:
    """The constant over the sizes of the paper's range where the run has two of them, else over all."""
    sizes = _sizes(data, (claim.scene, claim.phase))
    if len(sizes) < 2:
        return missing(f"second size of {claim.phase} on {claim.scene}")
    inside = [size for size in sizes if size[0] >= LEAST]
    used = inside if len(inside) > 1 else sizes
    cells = [_at(data, claim.scene, claim.phase, size) for size in used]
    cells.sort(key=lambda cell: cell.median("ns").value / cell.pixels)
    ratio = stats.ratio_interval(*(cell.values.ns / cell.pixels for cell in (cells[-1], cells[0])))
    if ratio.value <= EVEN:
        verdict, why = HOLDS, "within 10 %"
    elif ratio.low > EVEN and used is inside:
        verdict, why = FAILS, "all of the interval is above 10 %"
    else:
        verdict, why = UNSURE, "above 10 %, " + ("10 % is within the interval" if inside is used else "")
        why += "" if inside is used else f"fewer than two sizes from n = {LEAST} on"
    span = f"n = {used[0][0]} … {used[-1][0]}"
    text = f"ns/pixel varies by {100 * (ratio.value - 1):.1f} % over {span}"
    return sized(figure(ratio, text, verdict, why, used[-1][0]), claim.n, f"over {span}")


def _grows(data: Data, rows: pd.DataFrame, claim: Claim) -> Found:
    scene, phase, base = claim.scene, claim.phase, claim.base
    sizes = _sizes(data, (scene, phase), (scene, base))
    if len(sizes) < 2:
        return missing(f"second size of {phase} and {base} on {scene}")
    ends = [_at(data, scene, phase, s).over(_at(data, scene, base, s)) for s in (sizes[0], sizes[-1])]
    small, large = ends
    text = f"{_times(small)} at n = {sizes[0][0]}, {_times(large)} at n = {sizes[-1][0]}"
    if large.low > small.high:
        verdict, why = HOLDS, "the intervals are apart"
    elif large.high < small.low:
        verdict, why = FAILS, "the other way round"
    else:
        verdict, why = UNSURE, "the intervals overlap"
    if verdict == FAILS and not sizes[-1][0] >= claim.n:
        verdict, why = UNSURE, f"{why} between these two"
    worse = min(ends, key=lambda one: one.launches)
    found = figure(worse, text, verdict, why, sizes[-1][0])._replace(
        value=large.value / small.value, low=math.nan, high=math.nan
    )
    return sized(found, claim.n, f"over n = {sizes[0][0]} … {sizes[-1][0]}")


def _exact(data: Data, rows: pd.DataFrame, claim: Claim) -> Found:
    shown = ladder.ladders(rows).get(claim.scene)
    rows_of = [] if shown is None else shown[shown["phase"] == claim.phase].to_dict("records")
    row: dict = next(iter(rows_of), {})
    over = row.get("fraction_over_1_255_display")
    if over is None or pd.isna(over):
        return missing(f"verification of {claim.phase} on {claim.scene}")
    psnr = show.psnr(row, "psnr_display_db")
    psnr = psnr if psnr == "identical" else f"{psnr} dB"
    text = f"{psnr}, {show.percent(over)} of the pixels off by more than 1/255 (display)"
    height = row.get("error_height")
    n = None if height is None or pd.isna(height) else int(height)
    verdict, why = (HOLDS, "none is off") if over == 0 else (FAILS, "one that is off is no exact match")
    return sized(Found(text, verdict, why, 100 * over, n=n), claim.n)


def _threads(data: Data, rows: pd.DataFrame, claim: Claim) -> Found:
    """All threads that were timed, over the previous phase on one, at the largest size that has both."""
    scene, phase, base = claim.scene, claim.phase, claim.base
    cells = [c for c in data.cells if (c.scene, c.spec) == (scene, phase) and c.threads > 1]
    pairs = [(c, data.cell(scene, base, c.height, c.width)) for c in cells]
    pairs = [(cell, before) for cell, before in pairs if before]
    if not pairs:
        return missing(f"frames of {phase} on more than one thread beside {base}")
    cell, before = max(pairs, key=lambda pair: (pair[0].threads, pair[0].pixels))
    ratio, cores = cell.over(before), data.context.cpu.logical_cpus
    there = f"{cores} CPUs" if cores else "an unknown number of CPUs"
    text = f"{cell.threads} threads over {base}: {_times(ratio)} at n = {cell.height}, on {there}"
    alone = data.cell(scene, phase, cell.height, cell.width)
    if alone:
        text += f"; over itself on one thread: {_times(cell.over(alone))}"
    fewest = math.ceil(claim.value)
    if not (cores and min(cores, cell.threads) >= fewest):
        why = f"{cell.threads} threads on {there}, where {claim.value:g}× needs {fewest} cores at least"
        return Found(text, NEVER, f"{why}; {claim.note}", ratio.value, ratio.low, ratio.high, cell.height)
    return sized(figure(ratio, text, *judged(ratio.value, claim.value), cell.height), claim.n)


CHECKS: dict[str, Callable[[Data, pd.DataFrame, Claim], Found]] = {
    check.__name__.lstrip("_"): check
    for check in (_speedup, _scene_ratio, _constant, _grows, _exact, _threads)
}
