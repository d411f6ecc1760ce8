"""Pictures and figures inside the page, in the form of fewest bytes that shows them well."""

from __future__ import annotations

import base64
import io
import re
import shutil
from collections.abc import Mapping
from pathlib import Path

from PIL import Image

from study.core.cli import StudyError
from study.experiments.section import Section, reading

MIME = {".png": "image/png", ".svg": "image/svg+xml", ".jpg": "image/jpeg"}
SHORTER = 0.6  # a JPEG stands in for a rendered picture where it has at most this share of its bytes
QUALITY = 85
Shown = dict[str, str]  # name, caption, and uri or svg


def data_uri(content: bytes, kind: str = ".png") -> str:
    return f"data:{MIME[kind]};base64,{base64.b64encode(content).decode()}"


def read(path: Path) -> bytes:
    """Raises StudyError if it cannot be read."""
    try:
        return path.read_bytes()
    except OSError as error:
        raise StudyError(f"{path}: {error.strerror}") from None


def picture(path: Path) -> str:
    """A rendered picture: as it is, or as a JPEG where that is much shorter. The PNG lies beside the page."""
    content = read(path)
    made = io.BytesIO()
    try:
        Image.open(io.BytesIO(content)).convert("RGB").save(
            made, format="jpeg", quality=QUALITY, optimize=True
        )
    except OSError as error:
        raise StudyError(f"{path}: {error}") from None
    if made.tell() <= SHORTER * len(content):
        return data_uri(made.getvalue(), ".jpg")
    return data_uri(content, path.suffix)


def inline(path: Path) -> str:
    """An SVG for use inside a page: no prolog, ids of its own. Pictures in <img> show no hover text."""
    svg = read(path).decode("utf-8")
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    for before in ('id="', "url(#", 'href="#'):
        svg = svg.replace(before, f"{before}{path.stem}-")
    return svg


def figures(section: Section, folder: Path) -> list[Shown]:
    """Draws a chapter's figures into `folder`, from its file alone: PNG, and the first as SVG where its
    points say something under the pointer.

    Never those that the run's own figures/ may have: they can be of an older file.
    """
    made = []
    for name, drawing in section.drawn.items():
        with reading(section.file or section.id, f"{section.script} --run {folder}"):
            svg, png = drawing.write(folder / name)
        shown = {"name": name, "caption": drawing.caption}
        if drawing.hover and not made:
            made.append({**shown, "svg": inline(svg)})
        else:
            made.append({**shown, "uri": data_uri(read(png))})
    return made


def copied(wanted: Mapping[Path, str], folder: Path) -> list[Shown]:
    """Copies the pictures that exist to `folder`."""
    made = []
    for path, text in wanted.items():
        if path.is_file():
            folder.mkdir(parents=True, exist_ok=True)
            if folder.resolve() != path.parent.resolve():  # of a page in the run's own folder
                shutil.copyfile(path, folder / path.name)
            made.append({"name": path.stem, "caption": text, "uri": picture(path)})
    return made


def absent(section: Section) -> list[str]:
    """Captions of the chapter's pictures that are not with its files."""
    return [caption for path, caption in section.images.items() if not path.is_file()]
