"""A chapter of a run's page: its tables, figures and remarks.

A file that is broken ends in a StudyError that names it and its script, never in a traceback.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import pandas as pd

from study.core import show
from study.core.cli import StudyError
from study.core.show import Column, Row, Table
from study.numbers.analysis import BROKEN
from study.pictures.draw import Drawing


@dataclass(frozen=True)
class Part:
    """A table. `name` is its file's; `folded`: behind a summary on the page; `foot`: what stands under it,
    on the page and in its Markdown file."""

    name: str
    caption: str
    rows: list[Row]
    table: Table
    folded: bool = False
    foot: str = ""

    @property
    def frame(self) -> pd.DataFrame:
        return pd.DataFrame(self.rows)

    @property
    def markdown(self) -> str:
        return show.markdown(self.table) + (f"\n{self.foot}\n" if self.foot else "")


@dataclass(frozen=True)
class Section:
    """A chapter of the page. `lacking`: the command that would fill it, where there is nothing; `remarks`:
    how to read the tables, and what was left out; `details`: more of that, behind a summary; `figures`: names
    of the plots that belong above them; `drawn`: file names and figures made from `file` by `script`.
    """

    id: str
    title: str
    lacking: str
    parts: list[Part]
    remarks: list[str] = field(default_factory=list)
    details: list[str] = field(default_factory=list)
    figures: Sequence[str] = ()
    file: Path | None = None
    script: str = ""
    drawn: dict[str, Drawing] = field(default_factory=dict)
    images: dict[Path, str] = field(default_factory=dict)  # pictures, which no figure replaces; captions
    html: str = ""  # a fragment of its own, in place of tables


@contextlib.contextmanager
def reading(file: Path | str, script: str) -> Iterator[None]:
    """Whatever the content of `file` makes fail becomes a StudyError: the file, why, and who writes it."""
    try:
        yield
    except StudyError as error:
        if "scripts/" in str(error):
            raise
        raise StudyError(f"{error}; remove it and make it again with {script}", error.exit_status) from None
    except BROKEN as error:
        name = " ".join(script.split()[:2])  # scripts/stepwise NAME
        raise StudyError(
            f"{file}: not what {name} writes ({error!r}); remove it and make it again with {script}"
        ) from error


def part(
    name: str,
    caption: str,
    rows: Sequence[Row],
    shown: Sequence[Column],
    folded: bool = False,
    foot: str = "",
) -> list[Part]:
    rows = list(rows)
    if not rows:
        return []
    made = Part(name, caption, rows, show.table(rows, shown), folded, foot)
    _ = made.markdown  # here, where a cell that is no text is still known to be the file's
    return [made]
