"""The roofline as tables: shares of roofs (Tables 5 and 6), points, ceilings."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable

import pandas as pd

from study.bounds import ceilings
from study.bounds.ceilings import Ceilings
from study.bounds.roof import Row, headline, remarks
from study.bounds.roof_shares import ELEMENT, NEAREST, clocks
from study.core import show
from study.core.show import Column, interval, number, percent, plain, whole, word

FOREIGN = ", not of what was timed"


def counted_by(row: Row) -> str:
    """The back end, with what speaks against trusting it."""
    state = {"declared": ""}.get(
        row["backend"],
        {True: "", False: " (not calibrated here)"}.get(row["calibrated"], " (not yet validated)"),
    )
    scaled = row["scaled_from_n"]
    other = "" if scaled is None or pd.isna(scaled) else f", scaled from n = {scaled:.0f}"
    libm = "" if row["libm_counted"] or row["backend"] == "declared" else ", without libm's inside"
    # More of it in the remarks. Where a table has one of them, what is None beside it is read as NaN.
    foreign = FOREIGN if isinstance(row["foreign_counts"], str) else ""
    return f"{row['backend']}{state}{other}{libm}{foreign}"


def doubtful(row: Row, name: str) -> str:
    """Why a share of a roof is not to be believed, in a few words, or nothing."""
    if isinstance(row["foreign_ceilings"], str) and not name.endswith("_peak"):  # which is no measurement
        return "another machine's roof"
    if name.startswith("share_of_least_roof") and row["least_bound"] == NEAREST:
        return "by wider accesses than its own" if row[name] > 1 else ""
    return "above its roof" if row[name] > 1 else ""


def _share(group: str, title: str, name: str) -> Column:
    """A column of shares: those that cannot be are marked."""

    def text(row: Row) -> str:
        why = doubtful(row, name) if row[name] > 0 else ""
        return percent(row[name]) + (f" ({why}!)" if why else "")

    return Column(group, title, text, lambda row: "bad" if doubtful(row, name) else "")


def _paper_percent(row: Row) -> str:
    value = row["paper_share"]
    return show.NOTHING if pd.isna(value) else f"{100 * value:.4g}\u00a0%"


def _bound(row: Row) -> str:
    unpriced = row["unpriced_share"]
    more = f" ({percent(unpriced)} of the FLOPs have no ceiling)" if unpriced > 0 else ""
    return word("mix_bound")(row) + more


PERFORMANCE = [
    Column("", "scene", word("scene")),
    Column("", "phase", word("phase")),
    Column("", "n", whole("n")),
    Column(
        "machine's convention",
        "flop/core cycle [95\u00a0%]",
        lambda r: interval(r, "flops_per_core_cycle"),
    ),
    Column("machine's convention", "flop/TSC cycle", plain("flops_per_tsc_cycle", 4)),
    _share("machine's convention", "share of AVX2 peak", "share_of_avx2_peak"),
    _share("machine's convention", "of the measured AVX2 roof", "share_of_avx2_roof"),
    Column("paper's rule", "flop/core cycle", plain("paper_rule_flops_per_core_cycle", 4)),
    Column("paper's rule", "flop/TSC cycle", plain("paper_rule_flops_per_tsc_cycle", 4)),
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
    Column("", "n", whole("n")),
    Column("", "flop/core cycle [95\u00a0%]", lambda r: interval(r, "flops_per_core_cycle")),
    Column("", "bytes/pixel", lambda r: number(r["bytes"] / (r["width"] * r["height"]), 4)),
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


def _best(name: str) -> Column:
    def text(row: Row) -> str:
        one = row[name]
        if one is None:
            return show.NOTHING
        return f"{number(one['value'], 4)} ({number(one['median'], 4)})" if one["value"] else show.NOTHING

    return Column("best (median)", name, text)


COMPUTE = [
    Column("", "precision", word("precision")),
    Column("", "width", word("width")),
    Column("fma by the ports", "flop/core cycle", plain("peak", 4)),
    Column("fma by the ports", "measured of it", lambda r: percent(r["of_peak"])),
    *[_best(name) for name in (*ceilings.KINDS, *ceilings.TOGETHER)],
]
BANDWIDTH = [
    Column("", "level", word("level")),
    Column("", "working set, KiB", whole("kib")),
    Column("", "width", word("width")),
    *[_best(name) for name in ("load", "store", "copy")],
]


def _width(one: Row) -> str:
    scalar = one["bits"] == ELEMENT.get(one.get("precision", "double"))
    return f"{one['bits']} bits" + (" (scalar)" if scalar else "")


def grid(limits: Ceilings, by: str) -> list[Row]:
    """Ceilings as rows, a column per name. `by`: precision (flop/core cycle) or level (byte/core cycle)."""
    lines: dict[tuple, Row] = {}
    for one in limits.rows:
        if by in one:
            line = lines.setdefault((one[by], one["bits"]), defaultdict(lambda: None))
            line |= {by: one[by], "width": _width(one), one["name"]: one}
            if "working_set_bytes" in one:
                line["kib"] = one["working_set_bytes"] / 1024 or math.nan
            if one["name"] == "fma":
                line["peak"] = limits.peak("fma", one["precision"], one["bits"])
                line["of_peak"] = (one["value"] or math.nan) / line["peak"]
    return list(lines.values())


def _with_peak(limits: Ceilings, one: Row) -> Row:
    """A ceiling and, of arithmetic, the most that the ports allow; null where that is not known."""
    if "precision" not in one:
        return one
    peak = limits.peak(one["name"], one["precision"], one["bits"])
    return {**one, "peak": None if math.isnan(peak) else peak}


def flat(found: Iterable[Row]) -> pd.DataFrame:
    return pd.DataFrame(list(found))


def of_roofs(table: pd.DataFrame, limits: Ceilings | None) -> list[str]:
    """What must be known of the roofs themselves: the clock, and ceilings that were disturbed."""
    return [*clocks(table), *limits.remarks()] if limits else []


def tables(table: pd.DataFrame, limits: Ceilings | None) -> dict[str, tuple[pd.DataFrame, str]]:
    """Name of a file → its data and its Markdown, as tables.make has them."""
    made = {}
    for name in ("table5", "table6"):
        part = table[table["section"] == name] if not table.empty else table
        if not part.empty:
            text = show.markdown(show.table(part.to_dict("records"), PERFORMANCE))
            text += "".join(f"\n{line}\n" for line in remarks(part))
            made[name] = part.drop(columns="section"), text
    if limits and not table.empty:
        shown = headline(table)
        text = show.markdown(show.table(shown.to_dict("records"), POINTS))
        text += "".join(f"\n{line}\n" for line in [*remarks(shown), *of_roofs(shown, limits)])
        made["roofline"] = table.drop(columns="section"), text
    if limits:
        for name, by, part in (("ceilings", "precision", COMPUTE), ("bandwidth", "level", BANDWIDTH)):
            data = flat(_with_peak(limits, one) for one in limits.rows if by in one)
            text = show.markdown(show.table(grid(limits, by), part))
            said = limits.remarks() if by == "precision" else []
            made[name] = data, text + "".join(f"\n{line}\n" for line in said)
    return made
