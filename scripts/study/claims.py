"""The papers' statements (results/paper/claims.csv) held against a run. Another machine may say otherwise.

Here those that a sweep checks; the others are study.register's.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pandas as pd

from study import ladder, paper, register, show
from study.analysis import Cell, Data
from study.stats import Interval
from study.verdicts import FAILS, FEW, HOLDS, OPEN, UNSURE, WITHIN

WORDS = ("text", "quote", "source", "scene", "note", "command")
EVEN = 1.10  # what counts as the same time: a clock or a page can be worth several percent
Claim = dict[str, Any]
Found = tuple[str, str]  # what was found here, verdict


def check(data: Data, rows: pd.DataFrame) -> list[dict[str, str]]:
    """One object per claim: text, quote, source, scene, note, command, elsewhere, here, verdict."""
    theirs = paper.ladder().set_index(["scene", "phase"])
    made = []
    for claim in paper.read("claims").astype(object).to_dict("records"):
        check, words = claim["quantity"], {key: "" if pd.isna(claim[key]) else claim[key] for key in WORDS}
        if check in CHECKS:
            here, verdict = CHECKS[check](data, rows, claim)
        else:
            here, verdict = register.CHECKS[check](data, claim)
        made.append({**words, "elsewhere": _elsewhere(theirs, claim), "here": here, "verdict": verdict})
    return made


def _elsewhere(theirs: pd.DataFrame, claim: Claim) -> str:
    """What the paper's tables imply and what its authors' program does, run again."""
    scene, phase, base = claim["scene"], claim["phase"], claim["base"]
    if claim["quantity"] == "speedup":
        implied, rerun = (
            theirs[name][scene, phase] / theirs[name][scene, base] for name in ("implied", "rerun")
        )
        return f"by its tables {implied:.3g}×; its program, run again: {rerun:.3g}×"
    if claim["quantity"] == "scene_ratio":
        names = ("cycles_per_pixel", "rerun_tsc_cycles_per_pixel")
        implied, rerun = (theirs[name][scene, phase] / theirs[name][base, phase] for name in names)
        return f"by its tables {implied:.2f}×; its program, run again: {rerun:.2f}×"
    if claim["quantity"] == "exact":
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
    scene, phase, base = claim["scene"], claim["phase"], claim["base"]
    shown = ladder.ladders(rows).get(scene, pd.DataFrame(columns=["height", "width"]))
    sizes = set(zip(shown["height"], shown["width"], strict=True))
    if not sizes & set(_sizes(data, (scene, phase), (scene, base))):
        return "", OPEN
    size = sizes.pop()
    ratio = _at(data, scene, phase, size).over(_at(data, scene, base, size))
    text = f"{phase} over {base}: {_times(ratio)}"
    if not ratio.sufficient:
        return text, FEW
    value = claim["value"]
    return text, HOLDS if ratio.low >= value else WITHIN if ratio.high >= value else FAILS


def _scene_ratio(data: Data, rows: pd.DataFrame, claim: Claim) -> Found:
    scene, phase, base = claim["scene"], claim["phase"], claim["base"]
    sizes = _sizes(data, (scene, phase), (base, phase))
    if not sizes:
        return "", OPEN
    ratio = _at(data, base, phase, sizes[-1]).over(_at(data, scene, phase, sizes[-1]))
    # of times: those of `scene` over those of the scene `base`
    text, value = f"{_times(ratio)} its time, at n = {sizes[-1][0]}", claim["value"]
    if not ratio.sufficient:
        return text, FEW
    if 1 / EVEN <= ratio.value / value <= EVEN:
        return text, HOLDS
    return text, WITHIN if ratio.low <= value <= ratio.high else FAILS


def _constant(data: Data, rows: pd.DataFrame, claim: Claim) -> Found:
    sizes = _sizes(data, (claim["scene"], claim["phase"]))
    if len(sizes) < 2:
        return "one size only", OPEN
    cells = [_at(data, claim["scene"], claim["phase"], size) for size in sizes]
    pace = [cell.median("ns").value / cell.pixels for cell in cells]
    span = f"n = {sizes[0][0]} … {sizes[-1][0]}"
    text = f"ns/pixel varies by {100 * (max(pace) / min(pace) - 1):.1f} % over {span}"
    return text, HOLDS if max(pace) / min(pace) <= EVEN else FAILS


def _grows(data: Data, rows: pd.DataFrame, claim: Claim) -> Found:
    scene, phase, base = claim["scene"], claim["phase"], claim["base"]
    sizes = _sizes(data, (scene, phase), (scene, base))
    if len(sizes) < 2:
        return "one size only", OPEN
    small, large = (_at(data, scene, phase, s).over(_at(data, scene, base, s)) for s in (sizes[0], sizes[-1]))
    text = f"{_times(small)} at n = {sizes[0][0]}, {_times(large)} at n = {sizes[-1][0]}"
    if not (small.sufficient and large.sufficient):
        return text, FEW
    return text, HOLDS if large.low > small.high else FAILS if large.high < small.low else UNSURE


def _exact(data: Data, rows: pd.DataFrame, claim: Claim) -> Found:
    shown = ladder.ladders(rows).get(claim["scene"])
    row = {} if shown is None else next(iter(shown[shown["phase"] == claim["phase"]].to_dict("records")), {})
    over = row.get("fraction_over_1_255_display")
    if over is None or pd.isna(over):
        return "", OPEN
    psnr = show.psnr(row, "psnr_display_db")
    psnr = psnr if psnr == "identical" else f"{psnr} dB"
    return (
        f"{psnr}, {show.percent(over)} of the pixels off by more than 1/255 (display)",
        HOLDS if over == 0 else FAILS,
    )


CHECKS: dict[str, Callable[[Data, pd.DataFrame, Claim], Found]] = {
    "speedup": _speedup,
    "scene_ratio": _scene_ratio,
    "constant": _constant,
    "grows": _grows,
    "exact": _exact,
}
