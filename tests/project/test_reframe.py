"""extras/reframe/sweep.py: a whole sweep by ReFrame, here or by a made-up Slurm that tells no exit status.
Left out where there is no ReFrame."""

from __future__ import annotations

import json
import os
import re
import subprocess
from pathlib import Path

import pytest

from study.core import registry
from study.core.cli import StudyError
from study.core.registry import ROOT
from study.experiments import venvs

HOME = ROOT / "build" / "reframe"
VERSION = "4.10.4"


@pytest.fixture(scope="module")
def reframe() -> Path:
    """Its program, put into build/reframe if need be."""
    program = venvs.python_of(HOME).with_name("reframe")
    if not program.exists():
        try:
            venvs.install(HOME, [f"reframe-hpc=={VERSION}"])
        except StudyError as error:
            pytest.skip(str(error))
    return program


CLUSTER = """site_configuration = {
    "systems": [{"name": "cluster", "hostnames": [".*"], "partitions": [
        {"name": "nodes", "scheduler": "squeue", "launcher": "local", "environs": ["none"]}]}],
    "environments": [{"name": "none"}]}"""
SLURM = {  # a job is done when it is submitted, and then squeue knows it no more
    "sbatch": """for script; do :; done
out=$(sed -n 's/^#SBATCH --output=//p' "$script"); err=$(sed -n 's/^#SBATCH --error=//p' "$script")
sh "$script" >"$out" 2>"$err"; echo Submitted batch job 7""",
    "squeue": "exit 0",
    "scontrol": "echo node1",
}


@pytest.fixture(params=["here", "squeue"])
def where(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Words for ReFrame: of its own scheduler, or of the backend that asks squeue."""
    if request.param == "here":
        return []
    (tmp_path / "bin").mkdir()
    for name, body in SLURM.items():
        (tmp_path / "bin" / name).write_text(f"#!/bin/sh\n{body}\n")
        (tmp_path / "bin" / name).chmod(0o755)
    (tmp_path / "cluster.py").write_text(CLUSTER)
    monkeypatch.setenv("PATH", f"{tmp_path / 'bin'}:{os.environ['PATH']}")
    return ["-C", str(tmp_path / "cluster.py")]


def run(program: Path, folder: Path, *more: str, **variables: object) -> subprocess.CompletedProcess:
    words = [program, *more, "-c", ROOT / "extras" / "reframe" / "sweep.py", "-r", "--nocolor"]
    words += [word for name, value in variables.items() for word in ("-S", f"{name}={value}")]
    return subprocess.run(words, cwd=folder, capture_output=True, text=True, timeout=300)


@pytest.mark.slow
def test_a_test_of_reframe_is_one_interleaved_sweep(reframe: Path, where: list[str], tmp_path: Path) -> None:
    done = run(reframe, tmp_path, *where, phases="opt1 opt2", scenes="trio", height=16, launches=2)
    assert done.returncode == 0, done.stdout + done.stderr
    figures = re.findall(r"^P: (\S+ \S+): (\S+) ms", done.stdout, re.MULTILINE)
    assert {name for name, _ in figures} == {"opt1 trio", "opt2 trio"}
    assert all(float(ms) > 0 for _, ms in figures)
    (frames,) = tmp_path.glob("output/*/*/*/Sweep/results/*/*/frames.jsonl")
    rows = [json.loads(line) for line in frames.read_text().splitlines()]
    order = list(dict.fromkeys((row["launch"], row["phase"]) for row in rows))
    assert [launch for launch, _ in order] == [0, 0, 1, 1]  # each round launches both
    assert registry.phases().keys() >= {phase for _, phase in order}


@pytest.mark.slow
@pytest.mark.parametrize("where", ["squeue"], indirect=True)
def test_a_sweep_that_fails_fails_the_test(reframe: Path, where: list[str], tmp_path: Path) -> None:
    """Though no exit status be told."""
    done = run(reframe, tmp_path, *where, phases="no_such_phase", scenes="trio", height=16, launches=2)
    assert done.returncode == 1, done.stdout + done.stderr
