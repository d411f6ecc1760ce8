"""On a machine that is not x86-64: what counts its code is not there and says so; declared counts stand."""

from __future__ import annotations

import platform
import subprocess
import sys
from pathlib import Path

import pytest

from study.bounds import roof
from study.core import cli, commands, registry
from study.core.cli import StudyError
from study.core.registry import ROOT
from study.counting import flops, perf
from study.counting.schema import Declared, Flops
from study.experiments.flops import chapter
from study.experiments.packets import measure as packets


@pytest.fixture
def arm64(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(platform, "machine", lambda: "aarch64")


@pytest.fixture
def stated(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Phases whose counting build was asked; nothing is built."""
    asked: list[str] = []

    def declared(spec, scene, height, width=None, threads=1) -> Declared:
        asked.append(spec.phase)
        about = {"scene": scene.name, "width": 2 * height, "height": height, "by_function": {}}
        about |= {"by_class": {"compare": 0, "call": 0}, "executed": 100, "useful": 100, "useful_paper": 100}
        return Declared(phase=spec.phase, flops=Flops(paper=100, machine=100), **about)

    monkeypatch.setattr(flops, "declared", declared)
    return asked


@pytest.mark.parametrize("backend", ["blocks", "ptrace", "sde"])
def test_what_reads_x86_code_is_missing_in_one_line(arm64: None, backend: str) -> None:
    said = flops.missing(backend)
    assert said and "\n" not in said and backend in said and "aarch64" in said and "declared" in said


def test_declared_counts_are_made_and_the_rest_is_said(
    arm64: None, stated: list[str], tmp_path: Path
) -> None:
    (tmp_path / "plan.json").write_text("{}")
    words = ["--phase", "baseline", "opt4", "--scene", "scene0", "-n", "9", "--measure", "--run", tmp_path]
    outcome, _ = commands.called("flops", words)
    assert outcome.ended == cli.OK and sorted(stated) == ["baseline", "opt4"]
    assert [row.machine_convention_gflop for row in outcome.result["table1"]] == [1e-7, 1e-7]
    assert outcome.result["measured"] == [] and outcome.remarks == [flops.missing("blocks")]
    made = flops.read(tmp_path / "counts.json")
    assert len(made.declared) == 2 and not made.measured
    (table, *_) = chapter.counted(tmp_path).parts
    assert chapter.UNMEASURED in table.foot


@pytest.mark.parametrize(
    "words",
    [
        ["flops", "--validate", "--phase", "baseline"],
        ["flops", "--measure", "--backend", "ptrace", "--phase", "baseline"],
        ["hotspots", "--phase", "baseline"],
    ],
)
def test_what_needs_x86_cannot_run(
    arm64: None, stated: list[str], monkeypatch: pytest.MonkeyPatch, words: list[str]
) -> None:
    monkeypatch.setattr(perf, "missing", lambda: "no perf")  # asked later
    with pytest.raises(StudyError) as refused:
        commands.called(words[0], words[1:])
    assert refused.value.exit_status == cli.CANNOT_RUN and "aarch64" in str(refused.value)
    assert stated == []


def test_packets_are_timed_by_their_eight_lanes_alone(arm64: None, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry, "cpu_flags", lambda: frozenset({"asimd"}))
    assert [packets.able(limit) for limit in ("", "avx2", "none")] == [True, False, False]


def test_a_share_of_a_roof_says_that_its_counts_are_declared() -> None:
    class Point:
        backend, foreign_counts = roof.DECLARED, None
        share_of_fma_roof = share_of_mix_roof = share_of_avx2_roof = 0.5
        share_of_fma_peak = share_of_avx2_peak = float("nan")

    class Measured(Point):
        backend = "blocks"

    assert len(roof.remarks([Point()])) == 1 and roof.remarks([Point(), Measured()]) == []


WITHOUT = """
import sys
class Absent:
    def find_spec(self, name, *_):
        if name.partition(".")[0] in ("iced_x86", "flip_evaluator"):
            raise ModuleNotFoundError(name, name=name)
sys.meta_path.insert(0, Absent())
sys.path.insert(0, "scripts")
from study.core import commands
from study.experiments import experiment
from study.pictures import images
assert len(experiment.find_all()) > 20 and not images.HAS_FLIP
for command in commands.find_all().values():
    commands.parser_of(command)
"""


@pytest.mark.slow
def test_every_command_is_there_without_packages_that_have_no_wheel() -> None:
    done = subprocess.run([sys.executable, "-c", WITHOUT], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
