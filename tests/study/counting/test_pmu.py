"""Counts by perf stat: recorded and documented output (fixtures/perf/README.md), events, a stand-in perf."""

import os
from pathlib import Path

import pytest

from study.core import machine
from study.core.cli import CANNOT_RUN, StudyError
from study.core.registry import Spec, find_scene
from study.core.run_schema import Cpu
from study.counting import pmu

FIXTURES = Path(__file__).resolve().parents[2] / "fixtures" / "perf"
OPT3, SCENE = Spec("opt3", "opt3"), find_scene("scene0")


def test_recorded_software_events() -> None:
    found = pmu.parse((FIXTURES / "software.csv").read_text(), ["clock", "faults", "switches"])
    assert found["clock"] == 26.15 and found["faults"] == 109


def test_documented_hardware_events() -> None:
    names = ["instructions", "cycles", "fp_scalar_double", "fp_scalar_single"]
    assert pmu.parse((FIXTURES / "hardware.csv").read_text(), names)["instructions"] == 1.2e9


@pytest.mark.parametrize(
    ("text", "said", "status"),
    [
        ("<not supported>;;instructions:u;0;100.00;;", "not supported", CANNOT_RUN),
        ("<not counted>;;cpu_core/cycles/u;0;0.00;;", "not counted", 2),
        ("many;;instructions:u;0;100.00;;", "no number", 2),
        (";;;;;0.42;insn per cycle", "0 events, 1", 2),
        ("1;;a;1;100;;\n2;;b;1;100;;", "2 events, 1", 2),
    ],
)
def test_output_that_cannot_be_used(text: str, said: str, status: int) -> None:
    with pytest.raises(StudyError, match=said) as error:
        pmu.parse(text, ["instructions"])
    assert error.value.exit_status == status


def test_of_a_group_the_event_is_named_that_the_cpu_does_not_have() -> None:
    """perf counts none of a group that holds one: those stand before and behind it."""
    events = ("instructions:u", "cycles:u", "fp_ret:u", "stalls:u")
    lines = [
        f"<not {'supported' if event == 'fp_ret:u' else 'counted'}>;;{event};0;100.00;;" for event in events
    ]
    with pytest.raises(StudyError, match=r"fp_ret:u") as error:
        pmu.parse("\n".join(lines), events)
    assert error.value.exit_status == CANNOT_RUN


