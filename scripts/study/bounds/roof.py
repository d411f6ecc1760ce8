"""The roofline: every timed configuration against what its machine can do (Tables 5 and 6, Figure 6).

Cache-aware: bytes are those the core loads and stores, whatever level they are in (A. Ilic, F. Pratas and
L. Sousa, IEEE Computer Architecture Letters 13(1), 2014, after S. Williams, A. Waterman and D. Patterson,
CACM 52(4), 2009).

What the roofs are: study.bounds.roof_shares.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from study.bounds import ceilings
from study.bounds.ceilings import Ceilings
from study.bounds.roof_shares import ELEMENT, SHARES, below, under_load
from study.core import cli, store
from study.core.cli import StudyError
from study.counting import paper_rule, schema
from study.counting.counts import Counts, Measured
from study.counting.flops import LIBM_INSIDE
from study.numbers import paper
from study.numbers.analysis import GENERATED, Cell, Data
from study.numbers.stats import Interval

COUNTS = "counts.json"
# Of two back ends that counted the same picture, the first.
ORDER = ("blocks", "sde", "qemu", "ptrace", "pmu")
SECTION = {"baseline": "table5"}  # of the paper; every other phase is in Table 6

Row = dict[str, Any]


# --- what a run has


@dataclass(frozen=True)
class Counted:
    """counts.json: measurements of back ends, and declared × counted rows."""

    measured: list[Measured]
    declared: list[Row]


def read_counts(folder: Path) -> Counted:
    """Raises StudyError, also where there are none."""
    path = store.stored(folder / COUNTS)
    if not path.exists():
        raise StudyError(f"{path} is missing: no counts; run scripts/stepwise flops --measure --run {folder}")
    data = schema.Counts.read(path)
    return Counted([Measured.from_json(one) for one in data["measured"]], data["declared"])


def read(folder: Path, strict: bool = True) -> tuple[Counted, Ceilings | None, list[str]]:
    """A run's counts and ceilings. Unless strict, a file that is not there is empty and named in the notes.

    Raises StudyError for a broken file, strict or not.
    """
    counted, limits, notes = Counted([], []), None, []
    try:
        counted = read_counts(folder)
    except StudyError as error:
        if strict or store.stored(folder / COUNTS).exists():
            raise
        notes.append(str(error))
    try:
        limits = ceilings.read(folder)
    except StudyError as error:
        if strict or (folder / ceilings.FILE).exists():
            raise
        notes.append(str(error))
    return counted, limits, notes


def foreign(data: Data, limits: Ceilings | None) -> str | None:
    """Why the ceilings are another machine's than the one that the frames were timed on, or None."""
    rate = float(data.frames["tsc_hz"].median()) if len(data.frames) else math.nan
    return limits.foreign(cli.plain(data.context), rate) if limits else None


def remarks(table: pd.DataFrame) -> list[str]:
    """What must stand beside every share of a roof: foreign ceilings, counts of other code, points above."""
    if table.empty:
        return []
    said = [
        f"{text[0].upper()}{text[1:]}. No share of a roof means anything."
        for text in dict.fromkeys(table["foreign_ceilings"].dropna())
    ]
    for text, group in table.dropna(subset="foreign_counts").groupby("foreign_counts", sort=False):
        said.append(
            f"Counts that are not of what was timed ({', '.join(dict.fromkeys(group['phase']))}): {text}."
        )
    above = table[table[[*SHARES]].gt(1).any(axis=1)]
    if len(above):
        names = dict.fromkeys(f"{r['phase']} on {r['scene']}" for r in above.to_dict("records"))
        said.append(
            f"Above a roof, which cannot be ({', '.join(names)}): the ceiling was measured too low, "
            "the time on a faster clock, or the counts are of other code."
        )
    return said


def _spec(phase: str, flags_from: str | None) -> str:
    return phase if flags_from in (None, phase) else f"{phase}@{flags_from}"


