"""The chapter of the hotspots: Tables 2 and 4 (functions) and 3 (what bounds them)."""

from __future__ import annotations

from pathlib import Path

from study.experiments.hotspots import bounds_tables as bounds_page
from study.experiments.hotspots import tables as hotspots
from study.experiments.section import Section, part, reading

HOTSPOTS = {
    "baseline": "Table 2a: where the time of baseline goes",
    "opt1": "Table 2b: where the time of opt1 goes",
    "opt2": "Table 4a: where the time of opt2 goes",
    "opt3": "Table 4b: where the time of opt3 goes",
}


def hot(path: Path, microarchitecture: str | None = None) -> Section:
    """Tables 2 and 4 (functions) and 3 (what bounds them). `microarchitecture`: of the run's CPU."""
    file = path / "hotspots.json"
    parts, remarks, details = [], [], []
    with reading(file, f"scripts/stepwise hotspots --run {path}"):
        record = hotspots.read(file)
        rows = hotspots.table_rows(record, widest=hotspots.core_width(microarchitecture))
        for phase in dict.fromkeys(row["phase"] for row in rows):
            mine = [row for row in rows if row["phase"] == phase]
            title = HOTSPOTS.get(phase, f"The same of {phase}")
            folded = phase not in ("baseline", "opt3")
            parts += part(f"hotspots-{phase}", title, mine, hotspots.COLUMNS, folded)
        split = bounds_page.rows(record) if record.get("bounds") else []
        caption = "Table 3: what the cycles went to, structs against arrays"
        parts += part("table3", caption, split, bounds_page.COLUMNS)
        caption = "The hot regions under the model"
        parts += part(
            "table3-regions", caption, bounds_page.region_rows(record), bounds_page.REGIONS, folded=True
        )
        if rows:
            remarks = [hotspots.ABOUT, *([bounds_page.ABOUT] if split else [])]
            details = hotspots.notes(record)
    return Section("hotspots", "Hotspots, and what bounds them", "make hotspots", parts, remarks, details)
