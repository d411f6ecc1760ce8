"""The SDE back end on files of the documented form (fixtures/sde/README.md), with a stand-in for sde64."""

import subprocess
from pathlib import Path

import pytest

from study.core.cli import CANNOT_RUN, StudyError
from study.core.registry import Spec, find_scene
from study.counting import sde
from study.counting.counts import Counts

FIXTURES = Path(__file__).resolve().parents[2] / "fixtures" / "sde"
MIX, MASKS = FIXTURES / "sde-mix-out.txt", FIXTURES / "sde-dyn-mask-profile.txt"
OPCODES = FIXTURES / "sde-mix-opcodes.txt"
OPT3, SCENE = Spec("opt3", "opt3"), find_scene("scene0")

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


def test_opcodes_of_several_threads() -> None:
    """A file as SDE 9.24 writes it without -iform: names that begin with a digit, sections of functions, an
    empty section of the whole program before the whole one. By hand from it: sums 100 + 11, products 50,
    4·20 packed sums, 12 quotients; comparisons 25 + 8 + 3 scalar, 4·10 packed; x87's 5 products.
    """
    totals = [(one.thread, one.total) for one in sde.sections(OPCODES)]
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
    ("file", "old", "new"),
    [
        (OPCODES, "NOP   ", "VFMADD231PS "),  # of unknown width, without iforms
        (OPCODES, "EMIT_GLOBAL_DYN", "EMIT_OTHER_DYN"),
        (OPCODES, " 500\n# END_DYN", " 501\n# END_DYN"),
        (MIX, "# EMIT_DYNAMIC_STATS", "# EMIT_STATIC_STATS"),
        (MIX, " 30\n", " 31\n"),  # more FMA than operations
        (MASKS, "</thread>\n", ""),
    ],
)
def test_another_form(tmp_path: Path, file: Path, old: str, new: str) -> None:
    assert old in file.read_text("latin-1")
    other = tmp_path / file.name
    other.write_text(file.read_text("latin-1").replace(old, new, 1))
    with pytest.raises(StudyError, match=str(other)):
        sde.read(MIX if file == MASKS else other, other if file == MASKS else MASKS)


@pytest.mark.parametrize("file", [MIX, MASKS], ids=["mix", "masks"])
@pytest.mark.parametrize("keep", [0.0, 0.6])
def test_cut_off(tmp_path: Path, file: Path, keep: float) -> None:
    cut = tmp_path / file.name
    cut.write_text(file.read_text()[: int(len(file.read_text()) * keep)])
    with pytest.raises(StudyError, match=str(cut)):
        sde.read(*((cut, MASKS) if file == MIX else (MIX, cut)))


def test_without_sde(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("SDE_HOME", raising=False)
    with pytest.raises(StudyError, match="SDE_HOME") as error:
        sde.measure(OPT3, SCENE, 12)
    assert error.value.exit_status == CANNOT_RUN


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


@pytest.mark.slow
def test_the_run(stand_in: Path) -> None:
    found = sde.measure(OPT3, SCENE, 12)
    assert Counts.of(found.total).lanes == KNOWN
    assert (found.backend, found.phase, found.scene, found.height) == ("sde", "opt3", "scene0", 12)
    assert found.calibrated is None and found.functions == {} and found.outside is None
    asked = (stand_in.parent / "asked").read_text()
    assert asked.startswith("-iform 1 -mix ")
    assert "start:address:phase_render,stop:address:render+0x" in asked
    address = int(asked.split("render+")[1].split()[0], 16)
    program = next(word for word in asked.split() if word.endswith("/render"))
    around = [f"--stop-address={address}", f"--start-address={address - 5}"]
    before = subprocess.check_output(["objdump", "-d", *around, program], text=True)
    assert "<phase_render>" in before.splitlines()[-1]  # the call whose return stops the count


def test_a_run_that_fails(stand_in: Path) -> None:
    stand_in.write_text("#!/bin/sh\necho no licence >&2; exit 7\n")
    with pytest.raises(StudyError, match=r"status 7 .*licence"):
        sde.measure(OPT3, SCENE, 12)
