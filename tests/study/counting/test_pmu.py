"""The PMU back end: recorded and documented output (fixtures/perf/README.md), events, a stand-in perf."""

from __future__ import annotations

import json
import math
import os
from pathlib import Path
from typing import Any

import pytest

from study.core import machine
from study.core.cli import StudyError
from study.core.registry import find_scene
from study.core.run import UNTIMED
from study.counting import pmu
from study.counting.counts import Measured

pytestmark = pytest.mark.slow

FILES = sorted(pmu.FOLDER.glob("*.json"))


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_events_file(path: Path) -> None:
    data = pmu.load(path)
    families = {*machine.INTEL, *machine.AMD, "Cascade Lake", "Cooper Lake"}
    assert set(data["microarchitectures"]) <= families
    for group in data["groups"]:
        counters = [name for name in group if name not in ("instructions", "cycles", "slots")]
        assert len(counters) <= 4  # with two hardware threads an Intel core has four that are free
    assert data["events"]["instructions"] and data["events"]["cycles"]
    assert len({event["perf"] for event in data["events"].values()}) == len(data["events"])
    for event in data["events"].values():
        assert "u" in event["perf"].split("/")[-1].split(":")[-1] or data["topdown"]["together"]


def test_every_microarchitecture_has_one_file() -> None:
    names = [name for path in FILES for name in pmu.load(path)["microarchitectures"]]
    assert len(names) == len(set(names)) >= 15
    assert pmu.events_for("Zen 5")["topdown"]["slots"].startswith("8 *")
    with pytest.raises(StudyError, match=r"no events file for Haswell \(there are .*Zen 4"):
        pmu.events_for("Haswell")
    with pytest.raises(StudyError, match="no events file for this processor"):
        pmu.events_for(None)


@pytest.mark.parametrize("name", ["skylake", "icelake", "sapphirerapids", "alderlake"])
def test_intel_flops(name: str) -> None:
    """Each event is weighted by the lanes of its width, and an FMA, counted twice by it, by nothing more."""
    data = pmu.load(pmu.FOLDER / f"{name}.json")
    for one in data["flops"]:
        lanes = one["bits"] // {"single": 32, "double": 64}[one["precision"]]
        scalar = one["bits"] == {"single": 32, "double": 64}[one["precision"]]
        event = f"fp_{'scalar' if scalar else str(one['bits']) + 'b'}_{one['precision']}"
        assert pmu.evaluate(one["lanes"], {event: 7.0}) == 7 * lanes
        assert one["kind"] == "any"
        source = data["events"][event]["source"]
        assert (
            source.endswith(one["precision"].upper())
            and str(one["bits"] if not scalar else "SCALAR") in source
        )
    sizes = {(one["precision"], one["bits"]) for one in data["flops"]}
    assert (("double", 512) in sizes) == (name != "alderlake")


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_topdown_adds_up(path: Path) -> None:
    """Level one of a made-up run is what its slots were made of, and leaves nothing out."""
    topdown = pmu.load(path)["topdown"]
    if path.stem == "zen2":
        assert topdown is None
        return
    width = {"zen4": 6, "zen5": 8}.get(path.stem, 4)
    cycles, retired, wrong, front, back, other = 1000.0, 0.4, 0.1, 0.2, 0.3 - 0.05, 0.05
    slots = width * cycles
    values = {
        "cycles": cycles,
        "slots": slots,
        "topdown_retiring": retired * slots,
        "topdown_bad_spec": wrong * slots,
        "topdown_fe_bound": front * slots,
        "topdown_be_bound": (back + other) * slots,
        "retire_slots": retired * slots,
        "uops_issued": (retired + wrong) * slots - width * 10,
        "recovery_cycles": 10.0,
        "uops_not_delivered": front * slots,
        "retired": retired * slots,
        "dispatched": (retired + wrong) * slots,
        "no_ops": front * slots,
        "backend_stalls": back * slots,
        "smt_contention": other * slots,
    }
    shares = {
        k: pmu.evaluate(f, values) for k, f in topdown.items() if k not in ("source", "together", "slots")
    }
    has_other = "the other thread" in shares
    expected = {"retiring": 0.4, "bad speculation": 0.1, "front-end bound": 0.2}
    expected |= {"back-end bound": 0.25, "the other thread": 0.05} if has_other else {"back-end bound": 0.3}
    assert shares == pytest.approx(expected, abs=1e-12)
    assert sum(shares.values()) == pytest.approx(1, abs=1e-12)
    assert pmu.evaluate(topdown["slots"], values) == slots


