"""Whatever stands in a picture, a program or a table of blocks: it is read, or one line names it."""

from __future__ import annotations

import json
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import mutations
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.figure import Figure

from drawn import examples
from study.core.cli import StudyError
from study.counting import assembly, blocks, elf
from study.pictures import contents, draw, images
from study.report import figures

SOURCE = "int g(int x) { return x + 1; }\nint main(int n, char **a) { return a ? g(n) : 0; }\n"


def exr(folder: Path) -> Path:
    import OpenImageIO as oiio

    path = folder / "sound.exr"
    spec = oiio.ImageSpec(24, 16, 3, "float")
    file = oiio.ImageOutput.create(str(path))
    assert file.open(str(path), spec)
    assert file.write_image(np.linspace(0, 1, 24 * 16 * 3, dtype=np.float32).reshape(16, 24, 3))
    assert file.close()
    return path


def png(folder: Path) -> Path:
    path = folder / "sound.png"
    images.write_png(path, np.arange(24 * 16 * 3, dtype=np.uint8).reshape(16, 24, 3))
    return path


def ppm(folder: Path) -> Path:
    path = folder / "sound.ppm"
    path.write_bytes(b"P6\n4 3\n255\n" + bytes(36))
    return path


def figure(folder: Path) -> Path:
    made = Figure(figsize=(3, 2))
    made.subplots().plot([1, 2], [3, 4])
    return draw.save(made, folder / "figure", "")[1]


def program(folder: Path) -> Path:
    if not shutil.which("gcc"):
        pytest.skip("this machine lacks gcc, which makes the program")
    (folder / "a.c").write_text(SOURCE)
    subprocess.run(["gcc", "-O0", "-o", folder / "program", folder / "a.c"], check=True)
    return folder / "program"


def of_program(path: Path) -> None:
    read = elf.read(path)
    read.conditional_entries()
    read.returns_of("g")
    elf.exported(path)


def table(folder: Path) -> Path:
    """Its hash is made anew after each change, which else is all that is seen."""
    one = {"function": "f", "entry": True, "file": "a.s", "section": ".text", "offset": 0, "bytes": "c3"}
    path = folder / "table.json"
    made = {
        "schema": 1,
        "blocks": [one, one],
        "calls": [[0, "g", None]],
        "masked": [[0, 0]],
        "repeated": [[1, 0]],
    }
    path.write_text(json.dumps(made))
    return path


def of_table(path: Path) -> None:
    try:
        made = json.loads(path.read_bytes())
        made["hash"] = assembly.digest(made)
        path.write_text(json.dumps(made))
    except (OSError, ValueError, TypeError, AttributeError, RecursionError):
        pass
    blocks.read_table(path)


KINDS: dict[str, tuple[Callable[[Path], Path], Callable[[Path], object]]] = {
    "EXR": (exr, images.read),
    "PNG": (png, images.read_png),
    "PNG of the page": (png, figures.picture),
    "PPM": (ppm, images.read_ppm),
    "figure": (figure, contents.read),
    "ELF": (program, of_program),
    "blocks": (table, of_table),
}


@pytest.mark.parametrize("kind", KINDS)
def test_other_bytes(tmp_path_factory: pytest.TempPathFactory, kind: str) -> None:
    """In the head, where sizes are, as often as anywhere."""
    make, read = KINDS[kind]
    path = make(tmp_path_factory.mktemp("sound"))
    sound, name = path.read_bytes(), path.name
    read(path)
    head = mutations.bytes_like(sound[:300]).map(lambda made: made + sound[300:])

    @settings(max_examples=examples(200))
    @given(st.one_of(head, mutations.bytes_like(sound)))
    def every(made: bytes) -> None:
        path.write_bytes(made)
        mutations.held(lambda: read(path), name)

    every()


@pytest.mark.parametrize("kind", KINDS)
def test_no_file(tmp_path: Path, kind: str) -> None:
    read = KINDS[kind][1]
    (tmp_path / "folder.exr").mkdir()
    (tmp_path / "empty.exr").touch()
    for name in ("folder.exr", "empty.exr", "nowhere.exr"):
        with pytest.raises(StudyError):
            read(tmp_path / name)
        mutations.held(lambda name=name: read(tmp_path / name), name)


@pytest.mark.parametrize("kind", ["EXR", "PNG", "PNG of the page"])
def test_a_head_that_claims_gigabytes(tmp_path: Path, kind: str) -> None:
    """32768 × 32768 pixels in some hundred bytes."""
    make, _ = KINDS[kind]
    path = make(tmp_path)
    data, big = path.read_bytes(), 32768
    if kind == "EXR":
        for small in (23, 15):  # dataWindow and displayWindow: xMax, yMax
            data = data.replace(small.to_bytes(4, "little"), (big - 1).to_bytes(4, "little"))
    else:
        import zlib

        head = b"IHDR" + big.to_bytes(4, "big") * 2 + data[24:29]
        data = data[:12] + head + zlib.crc32(head).to_bytes(4, "big") + data[33:]
    path.write_bytes(data)
    call = {"EXR": "images.read", "PNG": "images.read_png", "PNG of the page": "figures.picture"}[kind]
    code = "from pathlib import Path; from study.pictures import images; from study.report import figures; "
    done = mutations.limited(f"{code}{call}(Path({str(path)!r}))")
    last = done.stderr.strip().splitlines()[-1]
    assert done.returncode == 1 and "StudyError" in last and path.name in last, done.stderr