def _nearest(found: list[tuple[int, int, Any]], cell: Cell) -> tuple[float, int | None, Any] | None:
    """Of (width, height, counts): those of the cell's size, else of the nearest height: factor of pixels,
    height they are scaled from (None: they are its own), counts.
    """
    if not found:
        return None
    size = (cell.width, cell.height)
    width, height, best = min(
        found, key=lambda one: (one[:2] != size, abs(math.log(one[0] * one[1] / cell.pixels)))
    )
    same = (width, height) == size
    return (1.0, None, best) if same else (cell.pixels / (width * height), height, best)


def _origin(one: Mapping[str, Any], cell: Cell, cpu: str | None) -> str | None:
    """By what else than the timed program's compiler, flags or CPU something was counted; None: no such."""
    timed = {"compiler": cell.facts["compiler"], "flags": cell.facts["flags"], "cpu": cpu}
    other = [
        f"{name} {one[name]} instead of {there}"
        for name, there in timed.items()
        if one.get(name) and there and one[name] != there
    ]
    if one.get("kernel") and cell.facts.get("kernel") == GENERATED:
        other.append("of its general code instead of the kernel generated for the scene")
    return "; ".join(other) or None


def _measured(
    counted: Counted, cell: Cell, scene_hash: str | None, cpu: str | None
) -> tuple[float, int | None, Any] | None:
    fitting = [
        m
        for m in counted.measured
        if (_spec(m.phase, m.flags_from), m.scene, m.variant) == (cell.spec, cell.scene, "shipped")
        and scene_hash in (None, m.scene_hash)
    ]
    best = {}
    order = {name: place for place, name in enumerate(ORDER)}
    for m in sorted(
        fitting,
        key=lambda m: (
            _origin(vars(m), cell, cpu) is not None,
            m.calibrated is not True,
            order.get(m.backend, 9),
        ),
    ):
        best.setdefault((m.width, m.height), m)
    return _nearest([(*size, m) for size, m in best.items()], cell)


def _declared(counted: Counted, cell: Cell, scene_hash: str | None) -> tuple[float, int | None, Any] | None:
    fitting = [
        d
        for d in counted.declared
        if (_spec(d["phase"], d.get("flags_from")), d["scene"]) == (cell.spec, cell.scene)
        and d.get("scene_hash", scene_hash) in (None, scene_hash)
    ]
    return _nearest([(d["width"], d["height"], d) for d in fitting], cell)


def _rate(name: str, flops: float, cycles: Interval) -> Row:
    """FLOPs over cycles with the interval of the cycles."""
    return {
        name: flops / cycles.value if cycles.value > 0 else math.nan,
        f"{name}_low": flops / cycles.high if cycles.high > 0 else math.nan,
        f"{name}_high": flops / cycles.low if cycles.low > 0 else math.nan,
    }


def _whole(measured: Measured) -> Counts:
    """With libm's inside, where the back end sees it: its time is in the cycles."""
    made = Counts()
    made.merge(measured.total)
    for one in (measured.outside or {}).values():
        made.merge(one)
    return made


def own_bits(cell: Cell) -> tuple[str, int]:
    """Precision (double, single) and width of the cell's phase: the element's where it is scalar."""
    precision = "single" if cell.facts["precision"] == "float" else "double"
    lanes = int(cell.facts["lanes"] or 1)
    return precision, min(lanes * ELEMENT[precision], 512)