def test_formulas() -> None:
    assert pmu.evaluate("(a - 2 * b) / 4", {"a": 10, "b": 1}) == 2
    assert math.isnan(pmu.evaluate("a / b", {"a": 1, "b": 0}))
    for formula in ("a +", "__import__('os')", "a ** 2", "c", "a if b else 1", "'a'"):
        with pytest.raises(StudyError, match="formula"):
            pmu.evaluate(formula, {"a": 1, "b": 2})


@pytest.mark.parametrize(
    "change, message",
    [
        (lambda d: d.pop("source"), "must be an object of"),
        (lambda d: d["events"]["cycles"].pop("source"), "event cycles: 'perf' and 'source'"),
        (lambda d: d["groups"][0].append("sleep"), "groups: no event sleep"),
        (lambda d: d["events"].update(more={"perf": "r1", "source": "x"}), "in no group: more"),
        (lambda d: d["flops"][0].update(lanes="2 * nothing"), "nothing is neither event nor number"),
    ],
)
def test_a_wrong_events_file(tmp_path: Path, change: Any, message: str) -> None:
    data = json.loads((pmu.FOLDER / "zen4.json").read_text())
    change(data)
    path = tmp_path / "wrong.json"
    path.write_text(json.dumps(data))
    with pytest.raises(StudyError, match=message) as error:
        pmu.load(path)
    assert str(path) in str(error.value)


