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

import processes
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


CASE = '<testsuite><testcase classname="tests.{}" name="a">{}</testcase></testsuite>'


@pytest.mark.parametrize(
    ("text", "ended_well", "counts"),  # passed, failed, skipped
    [
        (CASE.format("phases.b", ""), True, {"phases": (1, 0, 0)}),
        (CASE.format("phases.b", ""), False, {"phases": (1, 0, 0), "tests": (0, 1, 0)}),
        (CASE.format("study.core.b", "<failure/>"), False, {"study/core": (0, 1, 0)}),
        (CASE.format("study.core.b", '<skipped message="no perf"/>'), True, {"study/core": (0, 0, 1)}),
        (CASE[:30], True, {"tests": (0, 1, 0)}),
        (None, True, {"tests": (0, 1, 0)}),
    ],
)
def test_results_by_suite_and_a_crash_is_a_failure(runner, tmp_path, text, ended_well, counts) -> None:
    if text:
        (tmp_path / "a.xml").write_text(text)
    suites = runner.read_results(tmp_path / "a.xml", "tests", ended_well)
    assert {name: (t.passed, len(t.failed), len(t.skipped)) for name, t in suites.items()} == counts


def test_a_part_that_fails_makes_the_whole_fail(runner, monkeypatch, capsys) -> None:
    def tally(passed: int, failed: list[str]):
        return lambda half, phase: {"suite": runner.Tally(passed=passed, failed=list(failed))}

    monkeypatch.setattr(sys, "argv", ["run.py", "quick"])
    monkeypatch.setattr(signal, "signal", lambda *_: None)
    for failed, status in (([], 0), (["one"], 1)):
        monkeypatch.setattr(runner, "PARTS", {"builds": tally(1, failed), "tests": tally(2, [])})
        assert runner.main() == status
        assert capsys.readouterr().out.splitlines()[-1] == f"3 passed, {len(failed)} failed, 0 skipped"


def test_what_concerns_a_phase_names_it(runner) -> None:
    files = runner.concerning("opt7_tiles")
    assert "tests/phases/test_tiles.py" in files and "tests/systems/test_fixed.py" not in files
    assert "tests/phases/fused/test_fused.py" in runner.concerning("opt12_fused")


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
            assert time.monotonic() < until, tmp_path
            time.sleep(0.05)
        process.send_signal(how)
        assert process.wait(30) != 0
        assert not any(map(processes.is_alive, pids.read_text().split()))
    finally:  # a failure leaves none of them
        process.kill()
        process.wait()
        for pid in pids.read_text().split() if pids.exists() else []:
            if processes.is_alive(pid):
                os.kill(int(pid), signal.SIGKILL)


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
