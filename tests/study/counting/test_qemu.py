"""The QEMU back end, for real: a program of known counts, the phases, and recordings that are none."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections import Counter
from pathlib import Path

import counted_region
import pytest
from counted_region import FIXTURES, KNOWN, SCALAR

from study.core.build import build
from study.core.cli import CANNOT_RUN, StudyError
from study.core.registry import Spec, find_scene
from study.counting import blocks, calibration, decode, elf, qemu, recording

REPEATS = 1000

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        qemu.available() is not None, reason=f"{qemu.EMULATOR} is missing: counts by emulation are not tested"
    ),
]


@pytest.fixture(scope="module")
def region(tmp_path_factory: pytest.TempPathFactory) -> str:
    return counted_region.compile(tmp_path_factory.mktemp("qemu"))


@pytest.mark.parametrize("callback", [False, True], ids=["inline", "callback"])
@pytest.mark.parametrize("part", KNOWN)
def test_known_counts(region: str, part: str, callback: bool) -> None:
    lanes, load, store = KNOWN[part]
    none = qemu.count([region, part, "0"], callback=callback).total
    some = qemu.count([region, part, str(REPEATS)], callback=callback).total
    assert none.lanes == SCALAR  # `scalar` at the region's end, and nothing of what is outside it
    assert some.lanes - none.lanes == Counter({key: n * REPEATS for key, n in lanes.items()})
    assert some.load - none.load == load * REPEATS
    assert some.store - none.store == store * REPEATS


def test_a_repeated_instruction_is_executed_once(region: str) -> None:
    """Whatever rcx is, zero too; `repeated` is one straight line."""
    program = elf.read(region)
    function = program.find("repeated")
    code = decode.Disassembler().decode(program.code_of(function), function.start)
    assert sum(one.repeat for one in code) == 4
    counts = qemu.count([region, "repeated", str(REPEATS)]).functions["repeated"]
    assert counts.instructions == REPEATS * len([one for one in code if one.mnemonic != "nop"])
    assert counts.calls == REPEATS


def test_calls_and_edges(region: str) -> None:
    """`first` falls into `second`, `hop` jumps to it: both count as its calls, the jump as an edge."""
    profile = qemu.count([region, "calls", str(REPEATS)])
    calls = {name: counts.calls for name, counts in profile.functions.items()}
    assert calls == {"phase_render": 1, "first": REPEATS, "second": 3 * REPEATS, "hop": REPEATS}
    assert profile.edges == {
        "phase_render": {"first": REPEATS, "second": REPEATS, "hop": REPEATS},
        "hop": {"second": REPEATS},
    }
    assert profile.functions["second"].by_kind() == {"mul": 3 * REPEATS}


def test_libm_stays_outside(region: str) -> None:
    profile = qemu.count([region, "libm", str(REPEATS)])
    (libm,) = (counts for name, counts in profile.outside.items() if name.startswith("libm"))
    assert profile.edges["phase_render"] == {"pow": REPEATS}
    assert libm.calls == REPEATS
    assert libm.machine > 10 * REPEATS  # a polynomial of some degree
    assert profile.total.by_kind()["add"] == REPEATS + 2  # the caller's own, and `scalar`'s two


@pytest.mark.parametrize(
    "part, message",
    [
        ("avx512", r"killed by SIGILL; QEMU has no AVX-512"),
        ("crash", r"killed by SIGSEGV"),
        ("leave", r"ended inside phase_render"),
        ("again", r"entered phase_render again"),
        ("thread", r"second thread"),
        ("nothing", r"never returned from phase_render"),
    ],
)
def test_programs_that_cannot_be_counted(region: str, part: str, message: str) -> None:
    with pytest.raises(StudyError, match=message) as error:
        qemu.count([region, part, "1"])
    assert "\n" not in str(error.value)


def test_a_stripped_or_foreign_program(region: str, tmp_path: Path) -> None:
    stripped = tmp_path / "stripped"
    subprocess.run(["strip", "-o", str(stripped), region], check=True)
    with pytest.raises(StudyError, match="has no symbols"):
        qemu.count([str(stripped), "scalar", "1"])
    (tmp_path / "cut").write_bytes(Path(region).read_bytes()[:5000])
    for path, message in [
        (FIXTURES / "region.c", "not a whole ELF"),
        (tmp_path / "cut", "not a whole ELF"),
        (tmp_path / "none", "No such file"),
    ]:
        with pytest.raises(StudyError, match=message):
            qemu.count([str(path), "scalar", "1"])
    with pytest.raises(StudyError, match="has no function nowhere"):
        qemu.count([region, "scalar", "1"], region="nowhere")
    with pytest.raises(StudyError, match="no direct call of _start"):
        qemu.count([region, "scalar", "1"], region="_start")


def test_without_qemu(region: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    tools = tmp_path / "bin"
    tools.mkdir()
    for tool in ("make", "cc", "gcc", "sh", "pkg-config", "python3"):
        if found := shutil.which(tool):
            (tools / tool).symlink_to(found)
    monkeypatch.setenv("PATH", str(tools))
    qemu.emulator.cache_clear()
    try:
        with pytest.raises(StudyError, match=r"qemu-x86_64 is missing .*qemu-user") as error:
            qemu.count([region, "scalar", "1"])
        assert error.value.exit_status == CANNOT_RUN
        assert "qemu-user" in str(qemu.available())
    finally:
        qemu.emulator.cache_clear()


def test_a_qemu_without_plugins(region: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    fake = tmp_path / "qemu-x86_64"
    fake.write_text("#!/bin/sh\necho 'qemu: unknown option plugin' >&2\nexit 1\n")
    fake.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}{os.pathsep}{os.environ['PATH']}")
    qemu.emulator.cache_clear()
    try:
        with pytest.raises(StudyError, match=r"exit status 1 \(qemu: unknown option plugin\)"):
            qemu.count([region, "scalar", "1"])
        fake.write_text("#!/bin/sh\nexit 0\n")
        with pytest.raises(StudyError, match=r"nothing was recorded.*plugins is required"):
            qemu.count([region, "scalar", "1"])
    finally:
        qemu.emulator.cache_clear()


def test_the_plugin_refuses_wrong_arguments(region: str) -> None:
    plugin = build("common", "qemu_plugin.so")  # type: ignore[arg-type]
    for options in ("", ",out=x,code=0,begin=1", ",out=x,code=0,begin=1,end=zz", ",out=x,speed=3"):
        done = subprocess.run(
            [qemu.EMULATOR, "-plugin", f"{plugin}{options}", region], capture_output=True, text=True
        )
        assert done.returncode != 0
        assert "qemu_plugin: " in done.stderr


@pytest.mark.parametrize("callback", [False, True], ids=["inline", "callback"])
@pytest.mark.parametrize("part", qemu.calibration_parts())
def test_calibration(part: str, callback: bool) -> None:
    """Operations, bytes, mix and calls of the known work, exactly; states are none of a calibration's."""
    program = str(build("calibration", "calibrate"))
    profile = qemu.count([program, part, "3"], callback=callback)
    assert calibration.differences(profile.functions, part, 3, profile.edges) == []
    known = calibration.expected(part, 3).values()
    assert sum(c.machine for c in known) == (profile.total.machine if known else 0)


