"""The chapter of frame rates."""

from __future__ import annotations

from pathlib import Path

from study.experiments.frames import tables
from study.experiments.frames.schema import FILE, Frames
from study.experiments.section import Found, Section, chapter, part


def found(result: Frames) -> Found:
    made = tables.tables(result)
    parts = [one for table in made for one in part(*table, tables.FEET.get(table[0], ""))]
    return Found(parts, tables.answer(result), tables.drawings(result))


def rates(path: Path) -> Section:
    """Finished frames a second on every core, presenting included."""
    return chapter("frames", "Frame rates", path / FILE, Frames.load_if_there, found)
