"""The SDE back end on files of the documented form (fixtures/sde/README.md), with a stand-in for sde64."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from study.core.cli import CANNOT_RUN, StudyError
from study.core.registry import find_scene
from study.counting import sde

FIXTURES = Path(__file__).resolve().parents[2] / "fixtures" / "sde"
MIX, MASKS = FIXTURES / "sde-mix-out.txt", FIXTURES / "sde-dyn-mask-profile.txt"
OPCODES = FIXTURES / "sde-mix-opcodes.txt"

# By hand from the files, threads 0 and 1, per precision and width: operations, of which FMA. Comparisons
# (25 scalar, 60 of 4 lanes, 7 of 8) are elements as well, and x87's 9 sums are none.
#   double  64: 1540 + 10, FMA 40                   double 256: 4·550, FMA 4·(200 + 50)
#   double 512: 8·220 unmasked (100 FMA, 120 add) + 250 masked, FMA 800 + 250
#   single 128: 4·30, all FMA                       single 512: 480 masked, all FMA
KNOWN = {
    ("any", "double", 64): 1510,
    ("fma", "double", 64): 40,
    ("any", "double", 256): 1200,
    ("fma", "double", 256): 1000,
    ("any", "double", 512): 960,
    ("fma", "double", 512): 1050,
    ("fma", "single", 128): 120,
    ("fma", "single", 512): 480,
    ("compare", "double", 64): 25,
    ("compare", "double", 256): 240,
    ("compare", "double", 512): 56,
    ("add", "extended", 80): 9,
}


def test_both_files() -> None:
    counts = sde.read(MIX, MASKS)
    assert dict(counts.lanes) == KNOWN
    assert counts.machine == 1510 + 1200 + 960 + 9 + 2 * (40 + 1000 + 1050 + 120 + 480)
    assert counts.instructions == 9460
    assert (counts.load, counts.store) == (4 * 10 + 8 * 500 + 32 * 50, 8 * 100)


def test_the_formula() -> None:
    """Σ n·elements + Σ lanes·FMA iforms + computations under masks, an FMA's once more."""
    elements = 1540 + 10 + 4 * 550 + 8 * 220 + 4 * 30
    fma = 40 + 4 * 250 + 4 * 30
    masked = 250 + 480
    assert sde.read(MIX, MASKS).machine == elements + fma + masked + (800 + 250 + 480) + 9


def test_opcodes_of_several_threads() -> None:
    """A file as SDE 9.24 writes it without -iform: names that begin with a digit, sections of functions, an
    empty section of the whole program before the whole one. By hand from it: sums 100 + 11, products 50,
    4·20 packed sums, 12 quotients; comparisons 25 + 8 + 3 scalar, 4·10 packed; x87's 5 products.
    """
    totals = [(one.thread, one.known["*total"]) for one in sde.sections(OPCODES)]
    assert totals == [(0, 1000), (1, 500), (None, 0), (None, 1500)]
    counts = sde.read_mix(OPCODES)
    assert counts.lanes == {
        ("any", "single", 32): 100 + 11 + 50,
        ("compare", "single", 32): 25,
        ("any", "single", 128): 4 * 20,
        ("compare", "single", 128): 4 * 10,
        ("any", "double", 64): 12,
        ("compare", "double", 64): 8 + 3,
        ("mul", "extended", 80): 5,
        ("compare", "extended", 80): 4,
    }
    assert counts.machine == 161 + 80 + 12 + 5
    assert (counts.instructions, counts.load, counts.store) == (1500, 4 * 330 + 576 * 2, 8 * 20)


@pytest.mark.parametrize(
    "old, new",
    [("EMIT #1", "EMIT# 1"), ("TID 0  OS-TID 411 EMIT #1", "TID   0   OS-TID 411   EMIT# 1"), ("\n", "\r\n")],
)
def test_older_spacings(tmp_path: Path, old: str, new: str) -> None:
    other = tmp_path / "mix"
    other.write_text(OPCODES.read_text("latin-1").replace(old, new))
    assert sde.read_mix(other) == sde.read_mix(OPCODES)


@pytest.mark.parametrize(
    "old, new, message",
    [
        ("NOP   ", "VFMADD231PS ", r":24: 686 VFMADD231PS of unknown width: .*; run sde64 with -iform 1"),
        ("NOP   ", "VFNMSUB132SD ", "VFNMSUB132SD of unknown width"),
        ("NOP   ", "VCMPPS ", "VCMPPS of unknown width"),
        ("EMIT_GLOBAL_DYN", "EMIT_OTHER_DYN", "cut off: the whole program's"),
        (" 500\n# END_DYN", " 501\n# END_DYN", r"\*total add up to 1501, the whole program's is 1500"),
    ],
)
def test_opcodes_that_do_not_do(tmp_path: Path, old: str, new: str, message: str) -> None:
    other = tmp_path / "mix"
    other.write_text(OPCODES.read_text("latin-1").replace(old, new))
    with pytest.raises(StudyError, match=message) as error:
        sde.read_mix(other)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("file", [MIX, MASKS], ids=["mix", "masks"])