def _row(
    cell: Cell, counted: Counted, limits: Ceilings | None, scene_hash: str | None, about: Mapping[str, Any]
) -> Row:
    cpu = about.get("model")
    precision, bits = own_bits(cell)
    core, tsc = cell.median("core_cycles"), cell.median("tsc_cycles")
    row: Row = {
        **{"phase": cell.spec, "scene": cell.scene, "n": cell.height, "height": cell.height},
        **{"width": cell.width, "threads": cell.threads, "precision": precision, "bits": bits},
        **{"launches": core.launches, "interval": "95 %" if core.sufficient else "insufficient"},
    }
    found, stated = _measured(counted, cell, scene_hash, cpu), _declared(counted, cell, scene_hash)
    nan = math.nan
    flops, loads, stores, row["backend"], row["calibrated"], row["scaled_from_n"] = (
        nan,
        nan,
        nan,
        None,
        None,
        None,
    )
    operations = row["foreign_counts"] = None
    if found:
        factor, row["scaled_from_n"], one = found
        counts = _whole(one)
        flops, loads, stores = (factor * x for x in (counts.machine, counts.load, counts.store))
        row |= {"backend": one.backend, "calibrated": one.calibrated}
        operations = counts.lanes
        row["foreign_counts"] = _origin(vars(one), cell, cpu)
    elif stated:
        factor, row["scaled_from_n"], one = stated
        flops, row["backend"] = factor * one["flops"]["machine"], "declared"
        row["foreign_counts"] = _origin(one, cell, cpu)
    row["libm_counted"] = bool(found and (found[2].outside is not None or row["backend"] in LIBM_INSIDE))
    if not loads + stores > 0:  # a back end that counts none
        loads = stores = nan
    row |= {"flops": flops, "load_bytes": loads, "store_bytes": stores, "bytes": loads + stores}
    row["intensity"] = flops / row["bytes"] if row["bytes"] > 0 else nan
    row |= _rate("flops_per_core_cycle", flops, core) | _rate("flops_per_tsc_cycle", flops, tsc)
    row["gflops"] = flops / cell.median("ns").value
    row |= below(row, operations, limits, about)
    row |= under_load(row, cell, limits)
    rule = paper_rule.flop(stated[2]) if stated else None
    theirs = nan if rule is None else stated[0] * rule
    row["paper_rule_scaled_from_n"] = stated[1] if stated else None
    row["paper_rule_flops"] = theirs
    row |= _rate("paper_rule_flops_per_core_cycle", theirs, core)
    row |= _rate("paper_rule_flops_per_tsc_cycle", theirs, tsc)
    for share, of in (("avx2_roof", "avx2_fma_roof"), ("avx2_peak", "avx2_fma_peak")):
        row[f"paper_rule_share_of_{share}"] = row["paper_rule_flops_per_core_cycle"] / row[of]
    return row


def rows(data: Data, counted: Counted, limits: Ceilings | None) -> pd.DataFrame:
    """One row per timed configuration of one thread that has counts, in the order of the cells.

    Rates are FLOPs of the machine convention per core (or TSC) cycle, their ends the interval of the cycles
    over launches. `scaled_from_n`: the counts are another height's, per pixel. `paper_…`: the paper's own
    figure and percent; `paper_rule_…`: calls × FLOPs of each function. NaN: not counted, or no ceiling.
    `foreign_ceilings`, `foreign_counts`: why they are not of what was timed.
    """
    table = paper.read("performance").set_index(["metric", "scene", "phase"])["value"]
    cpu, other = cli.plain(data.context.cpu), foreign(data, limits)
    made = []
    for cell in data.cells:
        if cell.threads != 1:
            continue
        hashes = _hashes(data, cell)
        row = _row(cell, counted, limits, hashes, cpu)
        if row["backend"] is None:
            continue
        row["foreign_ceilings"] = other
        row["paper_flops_per_cycle"] = table.get(("performance", cell.scene, cell.spec), math.nan)
        row["paper_share"] = table.get(("share_of_peak", cell.scene, cell.spec), math.nan) / 100
        row["section"] = SECTION.get(cell.spec, "table6")
        made.append(row)
    return pd.DataFrame(made)


def _hashes(data: Data, cell: Cell) -> str | None:
    """Version of the scene that was timed."""
    frames = data.frames
    found = frames[frames["scene"] == cell.scene]["scene_hash"]
    return str(found.iloc[-1]) if len(found) else None


def headline(table: pd.DataFrame) -> pd.DataFrame:
    """Of each scene and phase the row with the most pixels."""
    if table.empty:
        return table
    pixels = table["width"] * table["height"]
    return table.loc[pixels.groupby([table["scene"], table["phase"]], sort=False).idxmax()]


def to_json(table: pd.DataFrame, limits: Ceilings) -> Row:
    points = []
    for row in table.to_dict("records"):
        ends = {end: row[f"flops_per_core_cycle_{end}"] for end in ("low", "high")}
        points.append(
            {**row, **ends, "scaled": row["scaled_from_n"] is not None and row["scaled_from_n"] > 0}
        )
    return {"ceilings": limits.rows, "points": points, "remarks": remarks(table)}
