"""The ladder as rows: one per configuration, each speed with its interval, its bases and its error."""

import math
import re
from dataclasses import asdict
from typing import Any

import numpy as np
import pandas as pd

from study.core.registry import BASE as BASE
from study.core.registry import phases
from study.numbers import accuracy, beside, paper, stats
from study.numbers.analysis import Cell, Data, described, flat, second_base
from study.numbers.stats import Interval

ERRORS = ["identical", "non_finite", "psnr_db", "psnr_display_db", "rmse", "fraction_over_1_255"]
ERRORS += ["fraction_over_1_255_display", "mask_mismatch_ppm", "id_mismatch_ppm", "dt_p99", "dt_max"]
ERRORS += ["depth_agree_fraction", "flip_mean", "antialiased_psnr_db", "antialiased_fraction_over_1_255"]
ERRORS += ["failed"]


def error_of(data: Data, cell: Cell) -> dict[str, Any]:
    """The pair of verify.json that judges the cell's phase against baseline: same size, else the largest.
    `within_tolerance`: None where nothing was verified, or `left_to` names the script that judges it."""
    subject, size = (cell.spec, BASE, cell.scene), (cell.width, cell.height)
    pairs = [one for one in data.pairs if (one.phase, one.reference, one.scene) == subject]
    pair = max(pairs, key=lambda one: ((one.width, one.height) == size, one.height), default=None)
    row = flat(pair) if pair else {}
    left = pair.left_to if pair and pair.within_tolerance is None else None
    return {
        **{name: row.get(name) for name in ERRORS},
        "error_width": pair.width if pair else None,
        "error_height": pair.height if pair else None,
        "within_tolerance": None if not pair or left else bool(pair.within_tolerance),
        "left_to": left,
        "is_reference": cell.spec == BASE,
    }


TRUTH = ["scene", "phase", "psnr_db", "psnr_ideal_db", "psnr_none_db", "dt_p99", "wrong_ppm"]
TRUTH += ["draws_ideal", "own_db", "surface_db", "converged_only", "height"]


def truth_errors(data: Data) -> pd.DataFrame:
    """What accuracy.json has of each (scene, phase), columns truth_…; PSNR of a fractal is the averaged one.
    `truth_own_db`: to the picture that the phase draws: with the ideal shadow, if `truth_draws_ideal`; of a
    Mandelbulb to its exact surface (`truth_surface_db`), or to a march where the run lacks that.
    """
    made = []
    for row in accuracy.rows(data.path):
        known, colours = phases().get(re.split("[@+]", row.phase)[0]), row.colours
        ideal = known is not None and known.draws_ideal
        levels = colours.psnr_db, colours.psnr_ideal_db, colours.psnr_none_db
        own = row.shown.psnr_ideal_db if ideal else row.shown.psnr_db
        about = ideal, own, own if row.surface else np.nan, row.converged_only, row.height
        made.append((row.scene, row.phase, *levels, row.dt_p99, row.wrong_ppm, *about))
    return pd.DataFrame(made, columns=[*TRUTH[:2], *(f"truth_{name}" for name in TRUTH[2:])])


def _spread(name: str, interval: Interval | None, scale: float = 1) -> dict[str, float]:
    """Value and interval as three columns in a unit of `scale`; no interval: NaN ends."""
    ends = (interval or stats.UNKNOWN).ends
    return {f"{name}{end}": value / scale for end, value in zip(("", "_low", "_high"), ends, strict=True)}


def _over_paper(data: Data, cell: Cell, base: Cell | None) -> Interval | None:
    """Speed-up over the paper's own baseline: over ours, times theirs over ours where both ran in turn."""
    if "papers" not in data.kept:
        data.kept.update(papers=[row for row in beside.originals(data.path) if row.phase == BASE])
    for row in data.kept.get("papers", []):
        both = row.ours_launches_ms, row.theirs_launches_ms
        if base and all(both) and (row.scene, row.n) == (cell.scene, cell.height):
            return stats.change_interval(both, (base.values.ns, cell.values.ns))
    return None


