"""extras/reframe/sweep.py: a whole sweep by ReFrame's local scheduler; left out where there is no ReFrame."""

from __future__ import annotations

import json
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


def run(program: Path, folder: Path, **variables: object) -> subprocess.CompletedProcess:
    words = [program, "-c", ROOT / "extras" / "reframe" / "sweep.py", "-r", "--nocolor"]
    words += [word for name, value in variables.items() for word in ("-S", f"{name}={value}")]
    return subprocess.run(words, cwd=folder, capture_output=True, text=True, timeout=300)


@pytest.mark.slow
def test_a_test_of_reframe_is_one_interleaved_sweep(reframe: Path, tmp_path: Path) -> None:
    done = run(reframe, tmp_path, phases="opt1 opt2", scenes="trio", height=16, launches=2)
    assert done.returncode == 0, done.stdout + done.stderr
    figures = re.findall(r"^P: (\S+ \S+): (\S+) ms", done.stdout, re.MULTILINE)
    assert {name for name, _ in figures} == {"opt1 trio", "opt2 trio"}
    assert all(float(ms) > 0 for _, ms in figures)
    (frames,) = tmp_path.glob("output/*/*/*/Sweep/results/*/*/frames.jsonl")
    rows = [json.loads(line) for line in frames.read_text().splitlines()]
    order = list(dict.fromkeys((row["launch"], row["phase"]) for row in rows))
    assert [launch for launch, _ in order] == [0, 0, 1, 1]  # each round launches both
    assert registry.phases().keys() >= {phase for _, phase in order}
