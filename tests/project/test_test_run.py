"""tests/run.py and tests/builds.py: what is built, what is counted from JUnit XML, and how a run ends."""

from __future__ import annotations

import importlib.util
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import builds
from study.core import patches, registry
from study.core.registry import ROOT


@pytest.fixture(scope="module")
def runner():
    spec = importlib.util.spec_from_file_location("tests_run", ROOT / "tests" / "run.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules["tests_run"] = module  # its dataclasses look there
    spec.loader.exec_module(module)
    yield module
    del sys.modules["tests_run"]


XML = """<testsuites><testsuite>
<testcase classname="tests.phases.a" name="good" time="2"/>
<testcase classname="tests.phases.a" name="bad" time="30.5"><failure message="no"/></testcase>
<testcase classname="tests.phases.a" name="one[1]"><skipped message="no AVX-512"/></testcase>
<testcase classname="tests.phases.a" name="one[2]"><skipped message="no AVX-512"/></testcase>
<testcase classname="tests.study.core.a" name="other" time="1"><skipped message="no perf"/></testcase>
</testsuite></testsuites>"""


def summed(runner, suites: dict):
    total = runner.Tally()
    for tally in suites.values():
        total.add(tally)
    return total


def test_the_end_names_every_test_once_and_has_the_sums_last(runner, tmp_path: Path) -> None:
    (tmp_path / "a.xml").write_text(XML)
    suites = runner.read_results(tmp_path / "a.xml", "tests", ended_well=False)
    assert {name: (t.passed, len(t.failed), len(t.skipped)) for name, t in suites.items()} == {
        "phases": (1, 1, 2),
        "study/core": (0, 0, 1),
    }
    end = [
        "skipped 2: no AVX-512: phases.a::one[1], phases.a::one[2]",
        "skipped 1: no perf: study.core.a::other",
        "FAILED: phases.a::bad",
        f"1 min 15 s on {builds.JOBS} cores: builds 45 s, tests 30 s",
        "1 passed, 1 failed, 3 skipped",
    ]
    took = {"builds": 45.1, "tests": 30.2}
    total = summed(runner, suites)
    assert runner.told(total, took, slowest=0).splitlines() == end
    assert runner.told(total, took, slowest=2).splitlines() == [
        "slowest tests:",
        "   30.5 s  phases.a::bad",
        "    2.0 s  phases.a::good",
        *end,
    ]


def test_a_crash_and_a_bad_end_are_failures(runner, tmp_path: Path) -> None:
    def failed(name: str, ended_well: bool) -> int:
        return len(summed(runner, runner.read_results(tmp_path / name, "tests", ended_well)).failed)

    assert failed("none.xml", ended_well=True) == 1
    (tmp_path / "cut.xml").write_text(XML[:60])
    assert failed("cut.xml", ended_well=True) == 1
    (tmp_path / "good.xml").write_text('<testsuite><testcase name="good"/></testsuite>')
    assert failed("good.xml", ended_well=True) == 0
    assert failed("good.xml", ended_well=False) == 1


def test_a_part_that_fails_makes_the_whole_fail(runner, monkeypatch, capsys) -> None:
    def tally(passed: int, failed: list[str]):
        return lambda half, phase: {"suite": runner.Tally(passed=passed, failed=list(failed))}

    monkeypatch.setattr(sys, "argv", ["run.py", "quick"])
    monkeypatch.setattr(signal, "signal", lambda *_: None)
    for failed, status in (([], 0), (["one"], 1)):
        monkeypatch.setattr(runner, "PARTS", {"builds": tally(1, failed), "tests": tally(2, [])})
        assert runner.main() == status
        assert capsys.readouterr().out.splitlines()[-1] == f"3 passed, {len(failed)} failed, 0 skipped"


def test_what_failed_is_shown_without_the_dots(runner) -> None:
    log = "....F\n=== FAILURES ===\nassert 1 == 2\n=== short test summary info ===\nFAILED a\n"
    assert runner.failures(log) == "=== FAILURES ===\nassert 1 == 2"


def test_what_concerns_a_phase_names_it(runner) -> None:
    files = runner.concerning("opt7_tiles")
    assert "tests/phases/test_tiles.py" in files and "tests/systems/test_fixed.py" not in files


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
def test_what_was_started_ends_with_it(tmp_path: Path, how: signal.Signals) -> None:
    """Children of children too, even those that heed no signal but the last."""
    child = "trap '' INT TERM; echo $$ >>{0}/pids; while :; do sleep 1; done"
    (tmp_path / "both.sh").write_text(f"({child}) & {child}\n".format(tmp_path).replace("$$", "$BASHPID"))
    program = f"""
import signal, sys
sys.path.insert(0, {str(ROOT / "tests")!r})
import builds
for end in (signal.SIGINT, signal.SIGTERM):
    signal.signal(end, signal.default_int_handler)
builds.END = 0.5
builds.run(["bash", {str(tmp_path / "both.sh")!r}])
"""
    process = subprocess.Popen([sys.executable, "-c", program], stderr=subprocess.DEVNULL)
    pids = tmp_path / "pids"
    try:
        until = time.monotonic() + 30
        while not pids.exists() or len(pids.read_text().split()) < 2:
            assert time.monotonic() < until, "the children did not start"
            time.sleep(0.05)
        process.send_signal(how)
        assert process.wait(30) != 0
        assert [pid for pid in pids.read_text().split() if runs(pid)] == []
    finally:  # a failure leaves none of them
        process.kill()
        process.wait()
        for pid in pids.read_text().split() if pids.exists() else []:
            if runs(pid):
                os.kill(int(pid), signal.SIGKILL)


def runs(pid: str) -> bool:
    """Whether there is such a process that has not ended."""
    state = Path("/proc", pid, "stat")
    return state.exists() and state.read_text().rpartition(")")[2].split()[0] != "Z"


def test_every_program_of_the_builds_is_asked_of_one_make(tmp_path: Path, monkeypatch) -> None:
    """Each folder's make gets its settings and targets, and a make that fails makes the whole of it fail."""
    for name in ("CC", "MAKEFLAGS", "MFLAGS"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(builds, "ROOT", tmp_path)
    goal = "build/good build/clang/good c-tests:\n\t@echo $@ '$(CC)' '$(BUILD)' >>$(LOG)\n"
    (tmp_path / "Makefile").write_text(f"LOG := {tmp_path}/log\n{goal}")
    assert builds.make({"build": ["good"], "build/clang": ["good", "c-tests"]}, tmp_path)
    assert sorted((tmp_path / "log").read_text().splitlines()) == [
        "build/clang/good clang build/clang",
        "build/good cc build",
        "c-tests clang build/clang",
    ]
    assert not builds.make({"build": ["good", "bad"], "build/clang": ["good"]}, tmp_path)
    tests = {"a": {"build": ["good"]}, "b": {"build": ["good", "bad"]}, "c": {"build/clang": ["good"]}}
    assert builds.build(tests, {}, tmp_path) == ["b"]
    assert builds.build({"a": tests["a"]}, {}, tmp_path) == []


def test_what_the_tests_run_of_an_ablation_is_built() -> None:
    """A counting program only of one that declares FLOPs: nothing runs another (test_ablations)."""
    asked = set(builds.rest_needs()["build"])
    names = [f"{phase}+{title}" for phase in registry.phases() for title in patches.titles(phase)]
    assert names and {f"{name}/render" for name in names} <= asked
    counted = {word.partition("/")[0] for word in asked if re.search(r"\+.*/render-count", word)}
    assert {"baseline+3_inlined", "opt2+norm_bounds", "opt4+rsqrt"} <= counted
    assert not any(name.startswith(("opt6", "opt7", "opt8", "opt9")) for name in counted)


def test_every_phase_is_built_read_by_clang_and_sanitized() -> None:
    quick, rest = (builds.together(tests().values()) for tests in (builds.quick_tests, builds.rest_tests))
    for phase in registry.phases():
        assert {f"{phase}/render", f"{phase}/probe"} <= set(quick["build"])
        assert f"{phase}/syntax/read" in rest["build/clang"]
        assert {f"{phase}/render", f"{phase}/probe"} <= set(rest["build/asan"])


def test_the_halves_have_no_build_in_common() -> None:
    assert not builds.quick_tests().keys() & builds.rest_tests().keys()
