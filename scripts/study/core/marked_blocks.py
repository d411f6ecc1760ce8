"""Blocks of pages written by hand that scripts write, between marks."""

from __future__ import annotations

from study.core.cli import StudyError


def between(text: str, begin: str, end: str, block: str) -> str:
    """The text with `block` in place of what is between the two marks. Raises StudyError without them."""
    before, found, rest = text.partition(begin)
    _, closed, after = rest.partition(end)
    if not (found and closed):
        raise StudyError(f"the page lacks the lines {begin} and {end}, between which a table goes")
    return f"{before}{begin}\n{block}{end}{after}"