def test_calibration_covers_what_qemu_can_run() -> None:
    assert {"scalar", "sse", "avx2", "x87", "string", "calls"} <= set(qemu.calibration_parts())
    assert qemu.calibrated() is True
    with pytest.raises(StudyError, match="second thread"):
        qemu.calibrate("threads")
    with pytest.raises(StudyError, match=r"calibrate under QEMU: exit status 3 .*lacks"):
        qemu.calibrate("avx512")


# What the plugin wrote of `region calls 2`, shortened.
RECORDING = (FIXTURES / "recording.txt").read_text() if (FIXTURES / "recording.txt").exists() else ""


def test_a_recording_is_read_whole(tmp_path: Path) -> None:
    path = tmp_path / "recording"
    path.write_text(RECORDING)
    found = recording.read(path)
    assert found.regions == 1
    assert len(found.blocks) + len(found.repeated) == int(RECORDING.split()[-1])
    assert all(block.count > 0 and block.code for block in found.blocks)


@pytest.mark.parametrize("keep", [0.0, 0.1, 0.5, 0.9, 0.99])
def test_a_truncated_recording(tmp_path: Path, keep: float) -> None:
    path = tmp_path / "recording"
    path.write_text(RECORDING[: int(len(RECORDING) * keep)])
    with pytest.raises(StudyError, match=rf"{path}:\d+: "):
        recording.read(path)


