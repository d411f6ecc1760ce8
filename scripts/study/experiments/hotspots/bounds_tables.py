"""Table 3 and the hot regions as tables of a page, from a run's hotspots.json."""

from collections.abc import Callable
from typing import Any

from study.bounds.schema import Hotspots, Split
from study.core import show
from study.core.show import Column, cell
from study.numbers import paper

Row = dict[str, Any]
_NAMES = {"front-end bound": "front_end", "memory bound": "memory", "core bound": "core"}


def _shares(split: Split | None) -> Row:
    found = {f"{name}_share": value for name, value in show.cells(split).items()} if split else {}
    return {name: value for name, value in found.items() if value is not None}


def rows(record: Hotspots) -> list[Row]:
    """Table 3 from a run's hotspots.json: ours per phase, then the paper's two."""
    made = []
    for one in record.bounds:
        compared = one.compared
        made.append(
            {
                "what": f"{one.spec}, {show.picture(one)}",
                "by": f"model: {one.model or 'none'}",
                "milliseconds": one.cpu_ns / 1e6,
                "covered": one.covered,
                **_shares(one.split),
                "predicted_over_measured": compared and compared.throughput / compared.measured,
                "latency_over_measured": compared and compared.latency / compared.measured,
            }
        )
    table = paper.read("bounds")
    for stage, group in table[table.source.str.startswith("Table 3")].groupby("stage", sort=False):
        values = dict(zip(group.what, group.value, strict=True))
        seconds = values.pop("runtime")
        shares = {f"{_NAMES.get(what, what)}_share": value / 100 for what, value in values.items()}
        made.append({"what": f"the paper: {stage}", "by": "VTune", "milliseconds": 1000 * seconds} | shares)
    return made


def region_rows(record: Hotspots) -> list[Row]:
    made = []
    for one in record.bounds:
        for region in one.regions:
            flat = {"phase": one.phase, "scene": one.scene, **show.cells(region)}
            if found := flat.pop("mca"):
                flat |= {f"mca_{name}": value for name, value in show.cells(found).items()}
            if split := flat.pop("mca_split", None):
                flat |= {f"split_{k}": v for k, v in show.cells(split).items() if v is not None}
            made.append(flat)
    return made


def _percent(name: str) -> Callable[[Row], str]:
    return lambda row: show.NOTHING if (value := row.get(name)) is None else f"{100 * value:.0f}\u00a0%"


COLUMNS = [
    Column("", "what", show.word("what")),
    Column("", "by", show.word("by")),
    Column("", "ms a frame", show.plain("milliseconds", 4)),
    Column("split", "front end", _percent("front_end_share")),
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


REGIONS = [
    Column("", "scene", show.word("scene")),
    Column("", "phase", show.word("phase")),
    Column("", "region", lambda r: f"{cell(r, 'region')} ({'loop' if cell(r, 'loop') else 'no loop'})"),
    Column("", "of the frame", _percent("share")),
    Column("", "instructions", show.whole("instructions")),
    Column("", "calls left out", lambda r: str(cell(r, "calls") or show.NOTHING)),
    Column("cycles a pass, llvm-mca", "overlapping", show.plain("mca_throughput", 3)),
    Column("cycles a pass, llvm-mca", "alone", show.plain("mca_latency", 3)),
    Column("cycles a pass", "measured", show.plain("measured", 3)),
    Column("held up by", "ports", _percent("split_ports")),
    Column("held up by", "dependencies", _percent("split_dependencies")),
    Column("held up by", "memory", _percent("split_memory")),
]
