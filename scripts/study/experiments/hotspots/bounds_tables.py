"""Table 3 and the hot regions as tables of a page, from a run's hotspots.json."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from study.core import show
from study.core.registry import Spec
from study.core.show import Column
from study.numbers import paper

Row = dict[str, Any]


def rows(record: Row) -> list[Row]:
    """Table 3 from a run's hotspots.json: ours per phase, then the paper's two."""
    made = []
    for one in record.get("bounds", []):
        compared, spec = one.get("compared") or {}, Spec(one["phase"], one["flags_from"])
        made.append(
            {
                "what": f"{spec}, {one['scene']}, {one['width']}×{one['height']}",
                "by": "PMU" if one["by"] == "pmu" else f"model: {one['model'] or 'none'}",
                "milliseconds": one["cpu_ns"] / 1e6,
                "covered": one.get("covered"),
                **{f"{name}_share": value for name, value in (one["split"] or {}).items()},
                "predicted_over_measured": compared["throughput"] / compared["measured"]
                if compared
                else None,
                "latency_over_measured": compared["latency"] / compared["measured"] if compared else None,
            }
        )
    table = paper.read("bounds")
    names = {"front-end bound": "front_end", "memory bound": "memory", "core bound": "core"}
    for stage, group in table[table["source"].str.startswith("Table 3")].groupby("stage", sort=False):
        values = group.set_index("what")["value"]
        cells = {
            f"{names.get(what, what)}_share": value / 100
            for what, value in values.items()
            if what != "runtime"
        }
        made.append(
            {"what": f"the paper: {stage}", "by": "VTune", "milliseconds": 1000 * values["runtime"], **cells}
        )
    return made


def region_rows(record: Row) -> list[Row]:
    """The hot regions of every phase, flat."""
    made = []
    for one in record.get("bounds", []):
        for row in one.get("regions", []):
            mca, osaca = row.get("mca") or {}, row.get("osaca") or {}
            flat = {f"mca_{k}": v for k, v in mca.items() if k != "split"}
            flat |= {f"split_{k}": v for k, v in mca.get("split", {}).items()}
            flat |= {f"osaca_{k}": v for k, v in osaca.items()}
            rest = {k: v for k, v in row.items() if k not in ("mca", "osaca")}
            made.append({"phase": one["phase"], "scene": one["scene"], **rest, **flat})
    return made


def _percent(name: str) -> Callable[[Row], str]:
    return lambda row: show.NOTHING if row.get(name) is None else f"{100 * row[name]:.0f}\u00a0%"


COLUMNS = [
    Column("", "what", show.word("what")),
    Column("", "by", show.word("by")),
    Column("", "ms a frame", show.plain("milliseconds", 4)),
    Column("split", "front end", _percent("front_end_share")),
    Column("split", "bad speculation", _percent("bad_speculation_share")),
    Column("split", "back end (memory and core)", _percent("back_end_share")),
    Column("split", "memory", _percent("memory_share")),
    Column("split", "core", _percent("core_share")),
    Column("split", "retiring", _percent("retiring_share")),
    Column("of core, by the model", "ports", _percent("ports_share")),
    Column("of core, by the model", "dependencies", _percent("dependencies_share")),
    Column("model", "of the frame", _percent("covered")),
    Column("model", "cycles over measured, passes overlapping", show.plain("predicted_over_measured", 2)),
    Column("model", "one after the other", show.plain("latency_over_measured", 2)),
]


ABOUT = (
    "A model is no measurement: it takes every load as a hit in L1 and every branch as foreseen. Front end, "
    "bad speculation and cache misses are not in it.\n"
    "“Core” is waiting for ports and for results. “Over measured”: predicted over sampled cycles, when "
    "passes overlap fully, and when each waits for the one before."
)


def _osaca(row: Row) -> str:
    if "osaca_arch" not in row:
        return show.NOTHING
    lacking = f", {row['osaca_unknown']} instructions unknown" if row["osaca_unknown"] else ""
    return f"{row['osaca_arch']}{lacking}"


REGIONS = [
    Column("", "scene", show.word("scene")),
    Column("", "phase", show.word("phase")),
    Column("", "region", lambda r: f"{r['region']} ({'loop' if r['loop'] else 'no loop'})"),
    Column("", "of the frame", _percent("share")),
    Column("", "instructions", show.whole("instructions")),
    Column("", "calls left out", lambda r: str(r["calls"]) if r["calls"] else show.NOTHING),
    Column("cycles a pass, llvm-mca", "overlapping", show.plain("mca_throughput", 3)),
    Column("cycles a pass, llvm-mca", "alone", show.plain("mca_latency", 3)),
    Column("cycles a pass, OSACA", "busiest port", show.plain("osaca_throughput", 3)),
    Column("cycles a pass, OSACA", "critical path", show.plain("osaca_critical_path", 3)),
    Column(
        "cycles a pass, OSACA",
        "loop-carried",
        lambda r: show.number(r.get("osaca_loop_carried") if r["loop"] else None),
    ),
    Column("cycles a pass, OSACA", "tables of", _osaca),
    Column("cycles a pass", "measured", show.plain("measured", 3)),
    Column("held up by", "ports", _percent("split_ports")),
    Column("held up by", "dependencies", _percent("split_dependencies")),
    Column("held up by", "memory", _percent("split_memory")),
]
