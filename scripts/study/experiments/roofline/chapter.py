"""The chapter of the roofline: ceilings, Tables 5 and 6, the share of each roof."""

from __future__ import annotations

from study.bounds import roof
from study.core import show
from study.core.show import Row
from study.experiments.roofline import figures
from study.experiments.roofline import tables as roof_tables
from study.experiments.section import Part, Section, part, reading
from study.numbers.analysis import Data


def roofline(data: Data) -> Section:
    """Ceilings, Tables 5 and 6, the share of each roof."""
    parts: list[Part] = []
    drawn, answer = {}, ""
    both = f"{data.path / 'counts.json'} or ceilings.json"
    with reading(
        both, f"scripts/stepwise flops --run {data.path} or scripts/stepwise ceilings --run {data.path}"
    ):
        found, limits, notes = roof.read(data.path, strict=False)
        table = roof.rows(data, found, limits)
        notes = [*roof.remarks(table), *notes]
        if not table.empty:
            for name, title in (
                ("table5", "Table 5: performance of baseline"),
                ("table6", "Table 6: of the optimised phases"),
            ):
                rows = table[table["section"] == name].to_dict("records")
                parts += part(name, title, rows, roof_tables.PERFORMANCE)
            drawn = figures.drawings(data, table, limits)
            if limits:
                caption = "Share of each roof, at the largest size that was timed and counted"
                rows = roof.headline(table).to_dict("records")
                foot = "\n".join(roof_tables.of_roofs(roof.headline(table), limits))
                parts += part("roofline", caption, rows, roof_tables.POINTS, foot)
                answer = _answer(rows)
        if limits:
            if table.empty and (other := roof.foreign(data, limits)):
                notes.append(other)
            caption = "What one core does at best: flop per core cycle, best sample and median"
            parts += part("ceilings", caption, roof_tables.grid(limits, "precision"), roof_tables.COMPUTE)
            caption = "Bandwidth as the core sees it: bytes per core cycle, best sample and median"
            parts += part("bandwidth", caption, roof_tables.grid(limits, "level"), roof_tables.BANDWIDTH)
    return Section(
        "roofline",
        "Roofline",
        "make roofline",
        parts,
        notes if parts else [],
        answer=answer,
        file=data.path / "counts.json",
        script="scripts/stepwise roofline",
        drawn=drawn,
    )


def _answer(rows: list[Row]) -> str:
    """What bounds the last phase on each scene; then the phase that is nearest to its own roof."""
    said = []
    for scene in dict.fromkeys(row["scene"] for row in rows):
        mine = [row for row in rows if row["scene"] == scene and 0 < row["share_of_least_roof"] <= 1]
        if mine:
            best = max(mine, key=lambda row: row["share_of_least_roof"])
            rate = f"{show.interval(best, 'flops_per_core_cycle', 3)} flop per core cycle"
            share = show.percent(best["share_of_least_roof"])
            said.append(
                f"on {scene} {best['phase']} does {rate}, {share} of its lowest roof ({best['least_bound']})"
            )
    bound = [
        f"{row['least_bound']} on {scene} ({show.percent(row['share_of_least_roof'])} of that roof)"
        for scene, row in {row["scene"]: row for row in rows if row["phase"] == rows[-1]["phase"]}.items()
    ]
    text = f"{rows[-1]['phase']} is bound by {', by '.join(bound)}. " if bound else ""
    return f"{text}Of all phases the nearest to its own roof: {'; '.join(said)}." if said else ""
