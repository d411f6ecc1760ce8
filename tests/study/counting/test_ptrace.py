"""The stepper, for real: known work, phases with 16 lanes next to the block counters, refusals."""

import subprocess
from pathlib import Path

import needs
import pytest

from study.core.cli import CANNOT_RUN, StudyError
from study.core.registry import ROOT, Spec, cpu_flags, find_scene
from study.counting import blocks, calibration, ptrace
from study.counting.schema import Executed

REGION = ROOT / "tests" / "fixtures" / "stepped" / "region.c"
POOL = {"workers_run", "draw_tiles", "take_tiles"}  # of common/workers: blocks do not see it


@pytest.fixture(scope="module", autouse=True)
def allowed() -> None:
    if reason := ptrace.missing():
        pytest.skip(reason)


@pytest.fixture(scope="module")
def region(tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("ptrace") / "region"
    subprocess.run(["cc", "-O2", REGION, "-o", path, "-lm", "-lpthread"], check=True)
    return str(path)


def test_what_this_machine_can_run_is_calibrated() -> None:
    """Operations (active lanes), bytes and instructions, by the table that is added up by hand."""
    for part in calibration.runnable():
        if part != "threads":
            assert ptrace.calibrate(part, 3) == []
    assert {"scalar", "sse", "x87", "string", "calls"} <= set(calibration.runnable())
    assert "second thread" in ptrace.calibrate("threads")[0]


def test_libm_is_told_apart(region: str) -> None:
    profile = ptrace.count([region, "libm", "3"])
    (libm,) = (counts for name, counts in profile.outside.items() if name.startswith("libm"))
    assert libm.machine > 30  # a polynomial of some degree, three times
    assert profile.total.lanes == {("add", "double", 64): 3}
    assert profile.functions.keys() == {"phase_render"}


@pytest.mark.parametrize(
    ("part", "said"),
    [
        ("crash", "killed by SIGSEGV"),
        ("leave", "ended inside"),
        ("again", "again before"),
        ("thread", "second thread"),
        ("nothing", "never returned"),
        ("status", "exit status 7"),
    ],
)
def test_programs_that_cannot_be_counted(region: str, part: str, said: str) -> None:
    with pytest.raises(StudyError, match=said):
        ptrace.count([region, part, "1"])


def test_a_stripped_or_foreign_program(region: str, tmp_path: Path) -> None:
    subprocess.run(["strip", "-o", tmp_path / "stripped", region], check=True)
    (tmp_path / "cut").write_bytes(Path(region).read_bytes()[:5000])
    for path, said in (
        (tmp_path / "stripped", "no symbols"),
        (tmp_path / "cut", "ELF"),
        (REGION, "ELF"),
        (tmp_path / "none", "No such file"),
        (Path("/proc/self/exe").resolve(), "symbols|phase_render"),
    ):
        with pytest.raises(StudyError, match=said):
            ptrace.count([str(path), "libm", "1"])


def numbers(one: Executed) -> dict[str, int]:
    found = {f"{o.kind} {o.precision} {o.bits}": o.lanes for o in one.operations}
    return found | {"instructions": one.instructions, "stored": one.store_bytes}


@pytest.mark.slow
@pytest.mark.parametrize("phase", ["opt4", "opt7_tiles", "opt9_convex"])
def test_the_block_counters_agree(phase: str) -> None:
    """Two ways that share the decoder alone, at the CPU's width: every number of every function."""
    needs.cpu_for(phase)
    spec, scene = Spec(phase, phase), find_scene("scene0" if phase == "opt9_convex" else "two_spheres")
    own, other = blocks.measure(spec, scene, 2), ptrace.measure(spec, scene, 2)
    assert own.total.machine == other.total.machine > 0 and other.calibrated is True
    assert own.functions.keys() == other.functions.keys() - POOL
    for name, one in own.functions.items():
        seen = other.functions[name]
        assert numbers(one) == numbers(seen), name
        # Blocks are decoded before the linker makes a LEA of an address's load out of a table.
        assert (one.load_bytes - seen.load_bytes) % 8 == 0 and one.load_bytes >= seen.load_bytes, name
    if phase != "opt4":
        widest = max(one.bits for one in other.total.operations)
        assert widest == (512 if "avx512f" in cpu_flags() else 256)


def test_where_ptrace_is_forbidden(monkeypatch: pytest.MonkeyPatch, region: str, tmp_path: Path) -> None:
    stepper = tmp_path / "stepper"
    stepper.write_text("#!/bin/sh\necho 'stepper: ptrace: Operation not permitted' >&2\nexit 3\n")
    stepper.chmod(0o755)
    monkeypatch.setattr(ptrace, "_stepper", lambda: stepper)
    with pytest.raises(StudyError, match="not permitted") as caught:
        ptrace.count([region, "libm", "1"])
    assert caught.value.exit_status == CANNOT_RUN