@pytest.mark.parametrize("keep", [0.0, 0.3, 0.6])
def test_cut_off(tmp_path: Path, file: Path, keep: float) -> None:
    cut = tmp_path / file.name
    cut.write_text(file.read_text()[: int(len(file.read_text()) * keep)])
    files = (cut, MASKS) if file == MIX else (MIX, cut)
    with pytest.raises(StudyError, match=str(cut)) as error:
        sde.read(*files)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    "file, old, new, message",
    [
        (MIX, "#       iform ", "#       opcode ", r":\d+: .*: no table of iforms; run sde64 with -iform 1"),
        (MIX, "# EMIT_DYNAMIC_STATS", "# EMIT_STATIC_STATS", r"no '# EMIT_DYNAMIC_STATS FOR TID' section"),
        (MIX, "*mem-read-4 ", "mem read 4 ", r":\d+: not a name and a count"),
        (MIX, " 1565", " -1565", r":\d+: not a name and a count"),
        (MIX, "*total ", "*sum ", r"no instruction was counted"),
        (MIX, " 30\n", " 31\n", r"more FMA than operations in single, 128 bits"),
        (MASKS, "64b  fp |", "16b  fp |", r":\d+: elements of 16 bits"),
        (MASKS, "fp |         50", "fp |      fifty", r":\d+: not a row of the summary"),
        (MASKS, "   </summarytable>\n", "", r":\d+: .*out of place"),
        (MASKS, "</thread>\n", "", r":\d+: <thread> out of place"),
        (MASKS, "<computation-count> 800 ", "<computation-count> many ", r":\d+: an FMA without"),
    ],
)
def test_another_form(tmp_path: Path, file: Path, old: str, new: str, message: str) -> None:
    assert old in file.read_text()
    other = tmp_path / file.name
    count = -1 if old.startswith(("#", "*total")) else 1
    other.write_text(file.read_text().replace(old, new, count))
    files = (other, MASKS) if file == MIX else (MIX, other)
    with pytest.raises(StudyError, match=message):
        sde.read(*files)


def test_a_foreign_file(tmp_path: Path) -> None:
    (tmp_path / "binary").write_bytes(b"\xff\xfe\x00ELF")
    for path, message in [
        (Path(__file__), "no '# EMIT_DYNAMIC_STATS FOR TID' section"),
        (tmp_path / "binary", "not text"),
        (tmp_path / "none", "No such file or directory; run sde64 with -mix"),
    ]:
        with pytest.raises(StudyError, match=message):
            sde.read(path, MASKS)
    with pytest.raises(StudyError, match="no <thread> section"):
        sde.read(MIX, Path(__file__))


def test_without_sde(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("SDE_HOME", raising=False)
    with pytest.raises(StudyError, match="sde64 is not on PATH or in SDE_HOME: Intel SDE would") as error:
        sde.measure("opt3", find_scene("scene0").path, 12)
    assert error.value.exit_status == CANNOT_RUN
    monkeypatch.setenv("SDE_HOME", str(tmp_path / "sde"))
    assert str(tmp_path / "sde") in str(sde.available())


@pytest.fixture
def stand_in(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """An sde64 that runs the program and gives out the fixtures; its command line is in `asked`."""
    tool = tmp_path / "sde64"
    tool.write_text(
        f'#!/bin/sh\necho "$@" >{tmp_path}/asked\n'
        'while [ "$1" != -- ]; do\n'
        f'  case "$1" in -omix) cp {MIX} "$2";; -odyn_mask_profile) cp {MASKS} "$2";; esac\n'
        '  shift\ndone\nshift\nexec "$@"\n'
    )
    tool.chmod(0o755)
    monkeypatch.setenv("SDE_HOME", str(tmp_path))
    return tool


def test_the_run(stand_in: Path) -> None:
    found = sde.measure("opt3", find_scene("scene0").path, 12)
    assert dict(found.total.lanes) == KNOWN
    assert (found.backend, found.phase, found.scene, found.height) == ("sde", "opt3", "scene0", 12)
    assert found.calibrated is None  # not yet validated
    assert found.functions == {} and found.outside is None
    asked = (stand_in.parent / "asked").read_text()
    assert asked.startswith("-iform 1 -mix ")
    assert "start:address:phase_render,stop:address:render+0x" in asked
    address = int(asked.split("render+")[1].split()[0], 16)
    program = next(word for word in asked.split() if word.endswith("/render"))
    before = subprocess.run(
        ["objdump", "-d", f"--stop-address={address}", f"--start-address={address - 5}", program],
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    assert "<phase_render>" in before.splitlines()[-1]  # the call whose return stops the count


@pytest.mark.parametrize(
    "body, message",
    [
        ("echo no licence >&2; exit 7", r"render under SDE: exit status 7 \(no licence\)"),
        ("kill -SEGV $$", "render under SDE: killed by SIGSEGV"),
        ("exit 0", "sde-mix-out.txt: No such file"),
    ],
)
def test_a_run_that_fails(stand_in: Path, body: str, message: str) -> None:
    stand_in.write_text(f"#!/bin/sh\n{body}\n")
    with pytest.raises(StudyError, match=message):
        sde.measure("opt3", find_scene("scene0").path, 12)


@pytest.mark.skipif(sde.available() is not None, reason=str(sde.available()))
def test_for_real() -> None:
    """Where there is an SDE: its FLOPs are QEMU's, with libm, within what DPP and the like could add."""
    qemu = pytest.importorskip("study.counting.qemu")
    if qemu.available():
        pytest.skip(qemu.available())
    here, there = (m.measure("opt3", find_scene("scene0").path, 12) for m in (sde, qemu))
    expected = there.total.machine + sum(counts.machine for counts in (there.outside or {}).values())
    assert abs(here.total.machine - expected) <= 0.01 * expected