@pytest.mark.parametrize(
    ("text", "forbids"), [("2\n", False), ("-1", False), ("3", True), ("", True), ("?", True)]
)
def test_what_the_kernel_lets_users_count(text: str, forbids: bool, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(pmu.perf, "PARANOID", tmp_path / "paranoid")
    (tmp_path / "paranoid").write_text(text)
    assert (pmu.perf.forbidden() is not None) == forbids


def test_every_events_file() -> None:
    """Groups and FLOPs name its events, groups fit the counters, no microarchitecture has two files."""
    families = {*machine.INTEL, *machine.AMD, "Cascade Lake", "Cooper Lake"}
    names = [name for one in pmu.every() for name in one.microarchitectures]
    assert len(names) == len(set(names)) >= 15 and set(names) <= families
    for one in pmu.every():
        counted = {"instructions", "cycles"}
        assert {name for group in one.groups for name in group} == one.events.keys()
        assert {flop.event for flop in one.flops} | counted == one.events.keys()
        for group in one.groups:  # with two hardware threads an Intel core has four that are free
            assert len(set(group) - counted) <= 4
        assert len({event.perf for event in one.events.values()}) == len(one.events)


def test_a_processor_without_events_is_named() -> None:
    for name in ("Haswell", None):
        with pytest.raises(StudyError, match=f"{name or 'this processor'} .*Zen 4") as error:
            pmu.events_for(name)
        assert error.value.exit_status == CANNOT_RUN


@pytest.mark.parametrize("name", ["Skylake", "Ice Lake", "Sapphire Rapids", "Alder Lake"])
def test_intel_flops(name: str) -> None:
    """Each event is weighted by the lanes of its width, and an FMA, counted twice by it, by nothing more."""
    for one in pmu.events_for(name).flops:
        element = {"single": 32, "double": 64}[one.precision]
        assert one.event == f"fp_{'scalar' if one.bits == element else f'{one.bits}b'}_{one.precision}"
        assert one.lanes == one.bits // element and one.kind == "any"


def stand_in(folder: Path, body: str) -> None:
    """A perf whose `stat` writes what `body` (Python) prints; E: events asked for, A: the command."""
    tool = folder / "perf"
    tool.write_text(
        "#!/usr/bin/env python3\nimport os, re, sys\n"
        "a = sys.argv\nif a[1:] == ['--version']:\n    sys.exit()\n"
        "E = a[a.index('-e') + 1]\nA = a[a.index('--') + 1 :]\n"
        "out = open(a[a.index('-o') + 1], 'w')\n"
        "events = re.findall(r'[^,{}/]+(?:/[^/]*/u?|:u)|[^,{}]+', E.removesuffix(':u').strip('{}'))\n"
        "print('# started\\n', file=out)\n" + body
    )
    tool.chmod(0o755)


@pytest.fixture
def ice_lake(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    monkeypatch.setattr(pmu.machine, "cpu", lambda: Cpu(microarchitecture="Ice Lake"))
    monkeypatch.setattr(pmu, "cpu_flags", lambda: frozenset({"avx512f"}))
    monkeypatch.setenv("PATH", f"{tmp_path}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.setattr(pmu.perf, "program", pmu.perf.program.__wrapped__)
    return tmp_path


# Events of a made-up processor: a start, so much a frame, so much a pixel and frame, each event its own.
COUNTER = """
reps = int(A[A.index('--reps') + 1])
one = '-w' in A and A[A.index('-w') + 1] == '1'
pixels = 1 if one else 21 * 12
for number, event in enumerate(events, 1):
    per_pixel = 1000 * (sum(map(ord, event)) % 97 + 1)
    value = 777 + reps * (50000 + per_pixel * pixels)
    print(f'{value};;{event};{10**9};100.00;;', file=out)
"""


@pytest.mark.slow
def test_a_frame(ice_lake: Path) -> None:
    """Start and the driver's work per frame fall out: what is left is 251 of 252 pixels of each event."""
    stand_in(ice_lake, COUNTER)
    found = pmu.measure(OPT3, SCENE, 12)
    events = pmu.events_for("Ice Lake").events
    wanted = {name: 1000 * (sum(map(ord, one.perf)) % 97 + 1) * (21 * 12 - 1) for name, one in events.items()}
    lanes = {(one.precision, one.bits): one.lanes for one in found.total.operations}
    assert lanes["double", 256] == 4 * wanted["fp_256b_double"]
    assert lanes["single", 512] == 16 * wanted["fp_512b_single"]
    assert found.total.instructions == wanted["instructions"]
    assert found.calibrated is None and found.size == (21, 12)


def test_what_is_counted_has_its_clocks_and_the_general_code(
    ice_lake: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As what is timed, whatever this process's environment says."""
    monkeypatch.setenv("STEPWISE_CC", "gcc")
    stand_in(
        ice_lake,
        "if [os.environ.get(k) for k in ('STEPWISE_CC', 'LC_ALL')] != ['none', 'C']:\n    sys.exit(1)\n"
        "for event in events:\n    print(f'7;;{event};1000;100.00;;', file=out)\n",
    )
    assert pmu.missing() is None


def test_a_perf_that_refuses(ice_lake: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pmu, "_arguments", lambda *_, **__: ["true"])
    stand_in(ice_lake, "sys.exit('Cannot find PMU `cpu`')\n")
    with pytest.raises(StudyError, match="Cannot find PMU") as error:
        pmu.measure(OPT3, SCENE, 12)
    assert error.value.exit_status == CANNOT_RUN


def test_counters_that_stand_still(ice_lake: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def nothing(_: object, names: list[str], *__: object) -> dict[str, float]:
        return dict.fromkeys(names, 0.0)

    monkeypatch.setattr(pmu, "_arguments", lambda *_, **__: [])
    monkeypatch.setattr(pmu, "_stat", nothing)
    with pytest.raises(StudyError, match="read 0") as error:
        pmu.measure(OPT3, SCENE, 12)
    assert error.value.exit_status == CANNOT_RUN


def test_without_perf(ice_lake: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ubuntu's looks for the running kernel's own and gives up with a warning."""
    (ice_lake / "perf").write_text("#!/bin/sh\nexit 2\n")
    monkeypatch.setenv("PATH", str(ice_lake))
    monkeypatch.setattr(pmu.perf.Path, "glob", lambda *_: [])
    assert "perf is missing" in str(pmu.missing())