def test_available_says_why_not(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """On this machine, whichever way it is; without perf; and for an unknown processor."""
    works, reason = pmu.available()
    assert reason and "\n" not in reason and works in (True, False)
    monkeypatch.setattr(pmu.machine, "cpu", lambda: {"microarchitecture": "Ice Lake"})
    monkeypatch.setattr(pmu.perf, "program", lambda: None)
    works, reason = pmu.available()
    assert works is False and "perf is missing" in reason
    assert reason.startswith("no hardware counters here; they would add FLOPs, cycles and a top-down split")
    monkeypatch.setattr(pmu.machine, "cpu", lambda: {"microarchitecture": "Bonnell"})
    assert "no events file for Bonnell" in pmu.available()[1]


def stand_in(folder: Path, body: str) -> None:
    """A perf whose `stat` writes what `body` (Python) prints; E: events asked for, A: the command."""
    tool = folder / "perf"
    tool.write_text(
        "#!/usr/bin/env python3\nimport re, sys\n"
        "a = sys.argv\nif a[1:] == ['--version']:\n    sys.exit()\n"
        "E = a[a.index('-e') + 1]\nA = a[a.index('--') + 1 :]\n"
        "out = open(a[a.index('-o') + 1], 'w')\n"
        "events = re.findall(r'[^,{}/]+(?:/[^/]*/u?|:u)|[^,{}]+', E.removesuffix(':u').strip('{}'))\n"
        "print('# started\\n', file=out)\n" + body
    )
    tool.chmod(0o755)


@pytest.fixture
def ice_lake(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    monkeypatch.setattr(pmu.machine, "cpu", lambda: {"microarchitecture": "Ice Lake"})
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
    share = 60 if SHARED and '0x10' in event and not one else 100
    print(f'{value};;{event};{10**9};{share:.2f};;', file=out)
"""


@pytest.mark.parametrize("shared", [False, True])
def test_a_frame(ice_lake: Path, shared: bool) -> None:
    """Start and the driver's work per frame fall out: what is left is 251 of 252 pixels of each event."""
    stand_in(ice_lake, f"SHARED = {shared}\n{COUNTER}")
    found = pmu.read_frame("opt3", find_scene("scene0").path, 12)
    events = pmu.events_for("Ice Lake")["events"]

    def of(name: str) -> int:
        return 1000 * (sum(map(ord, events[name]["perf"])) % 97 + 1) * (21 * 12 - 1)

    assert found.events == {name: of(name) for name in events}
    lanes = found.measured.total.lanes
    assert lanes["any", "double", 256] == 4 * of("fp_256b_double")
    assert lanes["any", "single", 512] == 16 * of("fp_512b_single")
    assert found.measured.total.machine == sum(lanes.values())
    assert found.measured.total.instructions == of("instructions") and found.cycles == of("cycles")
    assert found.scaled == (["fp_256b_double"] if shared else [])
    assert "not yet validated" in found.remark and ("scaled" in found.remark) == shared
    assert found.measured.calibrated is None
    assert (found.measured.phase, found.measured.width, found.measured.height) == ("opt3", 21, 12)
    assert Measured.from_json(json.loads(json.dumps(found.measured.to_json()))) == found.measured
    assert found.topdown and found.topdown["retiring"] == of("topdown_retiring") / of("slots")


def test_what_is_counted_has_its_clocks_and_the_general_code(
    ice_lake: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As what is timed, whatever this process's environment says."""
    monkeypatch.setenv(UNTIMED, "1")
    monkeypatch.setenv("STEPWISE_CC", "gcc")
    stand_in(
        ice_lake,
        "import os\nfound = {k: os.environ.get(k) for k in ('STEPWISE_UNTIMED', 'STEPWISE_CC', 'LC_ALL')}\n"
        "if list(found.values()) != [None, 'none', 'C']:\n    sys.exit(str(found))\n"
        "for event in events:\n    print(f'7;;{event};1000;100.00;;', file=out)\n",
    )
    works, reason = pmu.available()
    assert works, reason


def test_a_perf_that_does_not_start_is_none(ice_lake: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As Ubuntu's, which looks for the running kernel's own and gives up with a warning."""
    stand_in(ice_lake, "")
    assert pmu.tool() == str(ice_lake / "perf")
    (ice_lake / "perf").write_text("#!/bin/sh\necho 'WARNING: perf not found for kernel 6.6' >&2\nexit 2\n")
    monkeypatch.setenv("PATH", str(ice_lake))
    monkeypatch.setattr(pmu.perf.Path, "glob", lambda *_: [])
    with pytest.raises(StudyError, match="perf is missing"):
        pmu.tool()


NOTHING = """
for event in events:
    print(f'0;;{event};1000;100.00;;', file=out)
"""
FEWER = """
reps = int(A[A.index('--reps') + 1])
for event in range(6):
    print(f'{9 - reps};;e{event};1000;100.00;;', file=out)
"""


@pytest.mark.parametrize(
    "body, message",
    [
        ("print('<not supported>;;instructions:u;0;100.00;;', file=out)", "1 events, 6 were asked for"),
        ("sys.exit('Error: perf_event_paranoid setting is 4')", "kernel.perf_event_paranoid is .*sysctl"),
        ('sys.exit("event syntax error\\n  \\\\___ Cannot find PMU `cpu\'. Missing")', "offers no counters"),
        ("sys.exit(9)", "perf stat render: exit status 9"),
        (FEWER, "6 in 3 frames and 8 in 1"),
        (NOTHING, "the counters read 0 FLOPs"),
    ],
)
def test_a_perf_that_refuses(ice_lake: Path, body: str, message: str) -> None:
    stand_in(ice_lake, body + "\n")
    with pytest.raises(StudyError, match=message) as error:
        pmu.measure("opt3", find_scene("scene0").path, 12)
    assert "\n" not in str(error.value) and "/tmp" not in str(error.value).replace(str(ice_lake), "")


def test_for_real() -> None:
    """Where there are counters: instructions of a frame are those that QEMU counts, libm with them."""
    qemu = pytest.importorskip("study.counting.qemu")
    works, reason = pmu.available()
    if not works or qemu.available():
        pytest.skip(reason if not works else qemu.available())
    here = pmu.measure("opt2", find_scene("scene0").path, 24)
    there = qemu.measure("opt2", find_scene("scene0").path, 24)
    expected = there.total.instructions + sum(c.instructions for c in (there.outside or {}).values())
    assert abs(here.total.instructions - expected) <= 0.05 * expected
