"""What perf stat prints: recorded and documented output (fixtures/perf/README.md), form by form."""

from __future__ import annotations

from pathlib import Path

import pytest

from study.core.cli import BAD_INPUT, CANNOT_RUN, StudyError
from study.counting.hardware import perf_stat

FIXTURES = Path(__file__).resolve().parents[2] / "fixtures" / "perf"
HARDWARE = ["instructions", "cycles", "fp_scalar_double", "fp_scalar_single"]


def test_recorded_software_events() -> None:
    found = perf_stat.parse(FIXTURES / "software.csv", ["clock", "faults", "switches"])
    assert found["clock"].value == 26.15 and found["faults"].value == 109
    assert all(line.enabled == 100 for line in found.values())


def test_recorded_without_counters() -> None:
    with pytest.raises(StudyError, match=r"csv:3: instructions:u is not supported") as error:
        perf_stat.parse(FIXTURES / "not-supported.csv", ["instructions", "cycles"])
    assert error.value.exit_status == CANNOT_RUN


def test_documented_hardware_events() -> None:
    found = perf_stat.parse(FIXTURES / "hardware.csv", HARDWARE)
    assert found["instructions"].value == 1.2e9
    assert [name for name, line in found.items() if line.enabled < 100] == ["fp_scalar_double"]


@pytest.mark.parametrize(
    "old, new, message",
    [
        ("1000;;cpu/event=0xc7,umask=0x01", "<not counted>;;cpu/event=0xc7,umask=0x01", r":5: .*not counted"),
        (";75.02", ";170.5", r":5: .*counted 170.5 %"),
        (";75.02", ";often", r":5: not a value"),
        ("500000000;;cyc", "18446744073709551000;;cyc", r":4: cycles:u: .* overflowed"),
        ("500000000;;cyc", "-5;;cyc", r":4: cycles:u: .* overflowed"),
        ("500000000;;cyc", "nan;;cyc", r":4: "),
        ("500000000;;cycles:u;400000000;100.00;;", "500000000,,cycles:u", r":4: not a line of perf stat"),
        ("2000;;cpu/event=0xc7,umask=0x02/u;400000000;100.00;;\n", "", r": 3 events, 4 were asked for"),
    ],
)
def test_output_that_cannot_be_used(tmp_path: Path, old: str, new: str, message: str) -> None:
    text = (FIXTURES / "hardware.csv").read_text()
    assert old in text
    path = tmp_path / "perf.csv"
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(StudyError, match=rf"{path}{message}"):
        perf_stat.parse(path, HARDWARE)


def test_foreign_output(tmp_path: Path) -> None:
    (tmp_path / "binary").write_bytes(b"\xff\xfe")
    for path, message in [
        (FIXTURES / "README.md", "0 events, 4 were asked for"),
        (tmp_path / "binary", "not text"),
        (tmp_path, "directory"),
    ]:
        with pytest.raises(StudyError, match=message):
            perf_stat.parse(path, HARDWARE)


TWO = ["instructions", "cycles"]
JSON = '{{"counter-value" : "{}", "unit" : "", "event" : "{}", "event-runtime" : {}, "pcnt-running" : {}{}}}'


def _json(value: str, event: str, runtime: str = "400000", share: str = "100.00", more: str = "") -> str:
    return JSON.format(value, event, runtime, share, more) + "\n"


