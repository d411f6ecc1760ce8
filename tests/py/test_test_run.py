"""tests/run.py: what it counts from JUnit XML, and how it ends."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import pytest

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
<testcase classname="a.b" name="good"/>
<testcase classname="a.b" name="bad"><failure message="no"/></testcase>
<testcase classname="a.b" name="one[1]"><skipped message="no AVX-512"/></testcase>
<testcase classname="a.b" name="one[2]"><skipped message="no AVX-512"/></testcase>
<testcase classname="a.b" name="other"><skipped message="no perf"/></testcase>
</testsuite></testsuites>"""


def test_the_end_names_every_test_once_and_has_the_sums_last(runner, tmp_path: Path) -> None:
    (tmp_path / "a.xml").write_text(XML)
    total = runner.read_results(tmp_path / "a.xml", "py", ended_well=False)
    assert runner.told(total, ["builds 60 s", "py 30 s of 3 at once"], 75.4).splitlines() == [
        "skipped 2: no AVX-512: py: a.b::one[1], py: a.b::one[2]",
        "skipped 1: no perf: py: a.b::other",
        "FAILED: py: a.b::bad",
        f"1 min 15 s on {runner.JOBS} cores: builds 60 s, py 30 s of 3 at once",
        "1 passed, 1 failed, 3 skipped",
    ]


def test_a_crash_and_a_bad_end_are_failures(runner, tmp_path: Path) -> None:
    assert len(runner.read_results(tmp_path / "none.xml", "py", ended_well=True).failed) == 1
    (tmp_path / "cut.xml").write_text(XML[:60])
    assert len(runner.read_results(tmp_path / "cut.xml", "py", ended_well=True).failed) == 1
    (tmp_path / "good.xml").write_text('<testsuite><testcase name="good"/></testsuite>')
    assert runner.read_results(tmp_path / "good.xml", "py", ended_well=True).failed == []
    assert len(runner.read_results(tmp_path / "good.xml", "py", ended_well=False).failed) == 1


def test_every_program_of_the_builds_is_asked_of_one_make(runner, tmp_path: Path, monkeypatch) -> None:
    """Each folder's make gets its settings and targets, and a make that fails makes the whole of it fail."""
    for name in ("CC", "MAKEFLAGS", "MFLAGS"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(runner, "RESULTS", tmp_path)
    monkeypatch.setattr(runner, "ROOT", tmp_path)
    goal = "build/good build/clang/good:\n\t@echo $@ '$(CC)' '$(BUILD)' >>$(LOG)\n"
    (tmp_path / "Makefile").write_text(f"LOG := {tmp_path}/log\n{goal}")
    assert runner.make_all({"build": ["build/good"], "build/clang": ["build/clang/good"]})
    assert sorted((tmp_path / "log").read_text().splitlines()) == [
        "build/clang/good clang build/clang",
        "build/good cc build",
    ]
    assert not runner.make_all({"build": ["build/good", "build/bad"], "build/clang": ["build/clang/good"]})


def test_what_the_tests_run_of_an_ablation_is_built(runner) -> None:
    """And of one that declares no costs no counting program: nothing runs it (test_ablations)."""
    asked = set(runner.for_tests()["build"])
    names = [f"{phase}+{title}" for phase in registry.phases() for title in patches.titles(phase)]
    assert names
    for name in names:
        declared = "costs" not in patches.chain(name)[-1].head
        assert f"{name}/render" in asked
        for target in ("render-count", "render-blocks-calls"):
            assert (f"{name}/{target}" in asked) == declared, name


def test_clang_reads_what_it_does_not_build(runner) -> None:
    """rules.mk leaves variants that this CPU does not run out of what clang makes."""
    for phase, targets in runner.of_phases()["build/clang"].items():
        assert {"render", "read"} <= set(targets), phase
