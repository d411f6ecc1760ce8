"""The ptrace back end, for real: known work, phases with 16 lanes next to the block counters, refusals."""

from __future__ import annotations

import ctypes
import errno
import os
import struct
import subprocess
import sys
from collections import Counter
from pathlib import Path

import counted_region
import needs
import pytest
import started
from counted_region import KNOWN, SCALAR

from study.core.build import build
from study.core.cli import CANNOT_RUN, StudyError
from study.core.registry import ROOT, cpu_flags, find_scene
from study.counting import blocks, calibration, decode, ptrace, recording

REPEATS = 3
STEPWISE = [sys.executable, str(ROOT / "scripts" / "stepwise")]
POOL = {"workers_run", "draw_tiles", "take_tiles"}  # of common/workers: blocks do not see it
_LIBC = ctypes.CDLL(None, use_errno=True)


@pytest.fixture(scope="module", autouse=True)
def allowed() -> None:
    if reason := ptrace.available():
        pytest.skip(reason)


@pytest.fixture(scope="module")
def region(tmp_path_factory: pytest.TempPathFactory) -> str:
    return counted_region.compile(tmp_path_factory.mktemp("ptrace"))


@pytest.mark.parametrize("part", [part for part in calibration.parts() if part != "threads"])
def test_known_work_is_counted_exactly(part: str) -> None:
    """Operations (active lanes), bytes, mix and calls, by the table that is added up by hand."""
    if lacking := calibration.parts()[part]:
        pytest.skip(f"the CPU lacks {', '.join(lacking)}")
    assert ptrace.calibrate(part, REPEATS) == []


def test_what_this_machine_can_run_is_calibrated() -> None:
    assert {"scalar", "sse", "x87", "string", "calls"} <= set(ptrace.calibration_parts())
    assert ptrace.calibrated() is True
    with pytest.raises(StudyError, match="in single steps started a second thread"):
        ptrace.calibrate("threads")


@pytest.mark.parametrize("part", KNOWN)
def test_known_counts(region: str, part: str) -> None:
    """By fixtures/qemu/region.c: repeated instructions that end early or have nothing to do among them."""
    lanes, load, store = KNOWN[part]
    none = ptrace.count([region, part, "0"]).total
    some = ptrace.count([region, part, str(REPEATS)]).total
    assert none.lanes == SCALAR  # `scalar` at the region's end, and nothing of what is outside it
    assert some.lanes - none.lanes == Counter({key: n * REPEATS for key, n in lanes.items()})
    assert some.load - none.load == load * REPEATS
    assert some.store - none.store == store * REPEATS


def test_calls_edges_and_libm(region: str) -> None:
    profile = ptrace.count([region, "calls", str(REPEATS)])
    calls = {name: counts.calls for name, counts in profile.functions.items()}
    assert calls == {"phase_render": 1, "first": REPEATS, "second": 3 * REPEATS, "hop": REPEATS}
    assert profile.edges["hop"] == {"second": REPEATS}
    profile = ptrace.count([region, "libm", str(REPEATS)])
    (libm,) = (counts for name, counts in profile.outside.items() if name.startswith("libm"))
    assert libm.calls == REPEATS and libm.machine > 10 * REPEATS
    assert profile.edges["phase_render"] == {"pow": REPEATS}


@pytest.mark.parametrize(
    "part, message",
    [
        ("crash", r"region under single steps: killed by SIGSEGV"),
        ("leave", r"ended inside phase_render"),
        ("again", r"entered phase_render again"),
        ("thread", r"second thread"),
        ("nothing", r"never returned from phase_render"),
    ],
)
def test_programs_that_cannot_be_counted(region: str, part: str, message: str) -> None:
    with pytest.raises(StudyError, match=message) as error:
        ptrace.count([region, part, "1"])
    assert "\n" not in str(error.value)


def test_the_drivers_refusal_is_told(tmp_path: Path) -> None:
    with pytest.raises(StudyError, match=r"render under single steps: exit status 2 .*none.json"):
        ptrace.measure("baseline", tmp_path / "none.json", 2)


# --- phases


@pytest.mark.slow
@pytest.mark.parametrize("scene", ["scene0", "mandelbulb"])
@pytest.mark.parametrize("phase", ["opt6_wide", "opt7_tiles", "opt8_streams", "opt9_convex", "opt10_scene"])
def test_the_block_counters_agree(phase: str, scene: str) -> None:
    """Two ways that share the decoder alone, at the CPU's width: every number of every function."""
    needs.cpu_for(phase)
    path = find_scene(scene).path
    own, other = blocks.measure(phase, path, 2), ptrace.measure(phase, path, 2)
    assert own.total.machine == other.total.machine > 0 and other.calibrated is True
    assert own.functions.keys() == other.functions.keys() - POOL
    for name, counts in own.functions.items():
        linked = calibration.flat(other.functions[name])
        # Blocks are decoded before the linker makes a LEA of an address's load out of a table.
        if lea := counts.mix["move"] - other.functions[name].mix["move"]:
            for what, more in (("move", lea), ("integer", -lea), ("loaded", 8 * lea)):
                linked[what] = linked.get(what, 0) + more
        assert calibration.flat(counts) == linked and lea >= 0, name
        assert counts.doublings == other.functions[name].doublings, name
    assert sum(other.functions[name].machine for name in POOL & other.functions.keys()) == 0
    width = max(bits for _, _, bits in other.total.lanes)
    assert width == (512 if "avx512f" in cpu_flags() else 256)