@pytest.mark.parametrize(
    "old, new",
    [
        ("stepwise-qemu 1", "stepwise-qemu 2"),
        ("start ", "begin "),
        ("regions 1", "regions one"),
        ("block ", "block -"),
        ("block ", "block x"),
        ("\nend ", "\nend 1"),
        ("\nend ", "\nblock 10 1 90\nend "),
        ("\nend ", "\nblock 10 0 90\nend "),
    ],
)
def test_a_foreign_recording(tmp_path: Path, old: str, new: str) -> None:
    assert old in RECORDING
    path = tmp_path / "recording"
    path.write_text(RECORDING.replace(old, new, 1))
    with pytest.raises(StudyError, match=rf"{path}:\d+: "):
        recording.read(path)


@pytest.mark.parametrize("name", ["baseline", "opt2", "opt3", "opt4"])
def test_a_phase(name: str) -> None:
    """Functions add up, and two runs agree in every count; libc's, of memory, hang on where it lies."""
    scene = find_scene("scene0")
    one, two = (qemu.measure(name, scene.path, 12) for _ in range(2))
    assert one.functions == two.functions and one.edges == two.edges
    assert (one.outside or {}).get("libm.so.6") == (two.outside or {}).get("libm.so.6")
    assert (one.phase, one.scene, one.width, one.height) == (name, "scene0", 21, 12)
    assert one.variant == "shipped" and one.backend == "qemu" and one.calibrated is True
    assert sum(c.machine for c in one.functions.values()) == one.total.machine > 1000 * 12 * 21
    assert sum(c.instructions for c in one.functions.values()) == one.total.instructions
    assert sum(one.total.mix.values()) == one.total.instructions
    assert one.functions["phase_render"].calls == one.total.calls == 1
    assert {p for _, p, _ in one.total.lanes} <= {"single", "double"}


@pytest.mark.parametrize("variant, target", [("shipped", "render"), ("calls", "render-calls")])
@pytest.mark.parametrize("name", ["baseline", "opt3", "opt4"])
def test_the_block_counters_agree(name: str, variant: str, target: str) -> None:
    """Two ways that share the decoder alone: every count of every function, and every edge, are the same."""
    if reason := blocks.missing():
        pytest.skip(reason)
    scene = find_scene("trio")
    here = qemu.measure(name, scene.path, 12, target=target)
    there = blocks.measure(name, scene.path, 12, variant=variant)
    assert here.variant == there.variant
    assert here.functions == there.functions
    assert here.total.to_json() | {"calls": 0} == there.total.to_json() | {"calls": 0}
    assert here.edges == {
        caller: {c: n for c, n in callees.items() if n}
        for caller, callees in there.edges.items()
        if any(callees.values())
    }


def test_pixels_are_calls() -> None:
    """Baseline calls `trace` once per pixel from phase_render, and itself for reflections."""
    found = qemu.measure("baseline", find_scene("scene0").path, 12)
    assert found.edges["phase_render"]["trace"] == 12 * 21
    assert found.functions["trace"].calls == 12 * 21 + found.edges["trace"]["trace"]
    assert found.outside
    libm = next(counts for name, counts in found.outside.items() if name.startswith("libm"))
    assert libm.calls == sum(
        n for callees in found.edges.values() for name, n in callees.items() if name not in found.functions
    )


def test_a_phase_that_qemu_cannot_run(monkeypatch: pytest.MonkeyPatch) -> None:
    phase = qemu.find_phase("opt4")
    wide = type(phase)(**{**vars(phase), "isa": ["avx2", "avx512f"]})
    monkeypatch.setattr(qemu, "find_phase", lambda name: wide)
    with pytest.raises(StudyError, match="opt4: needs avx512f, which QEMU does not have") as error:
        qemu.measure(Spec("opt4", "opt4"), find_scene("scene0").path, 12)
    assert error.value.exit_status == CANNOT_RUN


def test_the_drivers_refusal_is_told(tmp_path: Path) -> None:
    with pytest.raises(StudyError, match=r"render under QEMU: exit status 2 .*none.json"):
        qemu.measure("baseline", tmp_path / "none.json", 12)