@pytest.mark.parametrize(
    "text, instructions, cycles, least",
    [
        pytest.param(
            "1200,,instructions:u,400000,100.00,2.40,insn per cycle\n500,,cycles:u,400000,75.02,,\n",
            *(1200, 500, 75.02),
            id="commas",
        ),
        pytest.param(
            "1200,,cpu/event=0xc0,umask=0x01/u,400000,100.00,,\n"
            "500,,cpu/mem-loads,ldlat=30/P,400000,99.00,3,K/sec\n",
            *(1200, 500, 99),
            id="commas in events",
        ),
        pytest.param(
            "1200;;instructions:u;400000;100,00;2,40;insn per cycle\n500,5;msec;cycles:u;400000;75,02;;\n",
            *(1200, 500.5, 75.02),
            id="decimal commas",
        ),
        pytest.param(
            "1200;;instructions:u;0,41%;400000;100.00;;\n500;;cycles:u;12.00%;400000;80.00;;\n",
            *(1200, 500, 80),
            id="spread of repetitions",
        ),
        pytest.param(
            "# started on Fri\n\nWARNING: grouped events cpus do not match, event, a, b, c.\n"
            "1200;;instructions:u;400000;100.00;;\n"
            "Some events weren't counted. Try disabling the NMI watchdog:\n"
            "\techo 0 > /proc/sys/kernel/nmi_watchdog\n;;;;;0.42;insn per cycle\n"
            "500;;cycles:u;400000;100.00;;\n\tperf stat ...\n",
            *(1200, 500, 100),
            id="warnings between",
        ),
        pytest.param(
            "1200;;cpu_core/instructions/u;400000;100.00;;\n"
            "<not counted>;;cpu_atom/instructions/u;0;0.00;;\n"
            "<not supported>;;cpu_atom/cycles/u;0;0.00;;\n500;;cpu_core/cycles/u;400000;60.00;;\n",
            *(1200, 500, 60),
            id="hybrid",
        ),
        pytest.param(
            "1100;;instructions:u;400000;40.00;;\n"
            "500;;cycles:u;400000;90.00;;\n1200;;instructions:u;400000;80.00;;\n",
            *(1200, 500, 80),
            id="twice",
        ),
        pytest.param(
            "     1.000123456;1000;;instructions:u;400000;100.00;;\n"
            "     1.000123456;400;;cycles:u;400000;90.00;;\n"
            "     2.000234567;200;;instructions:u;400000;100.00;;\n"
            "     2.000234567;100;;cycles:u;400000;70.00;;\n",
            *(1200, 500, 70),
            id="intervals",
        ),
        pytest.param(
            "S0-D0-C0;2;1000;;instructions:u;400000;100.00;;\n"
            "S0-D0-C0;2;400;;cycles:u;400000;100.00;;\n"
            "S0-D0-C1;2;200;;instructions:u;400000;100.00;;\n"
            "S0-D0-C1;2;100;;cycles:u;400000;100.00;;\n",
            *(1200, 500, 100),
            id="cores",
        ),
        pytest.param(
            "1.000123456,S0,8,1000,,instructions:u,400000,100.00,,\n"
            "1.000123456,S0,8,400,,cycles:u,400000,100.00,,\n"
            "1.000123456,S1,8,200,,instructions:u,400000,100.00,,\n"
            "1.000123456,S1,8,100,,cycles:u,400000,100.00,,\n",
            *(1200, 500, 100),
            id="sockets of an interval",
        ),
        pytest.param(
            "CPU0;1000;;instructions:u;400000;100.00;;\nCPU13;200;;instructions:u;400000;100.00;;\n"
            "CPU0;400;;cycles:u;400000;100.00;;\nCPU13;100;;cycles:u;400000;100.00;;\n",
            *(1200, 500, 100),
            id="CPUs",
        ),
        pytest.param(
            "my render-41;1000;;instructions:u;400000;100.00;;\n"
            "my render-42;200;;instructions:u;400000;100.00;;\n"
            "my render-41;400;;cycles:u;400000;100.00;;\n"
            "my render-42;100;;cycles:u;400000;100.00;;\n",
            *(1200, 500, 100),
            id="threads",
        ),
        pytest.param(
            _json("1200.000000", "instructions:u") + _json("500.000000", "cycles:u", share="75.02"),
            *(1200, 500, 75.02),
            id="json",
        ),
        pytest.param(
            _json("1200,000000", "instructions:u", share="100,00")
            + _json("500,500000", "cycles:u", "400000100,00", "75,02", ', "metric-value" : 1,25'),
            *(1200, 500.5, 75.02),
            id="json, decimal commas",
        ),
        pytest.param(
            _json("1200.000000", "instructions:u").strip()
            + ' {"metric-value" : 237.2, "metric-unit" : "MB/s"} '
            + _json("500.000000", "cycles:u"),
            *(1200, 500, 100),
            id="json, several on a line",
        ),
        pytest.param(
            _json("<not counted>", "cpu_atom/instructions/u", "0", "0.00")
            + _json("1200.000000", "cpu_core/instructions/u")
            + _json("<not counted>", "cpu_atom/cycles/u", "0", "0.00")
            + _json("500.000000", "cpu_core/cycles/u"),
            *(1200, 500, 100),
            id="json, hybrid",
        ),
        pytest.param(
            "".join(
                _json(value, event).replace("{", f'{{"interval" : 1.0, "core" : "{core}", "counters" : 2, ')
                for core, event, value in [
                    ("S0-D0-C0", "instructions:u", "1000.0"),
                    ("S0-D0-C0", "cycles:u", "400.0"),
                    ("S0-D0-C1", "instructions:u", "200.0"),
                    ("S0-D0-C1", "cycles:u", "100.0"),
                ]
            ),
            *(1200, 500, 100),
            id="json, cores",
        ),
    ],
)
def test_forms(tmp_path: Path, text: str, instructions: float, cycles: float, least: float) -> None:
    path = tmp_path / "perf"
    path.write_text(text)
    found = perf_stat.parse(path, TWO)
    assert {name: line.value for name, line in found.items()} == {
        "instructions": instructions,
        "cycles": cycles,
    }
    assert min(line.enabled for line in found.values()) == least


@pytest.mark.parametrize(
    "text, message, status",
    [
        (
            "7,5,msec,clock,400000,100,00,,\n5,,cycles:u,400000,100,00,,\n",
            r":1: decimal commas between commas",
            BAD_INPUT,
        ),
        (
            _json("<not supported>", "instructions:u") + _json("5", "cycles:u"),
            ":1: .*not supported",
            CANNOT_RUN,
        ),
        (
            _json("5", "instructions:u") + _json("<not counted>", "cycles:u"),
            ":2: cycles:u was not counted",
            BAD_INPUT,
        ),
        (_json("5", "instructions:u") + '{"counter-value" : "5', ":2: not a JSON object", BAD_INPUT),
        (_json("5", "instructions:u"), ": 1 events, 2 were asked for", BAD_INPUT),
        (
            "7;;cpu_core/instructions/u;400000;60.00;;\n"
            "7;;cpu_atom/instructions/u;400000;40.00;;\n5;;cycles:u;4;9.00;;\n",
            "ran on two kinds of core .cpu_core/instructions/u 60 % and cpu_atom/inst.* 40 %.: pin it",
            BAD_INPUT,
        ),
        (
            "1.000123456;7;;instructions:u;4;9.00;;\n"
            "1.000123456;7;;cycles:u;4;9.00;;\n2.000123456;7;;instructions:u;4;9.00;;\n",
            "1 events, 2",
            BAD_INPUT,
        ),
    ],
)
def test_forms_that_do_not_do(tmp_path: Path, text: str, message: str, status: int) -> None:
    path = tmp_path / "perf"
    path.write_text(text)
    with pytest.raises(StudyError, match=message) as error:
        perf_stat.parse(path, TWO)
    assert (str(error.value).count("\n"), error.value.exit_status) == (0, status)
