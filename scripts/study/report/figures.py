"""A chapter's figures and pictures for the page, with copies beside it."""

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path

from study.core import store
from study.experiments.section import Section, reading
from study.pictures import embed
from study.pictures.draw import Drawing
from study.pictures.processes import in_processes

Shown = dict[str, str]  # name, caption, and uri where the page has room for it
MOST = 6_000_000  # bytes of a page
ROOM = 200  # of the line that stands for a picture


def content(section: Section) -> str:
    """Hexadecimal digits of what a chapter shows: its tables and the notes of its figures."""
    texts = [part.markdown for part in section.parts]
    texts += [f"{name}\n{drawing.caption}\n{drawing.note}" for name, drawing in section.drawn.items()]
    return hashlib.sha256("\n".join(texts).encode()).hexdigest()


def _write(section: Section, name: str, drawing: Drawing, folder: Path, across: float | None) -> None:
    with reading(section.file or section.id, f"{section.script} --run {folder}"):
        drawing.write(folder / name, across)


def draw(sections: Sequence[Section], folder: Path, reuse: bool = False, across: float | None = None) -> None:
    """Draws the chapters' figures into `folder`, from their files alone, on all CPUs.

    Never those that the run's own figures/ may have: they can be of an older file. `reuse`: of a page that is
    written several times, what was drawn of the same tables stays. `across`: as Drawing.write has it.
    """
    calls = []
    for section in sections:
        known, key = folder / f".{section.id}", content(section)
        stays = reuse and known.is_file() and known.read_text() == key
        for name, drawing in section.drawn.items():
            if not (stays and all((folder / f"{name}{end}").is_file() for end in (".svg", ".png"))):
                calls.append(partial(_write, section, name, drawing, folder, across))
    in_processes(calls)
    for section in sections:
        if section.drawn:
            store.write_text(folder / f".{section.id}", content(section))


def figures(section: Section, folder: Path) -> list[Shown]:
    return [
        {"name": name, "caption": drawing.caption, "uri": embed.figure((folder / f"{name}.png").read_bytes())}
        for name, drawing in section.drawn.items()
    ]


def fewer(chapters: Iterable[Sequence[Shown]], excess: int) -> None:
    """Leaves out pictures until the page has `excess` bytes less: first the largest of those that are behind
    a summary, then the largest of the others. A line stands in the place of each."""
    shown = [(place == 0, -len(one["uri"]), one) for items in chapters for place, one in enumerate(items)]
    for _, length, one in sorted(shown, key=lambda each: each[:2]):
        if excess > 0:
            excess += length + ROOM
            del one["uri"]


def copied(wanted: Mapping[Path, str], folder: Path) -> list[Shown]:
    """Copies the pictures that exist to `folder`."""
    made = []
    for path, text in wanted.items():
        if path.is_file():
            if folder.resolve() != path.parent.resolve():  # of a page in the run's own folder
                store.write_bytes(folder / path.name, path.read_bytes())
            made.append({"name": path.stem, "caption": text, "uri": embed.rendered(path.read_bytes())})
    return made


def absent(section: Section) -> list[str]:
    """Captions of the chapter's pictures that are not with its files."""
    return [caption for path, caption in section.images.items() if not path.is_file()]
