"""The chapter of frame rates."""

from __future__ import annotations

from pathlib import Path

from study.experiments.frames import measure as frames
from study.experiments.frames import tables as frames_page
from study.experiments.section import Section, part, reading


def rates(path: Path) -> Section:
    """Finished frames a second on every core, presenting included."""
    file = path / frames.FILE
    parts, answer, drawn = [], "", {}
    with reading(file, f"scripts/stepwise frames --run {path}"):
        result = frames.read(file)
        if result["rows"]:
            for name, caption, rows, columns in frames_page.tables(result):
                parts += part(name, caption, rows, columns, frames_page.FEET.get(name, ""))
            answer, drawn = frames_page.answer(result), frames_page.drawings(result)
    about = {"file": file, "script": "scripts/stepwise frames", "drawn": drawn}
    return Section("frames", "Frame rates", "make frames", parts, answer=answer, **about)
