"""The chapter of the roofline: ceilings, Tables 5 and 6, the share of each roof."""

from __future__ import annotations

from study.bounds import roof
from study.experiments.roofline import tables as roof_tables
from study.experiments.section import Part, Section, part, reading
from study.numbers.analysis import Data


def roofline(data: Data) -> Section:
    """Ceilings, Tables 5 and 6, the share of each roof."""
    parts: list[Part] = []
    both = f"{data.path / 'counts.json'} or ceilings.json"
    with reading(
        both, f"scripts/stepwise flops --run {data.path} or scripts/stepwise ceilings --run {data.path}"
    ):
        found, limits, notes = roof.read(data.path, strict=False)
        table = roof.rows(data, found, limits)
        notes = [*roof.remarks(table), *roof_tables.of_roofs(roof.headline(table), limits), *notes]
        if not table.empty:
            for name, title in (
                ("table5", "Table 5: performance of baseline"),
                ("table6", "Table 6: of the optimised phases"),
            ):
                rows = table[table["section"] == name].to_dict("records")
                parts += part(name, title, rows, roof_tables.PERFORMANCE)
            if limits:
                caption = "Share of each roof, at the largest size that was timed and counted"
                parts += part(
                    "roofline", caption, roof.headline(table).to_dict("records"), roof_tables.POINTS
                )
        if limits:
            if table.empty and (other := roof.foreign(data, limits)):
                notes.append(other)
            caption = "What one core does at best: flop per core cycle, best sample and median"
            parts += part(
                "ceilings", caption, roof_tables.grid(limits, "precision"), roof_tables.COMPUTE, folded=True
            )
            caption = "Bandwidth as the core sees it: bytes per core cycle, best sample and median"
            parts += part(
                "bandwidth", caption, roof_tables.grid(limits, "level"), roof_tables.BANDWIDTH, folded=True
            )
    return Section(
        "roofline",
        "Roofline",
        "make roofline",
        parts,
        notes if parts else [],
        figures=("roofline", "performance"),
    )
