"""Synthetic pictures whose errors are known, and a way to write them as the driver does."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import emitted
import numpy as np
import OpenImageIO as oiio
import pytest
from discs import HEIGHT, RADIUS, WIDTH

from study.core import cli
from study.pictures.images import Picture


@pytest.fixture
def blank() -> Callable[..., Picture]:
    """Picture factory: a plane at t = 10 that fills the picture (shape 0, facing the camera), mid grey."""

    def make(height: int = 10, width: int = 10, grey: float = 0.5) -> Picture:
        values = {"Z": 10, "id": 0, "N.x": 0, "N.y": 0, "N.z": -1, "evals": 7}
        values = {"R": grey, "G": grey, "B": grey, **values}
        return Picture({name: np.full((height, width), value, np.float32) for name, value in values.items()})

    return make


@pytest.fixture
def miss() -> Callable[..., None]:
    """Turns the pixels of a picture at `where` into misses."""

    def apply(picture: Picture, where: object = ...) -> None:
        values = {"R": 0, "G": 0, "B": 0, "Z": np.inf, "id": -1, "N.x": 0, "N.y": 0, "N.z": 0}
        for name, value in values.items():
            picture[name][where] = value

    return apply


@pytest.fixture
def disc(blank, miss):
    """Picture factory: a disc of radius 11.5 around (20, 25 + shift), shape 0, on an empty background."""

    def make(shift: int = 0) -> Picture:
        picture = blank(HEIGHT, WIDTH)
        rows, columns = np.mgrid[:HEIGHT, :WIDTH]
        miss(picture, (rows - 20) ** 2 + (columns - 25 - shift) ** 2 > RADIUS**2)
        return picture

    return make


@pytest.fixture
def write_exr() -> Callable[..., Path]:
    """Writes planes as an EXR, channels in the order given."""

    def write(path: Path, picture: Picture, kind: str = "float") -> Path:
        height, width = next(iter(picture.values())).shape
        spec = oiio.ImageSpec(width, height, len(picture), kind)
        spec.channelnames = tuple(picture)
        file = oiio.ImageOutput.create(str(path))
        assert file.open(str(path), spec), file.geterror()
        assert file.write_image(np.stack(list(picture.values()), -1)), file.geterror()
        assert file.close(), file.geterror()
        return path

    return write


@pytest.fixture
def refused(tmp_path: Path) -> Callable[..., None]:
    """Runs a command in this process with bad input: status 2, the last line says why, nothing is left.

    `{tmp}` in a word is the test's folder, which has a file named `file`.
    """

    def check(*how: Any) -> None:
        script, words, said = how[-3:]
        (tmp_path / "file").write_text("")
        done = emitted.ran(*script.split()[1:], *(word.format(tmp=tmp_path) for word in words))
        assert (done.returncode, done.stdout) == (cli.BAD_INPUT, "") and "Traceback" not in done.stderr
        last = done.stderr.splitlines()[-1]
        assert last.startswith(f"{script}: ") and said in last
        assert [path.name for path in tmp_path.rglob("*") if path.is_file()] == ["file"]

    return check
