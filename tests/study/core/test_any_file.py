"""Whatever stands in a file of a run, or in what a tool wrote: it is read, or one line names it."""

from __future__ import annotations

import gzip
import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mutations
import pytest
from hypothesis import given, settings

from drawn import examples
from study.bounds import analysers, regions
from study.claims import claims
from study.commands import report
from study.core import json_files, provenance
from study.core.cli import StudyError
from study.core.registry import ROOT
from study.counting import assembly_source, recording, sde, symbols
from study.counting.counts import Counts
from study.counting.hardware import perf, perf_stat
from study.experiments import experiment
from study.numbers import analysis, ladder

FIXTURES = ROOT / "tests" / "fixtures"
RUNS = sorted(ROOT.glob("results/reference/*/context.json"))


# --- Files of a run


def smallest(name: str) -> Path | None:
    """The published file of that name that is the least work to read."""
    found = [json_files.stored(path.parent / name) for path in RUNS]
    return min((path for path in found if path.exists()), key=lambda path: path.stat().st_size, default=None)


SOUND = {name: FIXTURES / "run" / name for name in ("context.json", "plan.json", "verify.json")}
SOUND |= {
    name: path
    for one in experiment.find_all().values()
    for name in one.schemas
    if name.endswith(".json") and (path := smallest(name))
}


def read_run(folder: Path) -> None:
    """Everything that a report says of a run; figures are not drawn."""
    data = analysis.load(folder, strict=False)
    rows = ladder.rows(data)
    experiment.placed(data)
    claims.check(data, rows)
    report.headlines(rows)
    report.facts.machine(data)
    report.facts.commands(data)
    report.facts.skipped(data)
    provenance.need_clean(folder, True)
    provenance.disturbed(folder, [path.name for path in folder.glob("*.json")])


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("run")


@pytest.fixture(params=sorted(SOUND))
def sound(request: pytest.FixtureRequest) -> tuple[str, Any]:
    content = json_files.read_json(SOUND[request.param])
    if request.param == "stability.json":  # a curve is drawn of each case
        first = content["cases"][:1]
        rows = [row for row in content["results"] if row["number"] == first[0]["number"]]
        content |= {"cases": first, "results": rows}
    return request.param, content


def test_other_values(folder: Path, sound: tuple[str, Any]) -> None:
    name, content = sound

    @settings(max_examples=examples(40))
    @given(mutations.edits(content))
    def every(changes: Any) -> None:
        alone(folder, name, json.dumps(mutations.edited(content, changes)).encode())

    every()


def alone(folder: Path, name: str, text: bytes) -> None:
    """A run of that file alone, or beside the fixture's where it is one of those."""
    shutil.rmtree(folder)
    folder.mkdir()
    if name in ("context.json", "plan.json", "verify.json"):
        shutil.copy(FIXTURES / "run" / "frames.jsonl", folder)
    (folder / name).write_bytes(text)
    mutations.held(lambda: read_run(folder), name)


@pytest.mark.parametrize("name", ["context.json", "accuracy.json", "frames.jsonl"])
def test_other_bytes(folder: Path, name: str) -> None:
    sound = (FIXTURES / "run" / name if name == "frames.jsonl" else SOUND[name]).read_bytes()[:20000]

    @settings(max_examples=examples(100))
    @given(mutations.bytes_like(sound))
    def every(made: bytes) -> None:
        alone(folder, name, made)

    every()


def test_a_frame_of_other_values(folder: Path) -> None:
    """The first frame of the fixture's."""
    first, *rest = (FIXTURES / "run" / "frames.jsonl").read_text().splitlines(keepends=True)[:24]

    @settings(max_examples=examples(100))
    @given(mutations.edits(json.loads(first)))
    def every(changes: Any) -> None:
        made = json.dumps(mutations.edited(json.loads(first), changes))
        alone(folder, "frames.jsonl", f"{made}\n{''.join(rest)}".encode())

    every()


STRANGE = {
    "empty": b"",
    "BOM": b"\xef\xbb\xbf{}",
    "UTF-16": '{"a": 1}'.encode("utf-16"),
    "latin-1": b'{"a": "\xe4"}',
    "deep": b"[" * 100_000,
    "deep and whole": b'{"a":' * 300 + b"1" + b"}" * 300,
    "many digits": b'{"a": ' + b"9" * 5000 + b"}",
    "infinite": b'{"schema": 1e999}',
    "80 bits": b'{"schema": 1208925819614629174706176}',
    "NaN": b'{"schema": NaN}',
    "half a pair": b'{"a": "\\ud800"}',
    "null bytes": b"\0" * 100,
}


@pytest.mark.parametrize("text", STRANGE.values(), ids=STRANGE)
def test_strange_files(tmp_path: Path, text: bytes) -> None:
    """Refused by all: with the name, in one line."""
    for name in ("context.json", "accuracy.json", "frames.jsonl"):
        (tmp_path / name).write_bytes(text + b"\n")
        mutations.held(lambda: read_run(tmp_path), name)
        with pytest.raises(StudyError):
            json_files.read_json(tmp_path / name)
        (tmp_path / name).unlink()


def test_brackets_in_texts_are_no_depth(tmp_path: Path) -> None:
    (tmp_path / "a.json").write_text(json.dumps(['[{\\"[' * 300, {"a": "\\"}]))
    assert json_files.read_json(tmp_path / "a.json") == ['[{\\"[' * 300, {"a": "\\"}]


