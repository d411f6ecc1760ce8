"""The chapter of the hotspots: Tables 2 and 4 (functions) and 3 (what bounds them)."""

from __future__ import annotations

from pathlib import Path

from study.core.show import Row
from study.experiments.hotspots import bounds_tables as bounds_page
from study.experiments.hotspots import figures
from study.experiments.hotspots import tables as hotspots
from study.experiments.section import Section, part, reading
from study.pictures.draw import Drawing

HOTSPOTS = {
    "baseline": "Table 2a: where the time of baseline goes",
    "opt1": "Table 2b: where the time of opt1 goes",
    "opt2": "Table 4a: where the time of opt2 goes",
    "opt3": "Table 4b: where the time of opt3 goes",
}
NOTE = (
    "CPU time of one frame, sampled; inlined code is counted to the function of the source that it is from."
)


def hot(path: Path, microarchitecture: str | None = None) -> Section:
    """Tables 2 and 4 (functions) and 3 (what bounds them). `microarchitecture`: of the run's CPU."""
    file = path / "hotspots.json"
    parts, details, drawn, answer = [], [], {}, ""
    with reading(file, f"scripts/stepwise hotspots --run {path}"):
        record = hotspots.read(file)
        rows = hotspots.table_rows(record, widest=hotspots.core_width(microarchitecture))
        for phase in dict.fromkeys(row["phase"] for row in rows):
            mine = [row for row in rows if row["phase"] == phase]
            title = HOTSPOTS.get(phase, f"Where the time of {phase} goes")
            parts += part(f"hotspots-{phase}", title, mine, hotspots.COLUMNS, hotspots.ABOUT)
        split = bounds_page.rows(record) if record.get("bounds") else []
        caption = "Table 3: what the cycles went to, structs against arrays"
        parts += part("table3", caption, split, bounds_page.COLUMNS, bounds_page.ABOUT)
        caption = "The hot regions under the model"
        parts += part("table3-regions", caption, bounds_page.region_rows(record), bounds_page.REGIONS)
        if rows:
            details = hotspots.notes(record)
            answer = _answer(rows)
            caption = "The functions that take most of a frame, phase by phase"
            drawn = {"hotspots": Drawing(caption, NOTE, lambda: figures.draw(rows))}
    about = {"file": file, "script": "scripts/stepwise hotspots", "drawn": drawn, "details": details}
    return Section("hotspots", "Hotspots", "make hotspots", parts, answer=answer, **about)


def _answer(rows: list[Row]) -> str:
    """The function that takes most of a frame, of the first phase and of the last."""
    names = list(dict.fromkeys(row["phase"] for row in rows))
    said = []
    for name in dict.fromkeys(
        (names[0], [name for name in names if "+" not in name or name == names[0]][-1])
    ):
        top = figures.top(rows, name)
        if top:
            low, high = (top[0].get(f"{top[0]['build']}_percent_{end}") for end in ("low", "high"))
            share = f"{top[0]['percent']:.1f} [{low:.1f}, {high:.1f}] %"
            said.append(f"{share} of {name}'s frame is in {top[0]['function']}")
    return f"On {rows[0]['scene']}, {'; '.join(said)}." if said else ""
