"""A chapter of a run's page: its tables, figures and remarks."""

import contextlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import pandas as pd

from study.core import cli, registry, show
from study.core.cli import StudyError
from study.core.schema import File, Record
from study.core.show import Column, Table
from study.pictures.draw import Drawing


@dataclass(frozen=True)
class Part:
    """A table, behind its caption on the page unless `open`. `name` is its file's (empty: none); `foot`:
    what stands under it, on the page and in its Markdown file, a paragraph a line."""

    name: str
    caption: str
    rows: list[Any]
    table: Table
    foot: str = ""
    open: bool = False

    @property
    def frame(self) -> pd.DataFrame:
        rows = (row if isinstance(row, Record) else show.cells(row) for row in self.rows)
        return pd.DataFrame([cli.plain(row) for row in rows])

    @property
    def markdown(self) -> str:
        return show.markdown(self.table) + "".join(
            f"\n{show.inert(line)}\n" for line in self.foot.splitlines()
        )


@dataclass(frozen=True)
class Section:
    """A chapter of the page. `answer`: what came out, in a sentence with its number, unit and interval or
    error; empty where there is no data. `lacking`: the command that would fill it. `drawn`: file names and
    figures, made by `script` from `file`; the first opens the chapter, the others are behind a summary.
    `failing`: what is not as it should be, in red; `remarks`: what the reader must know at once, a line each;
    `details`: what was sampled and left out, behind a summary."""

    id: str
    title: str
    lacking: str
    parts: list[Part]
    remarks: list[str] = field(default_factory=list)
    details: list[str] = field(default_factory=list)
    answer: str = ""
    failing: list[str] = field(default_factory=list)
    file: Path | None = None
    script: str = ""
    drawn: dict[str, Drawing] = field(default_factory=dict)
    images: dict[Path, str] = field(default_factory=dict)  # pictures, which no figure replaces; captions
    cut: str = ""  # what a quick study left out of it, and how to get it
    fragment: Callable[[], str] = str  # HTML of its own, behind the tables; made for the page alone
    chart: str = ""  # that answers the mouse, of study.pictures.charts; the first figure is behind it

    @cached_property
    def html(self) -> str:
        return self.fragment()


def noted(section: Section, programs: Sequence[str]) -> Section:
    """The chapter, where each table that has one of these programs says that SIMDe translated them."""

    def foot(one: Part) -> str:
        names = {show.cell(row, key) for row in one.rows for key in ("phase", "spec")}
        return "\n".join(filter(None, (one.foot, registry.translated(programs, names))))

    return replace(section, parts=[replace(one, foot=foot(one)) for one in section.parts])


@dataclass(frozen=True)
class Claim:
    """A figure that another article states, beside ours. `ratio`: ours over it; `error`: of our pictures, to
    ground truth. `speed`: times as fast as the article's figure; `beside`: as its program, measured here."""

    article: str
    claim: str
    said: str
    ours: str
    ratio: str
    error: str
    speed: float | None = None
    beside: float | None = None


@dataclass(frozen=True)
class System:
    """What a run has of a system that another article built. `note`: stands under the table of claims.
    `lessons`: a table for the lesson of each phase, by the phase's name; its foot says what came out."""

    claims: list[Claim]
    parts: list[Part]
    note: str = ""
    drawn: dict[str, Drawing] = field(default_factory=dict)
    images: dict[Path, str] = field(default_factory=dict)
    lessons: Callable[[], list[Part]] = list


@contextlib.contextmanager
def reading(file: Path | str, script: str) -> Iterator[None]:
    """A StudyError about `file` names who writes it."""
    try:
        yield
    except StudyError as error:
        if isinstance(error, cli.Unwritten) or "scripts/" in str(error):
            raise
        raise StudyError(f"{error}; make {file} again with {script}", error.exit_status) from None


@dataclass
class Found:
    """What a chapter shows: as a Section has them."""

    parts: list[Part] = field(default_factory=list)
    answer: str = ""
    drawn: dict[str, Drawing] = field(default_factory=dict)
    fragment: Callable[[], str] = str
    chart: str = ""
    remarks: list[str] = field(default_factory=list)

    def section(self, name: str, title: str, file: Path, command: str = "") -> Section:
        """The chapter `name`, made from `file`, which `command` (that of its name) writes."""
        command = command or name
        about = {"file": file, "script": f"scripts/stepwise {command}", **vars(self)}
        return Section(name, title, f"make {command}", **about)


def chapter(
    name: str,
    title: str,
    file: Path,
    read: Callable[[Path], Any],
    found: Callable[[Any], Found],
    rows: str = "rows",
) -> Section:
    """The chapter of an experiment whose file has `rows`; without any, or without the file (None), it is
    empty."""
    with reading(file, f"scripts/stepwise {name} --run {file.parent}"):
        result = read(file)
        made = found(result) if getattr(result, rows, None) else Found()
    return made.section(name, title, file)


def chapters(
    name: str, title: str, file: str, kind: type[File], found: Callable[[Any], Found], rows: str = "rows"
) -> Callable[[Any], Section]:
    """`chapter` of a run's data, by the file's name and its type."""
    return lambda data: chapter(name, title, data.path / file, kind.load_if_there, found, rows)


def where(row: Any) -> str:
    """The scene of what was left out, and its view or hit distance."""
    more = getattr(row, "view", None) or getattr(row, "hit", None)
    return " ".join(filter(None, (row.scene, more)))


def left_out(name: str, rows: Sequence[Any]) -> list[Part]:
    reason = Column("", "why", lambda row: row.reason)
    columns = [Column("", "phase", show.word("phase")), Column("", "scene", lambda row: where(row) or "all")]
    return part(name, "Not measured", rows, [*columns, reason])


def part(
    name: str, caption: str, rows: Sequence[Any], shown: Sequence[Column], foot: str = "", open: bool = False
) -> list[Part]:
    rows = list(rows)
    if not rows:
        return []
    return [Part(name, caption, rows, show.table(rows, shown), foot, open)]