def _row(data: Data, cell: Cell, headline: bool) -> dict[str, Any]:
    base = data.cell(cell.scene, BASE, cell.height, cell.width)
    same = second_base(cell, data.cells, described(data.plan))
    one = data.cell(cell.scene, cell.spec, cell.height, cell.width) if cell.threads > 1 else None
    ns, values = cell.median("ns"), cell.values
    return {
        "scene": cell.scene,
        "width": cell.width,
        "height": cell.height,
        "headline": headline,
        "phase": cell.spec,
        "threads": cell.threads,
        **asdict(cell.facts),
        "launches": ns.launches,
        "frames_a_launch": int(values.frames.median()),
        "interval": "95 %" if ns.sufficient else "insufficient",
        **_spread("ms", ns, 1e6),
        "ms_least": values.ns.min() / 1e6,
        **_spread("ns_per_pixel", ns, cell.pixels),
        "tsc_cycles": cell.median("tsc_cycles").value,
        **_spread("core_cycles_per_pixel", cell.median("core_cycles"), cell.pixels),
        **_spread("joules", cell.median("joules") if "joules" in values else None),
        "tsc_hz": cell.median("tsc_hz").value,
        "core_hz": cell.median("core_hz").value,
        "core_hz_load": cell.median("core_hz_load").value if "core_hz_load" in values else math.nan,
        "speedup_base": base.spec if base else None,
        **_spread("speedup", base and cell.over(base)),
        **_spread("over_paper", _over_paper(data, cell, base)),
        **_spread("over_one_thread", one and cell.over(one)),
        "same_flags_base": same.spec if same else None,
        **_spread("speedup_same_flags", same and cell.over(same)),
        "setup_ms": cell.median("prepare_ns").value / 1e6,
        # The launch that compiled longest. 0: the kernel was found; NaN: nothing is generated.
        "compile_ms": values.kernel_compile_ns.max() / 1e6 if "kernel_compile_ns" in values else math.nan,
        **_spread("setup_first_ms", cell.median("setup_first_ns"), 1e6),
        "present_ms": cell.median("present_ns").value / 1e6,
        "frames_per_s": 1e9 / cell.median("presented_ns").value,
        **error_of(data, cell),
    }


def headline_size(data: Data, scene: str, height: int | None = None) -> tuple[int, int] | None:
    """Width and height of a scene's ladder: of the given height, else of all, the size with the most phases
    of enough launches, then with the most phases, then with the most pixels."""
    cells = [c for c in data.cells if c.scene == scene and height in (None, c.height)]

    def worth(size: tuple[int, int]) -> tuple[int, int, int]:
        here = [c for c in cells if (c.width, c.height) == size]
        return sum(len(c.values) >= stats.FEWEST for c in here), len(here), size[0] * size[1]

    return max({(c.width, c.height) for c in cells}, key=worth, default=None)


def rows(data: Data, height: int | None = None) -> pd.DataFrame:
    """One row per configuration, ordered by scene, size and phase. Units are in the names of the columns.
    `headline` marks each scene's ladder; `implied`, `stated` and `rerun` are of paper.ladder."""
    height = data.height if height is None else height
    if (name := f"ladder at {height}") in data.kept:
        return data.kept[name]
    cells = [] if data.plan.programs else data.cells  # those have a chapter of their own
    sizes = {scene: headline_size(data, scene, height) for scene in {c.scene for c in cells}}
    made = pd.DataFrame(_row(data, c, sizes[c.scene] == (c.width, c.height)) for c in cells)
    if not made.empty:
        theirs = paper.ladder().rename(columns={"cycles_per_pixel": "paper_cycles_per_pixel"})
        made = made.merge(theirs, how="left", on=["scene", "phase"])
        made = made.merge(truth_errors(data), how="left", on=["scene", "phase"])
        made.loc[made.threads > 1, [c for c in theirs if c not in ("scene", "phase")]] = np.nan
    return data.kept.setdefault(name, made)


def ladders(table: pd.DataFrame) -> dict[str, pd.DataFrame]:
    if table.empty:
        return {}
    return {scene: group for scene, group in table[table.headline].groupby("scene", sort=False)}
