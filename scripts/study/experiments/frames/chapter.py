"""The chapter of frame rates."""

from __future__ import annotations

from pathlib import Path

from study.experiments.frames import measure as frames
from study.experiments.frames import tables as frames_page
from study.experiments.section import Found, Section, chapter, part


def found(result: frames.Row) -> Found:
    tables = frames_page.tables(result)
    parts = [one for table in tables for one in part(*table, frames_page.FEET.get(table[0], ""))]
    return Found(parts, frames_page.answer(result), frames_page.drawings(result))


def rates(path: Path) -> Section:
    """Finished frames a second on every core, presenting included."""
    return chapter("frames", "Frame rates", path / frames.FILE, frames.read, found)