@pytest.mark.parametrize("name", ["context.json", "accuracy.json", "frames.jsonl"])
def test_no_file(tmp_path: Path, name: str) -> None:
    """A folder, a pipe that nobody writes into, a link to itself, a device without end, no permission."""
    file = tmp_path / name
    for make in (
        file.mkdir,
        lambda: os.mkfifo(file),
        lambda: file.symlink_to(file),
        lambda: file.symlink_to("/dev/zero"),
    ):
        make()
        mutations.held(lambda: read_run(tmp_path), name)
        file.rmdir() if file.is_dir() else file.unlink()
    if os.geteuid():
        file.touch(mode=0)
        mutations.held(lambda: read_run(tmp_path), name)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["counts.json.gz", "frames.jsonl.gz"])
def test_a_small_file_does_not_become_gigabytes(tmp_path: Path, name: str) -> None:
    """4 GiB of blanks in 4 MB."""
    one = gzip.compress(b" " * (1 << 26), mtime=0)
    (tmp_path / name).write_bytes(one * 64)
    code = f"from pathlib import Path; from study.core import store; here = Path({str(tmp_path)!r}); "
    code += "store.Run(here).frames()" if "frames" in name else "store.read_json(here / 'counts.json.gz')"
    done = mutations.limited(code)
    assert done.returncode == 1 and "StudyError" in done.stderr and name in done.stderr, done.stderr
    assert "larger than" in done.stderr


# --- What tools wrote


def text_of(data: bytes) -> str:
    """As study.core.host.child has it."""
    return data.decode("utf-8", "replace")


def counted(path: Path) -> object:
    """As both of SDE's files are read: masks beside the sound mix."""
    return sde.add_masks(Counts(), path)


SOURCE = """\t.text
\t.globl\tf
\t.type\tf, @function
f:
.LFB0:
\tpushq\t%rbx
\ttestl\t%edi, %edi
\tje\t.L2
\trep stosq
\tcall\tg@PLT
.L2:
\tvaddps\t%zmm1, %zmm2, %zmm0{%k1}
\tjmp\th
\t.size\tf, .-f
\t.section\t.rodata,"a"
\t.long\t1
"""
OBJDUMP = b"""
build/opt4/render:     file format elf64-x86-64

0000000000001000 <march>:
    1000:\tvsqrtps %ymm0,%ymm1
    1004:\tja     1000 <march>
    1006:\tret
"""
PERF = ["instructions:u", "cycles:u", "cpu/event=0xc7,umask=0x01/u", "cpu/event=0xc7,umask=0x02/u"]
JSON_STAT = b"".join(
    json.dumps(
        {"counter-value": "1000.0", "event": name, "event-runtime": 4 * 10**8, "pcnt-running": 100.0}
    ).encode()
    + b"\n"
    for name in PERF
)
TOOLS: dict[str, tuple[bytes | Path, Callable[[Path], object]]] = {
    "sde mix": (FIXTURES / "sde" / "sde-mix-out.txt", sde.read_mix),
    "sde masks": (FIXTURES / "sde" / "sde-dyn-mask-profile.txt", counted),
    "perf stat": (FIXTURES / "perf" / "hardware.csv", lambda path: perf_stat.parse(path, PERF)),
    "perf stat -j": (JSON_STAT, lambda path: perf_stat.parse(path, PERF)),
    "perf script": (
        FIXTURES / "hotspots" / "perf-script.txt",
        lambda p: perf.parse(text_of(p.read_bytes()), p.name),
    ),
    "addr2line": (
        FIXTURES / "hotspots" / "addr2line.txt",
        lambda p: symbols.parse_addr2line(text_of(p.read_bytes())),
    ),
    "llvm-mca": (
        FIXTURES / "bounds" / "llvm-mca.txt",
        lambda p: analysers.parse_mca(text_of(p.read_bytes())),
    ),
    "osaca": (
        FIXTURES / "bounds" / "osaca.yaml",
        lambda p: analysers.parse_osaca(text_of(p.read_bytes()), "SKX"),
    ),
    "objdump": (
        OBJDUMP,
        lambda p: regions.flow(regions.blocks_of(regions.parse_objdump(text_of(p.read_bytes())))),
    ),
    "qemu": (FIXTURES / "qemu" / "recording.txt", recording.read),
    "assembly": (SOURCE.encode(), lambda path: assembly_source.Source(path, 0).marked()),
}
NAMED = {
    "qemu": "written.txt|the program under QEMU",
    "perf script": "",
    "addr2line": "addr2line",
    "llvm-mca": "llvm-mca",
    "osaca": "osaca",
    "objdump": "objdump",
}


@pytest.mark.parametrize("name", TOOLS)
def test_output_of_a_tool(tmp_path_factory: pytest.TempPathFactory, name: str) -> None:
    source, read = TOOLS[name]
    sound = source if isinstance(source, bytes) else source.read_bytes()
    path = tmp_path_factory.mktemp("tool") / "written.txt"
    path.write_bytes(sound)
    read(path)

    @settings(max_examples=examples(300))
    @given(mutations.bytes_like(sound[:20000] if len(sound) > 40000 else sound))
    def every(made: bytes) -> None:
        path.write_bytes(made)
        mutations.held(lambda: read(path), NAMED.get(name, "written.txt"))

    every()