@pytest.mark.slow
def test_it_validates_a_phase() -> None:
    words = ["--validate", "--backend", "ptrace", "--phase", "opt4", "--scene", "trio", "-n", "2"]
    done = started.run([*STEPWISE, "flops", *words])
    assert done.returncode == 0, done.stderr
    assert "calls by name: " in done.stdout


# --- where tracing is forbidden


def forbid_ptrace() -> None:
    """In a child: the kernel answers EPERM to ptrace, as containers have it (seccomp(2), a BPF program)."""
    load_number, is_ptrace, allow, refuse = (
        struct.pack("HBBI", 0x20, 0, 0, 0),
        struct.pack("HBBI", 0x15, 0, 1, 101),
        struct.pack("HBBI", 0x06, 0, 0, 0x7FFF0000),
        struct.pack("HBBI", 0x06, 0, 0, 0x00050000 | errno.EPERM),
    )
    program = ctypes.create_string_buffer(load_number + is_ptrace + refuse + allow)

    class Filter(ctypes.Structure):
        _fields_ = [("size", ctypes.c_ushort), ("code", ctypes.c_void_p)]

    made = Filter(4, ctypes.addressof(program))
    if _LIBC.prctl(38, 1, 0, 0, 0) or _LIBC.prctl(22, 2, ctypes.byref(made), 0, 0):
        os._exit(77)


def test_where_ptrace_is_forbidden_it_says_so_in_one_line() -> None:
    build("common", "stepper")
    command = [*STEPWISE, "flops", "--measure", "--backend", "ptrace", "--phase", "opt4", "-n", "2"]
    done = subprocess.run(command, capture_output=True, text=True, preexec_fn=forbid_ptrace)
    if done.returncode == 77:
        pytest.skip("this kernel has no seccomp filters")
    assert done.returncode == CANNOT_RUN
    (line,) = done.stderr.strip().splitlines()
    assert "ptrace is not allowed here (stepper: ptrace: Operation not permitted)" in line


# --- what the stepper writes


WHOLE = (
    "stepwise-steps 1\ntrouble none\nstart 1000\nregions 1\nmap 1000 2000 0 /a b\n"
    "block 1000 2 62f17d4958c1\nmasked 1000 2 2 4 4 4 4\nend 2\n"
)


def test_a_recording_is_read_whole(tmp_path: Path) -> None:
    (tmp_path / "r").write_text(WHOLE)
    found = recording.read(tmp_path / "r", "stepper")
    assert found.masked == {0x1000: [2, 2, 4, 4, 4, 4]} and found.maps == [(0x1000, 0x2000, 0, "/a b")]


def test_steps_are_joined_to_the_straight_line_that_they_are() -> None:
    """A copy and a sum x + x: known as one only in one block. A jump, a target, a repeated one end it."""
    move, add = (
        bytes.fromhex("c5fc28c8"),
        bytes.fromhex("c5f458d0"),
    )  # vmovaps ymm1, ymm0; vaddps ymm2, ymm1, ymm0
    jump, string = bytes.fromhex("eb00"), bytes.fromhex("f3aa")

    def blocks_of(*steps: tuple[int, int, bytes]) -> list[tuple[int, int]]:
        made = ptrace.joined(recording.Recording(0, 1, blocks=[recording.Block(*step) for step in steps]))
        return [(block.address, len(block.code)) for block in made.blocks]

    assert blocks_of((4, 9, add + b"\x90" * 11), (0, 9, move + add)) == [(0, 8)]
    assert decode.Disassembler().decode(move + add)[1].doubling
    assert blocks_of((0, 9, move), (4, 8, add)) == [(0, 4), (4, 4)]
    assert blocks_of((0, 9, move), (5, 9, add)) == [(0, 4), (5, 4)]
    assert blocks_of((0, 9, jump), (2, 9, add)) == [(0, 2), (2, 4)]
    assert blocks_of((0, 9, move), (4, 9, string), (6, 9, add)) == [(0, 4), (4, 2), (6, 4)]


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("steps 1", "qemu 1"),
        ("masked 1000 2", "masked 1000 -2"),
        (" 4 4\nend", " 4\nend"),
        ("end 2", "end 3"),
        ("end 2\n", ""),
    ],
)
def test_a_foreign_recording(tmp_path: Path, old: str, new: str) -> None:
    (tmp_path / "r").write_text(WHOLE.replace(old, new))
    with pytest.raises(StudyError, match=rf"{tmp_path}/r:\d+: "):
        recording.read(tmp_path / "r", "stepper")


@pytest.mark.parametrize(
    "arguments", [[], ["out", "x", "1", "1", "--", "true"], ["out", "1", "1", "1", "1-2"]]
)
def test_the_stepper_refuses_wrong_arguments(arguments: list[str]) -> None:
    done = subprocess.run([build("common", "stepper"), *arguments], capture_output=True, text=True)
    assert done.returncode == 2 and "is required" in done.stderr
