"""scripts/stepwise farm: shards on processes, one of which is killed."""

from __future__ import annotations

import contextlib
import json
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import processes
import pytest

from study.core import cli, commands
from study.core.cli import StudyError
from study.core.registry import ROOT
from study.experiments import venvs
from study.experiments.farm import measure as farm
from study.experiments.farm.schema import Farm

STEPWISE = ROOT / "scripts" / "stepwise"
# As accuracy --shard K/N, in half a second and without a picture. As `faults` says, the first worker to draw
# the shard `kill` is killed in it, and the worker `broken` can run nothing.
STAND_IN = """
import json, os, pathlib, signal, sys, time
words = dict(zip(sys.argv, sys.argv[1:]))
run, (number, of) = pathlib.Path(words["--run"]), map(int, words["--shard"].split("/"))
faults, here = json.loads({faults!r}), pathlib.Path({here!r})
run.mkdir(exist_ok=True)
if run.name == faults.get("broken"):
    sys.exit("no compiler")
time.sleep(0.5)
if number == faults.get("kill") and not (here / "killed").exists():
    (here / "killed").write_text(str(os.getpid()))
    os.kill(os.getppid(), signal.SIGKILL)
    time.sleep(60)
with open(here / "drawn", "a") as log:
    log.write(f"{{number}}\\n")
row = {{"phase": f"p{{number}}", "scene": "trio", "width": 4, "height": 2}}
row["false_hits_ppm"] = 0.0
made = {{"shard": {{"number": number, "of": of}}, "schema": 1, "rows": [row], "skipped": []}}
(run / f"accuracy.shard-{{number}}-of-{{of}}.json").write_text(json.dumps(made))
print("FAIL of 2" if number == 2 and faults.get("fail") else "", file=sys.stderr)
"""
WORDS = ["--phase", "opt1", "opt2", "opt3", "opt4", "--scene", "trio", "two_spheres"]  # 8 units of work
WHOLE = [
    {"phase": f"p{n}", "scene": "trio", "width": 4, "height": 2, "false_hits_ppm": 0.0} for n in range(1, 9)
]


@pytest.fixture(scope="module")
def dask() -> None:
    """Leaves a test out where Dask is neither there nor to be had."""
    try:
        farm.find_python(install=True)
    except StudyError as error:
        pytest.skip(str(error))


Call = Callable[..., tuple[Farm, Sequence[str]]]


@pytest.fixture
def farming(dask: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Call:
    """Calls the command with another program as the workers'; what it found, and what failed."""

    def call(script: str, workers: int = 4, scheduler: str = "", words: Sequence[str] = WORDS):
        path = tmp_path / "stand_in.py"
        path.write_text(script)
        monkeypatch.setattr(farm, "COMMAND", [sys.executable, str(path)])
        cluster = ["--scheduler", scheduler] if scheduler else ["--workers", str(workers)]
        own = ["accuracy", *cluster, "--run", str(tmp_path / "run")]
        outcome, _ = commands.called("farm", [*own, "--", *words])
        return outcome.result, outcome.failed

    return call


def stand_in(here: Path, **faults: object) -> str:
    return STAND_IN.format(faults=json.dumps(faults), here=str(here))


def drawn(here: Path) -> list[int]:
    """Shards in the order in which they were drawn, checks too."""
    return [int(line) for line in (here / "drawn").read_text().split()]


def rows(tmp_path: Path) -> list[dict[str, Any]]:
    return json.loads((tmp_path / "run" / "accuracy.json").read_text())["rows"]


@pytest.mark.slow
def test_a_worker_that_is_killed_loses_its_shard_alone(farming: Call, tmp_path: Path) -> None:
    found, failed = farming(stand_in(tmp_path, kill=3, fail=True))
    assert sum(worker.shards for worker in found.workers) == found.shards == 8
    assert failed == ["of 2"]  # a check of the experiment that failed on a worker
    assert sorted(drawn(tmp_path)) == list(range(1, 9)) and rows(tmp_path) == WHOLE
    assert processes.ends((tmp_path / "killed").read_text())  # the program went with its worker


@pytest.mark.slow
def test_a_worker_that_cannot_run_the_command_gets_no_more(farming: Call, tmp_path: Path) -> None:
    found, failed = farming(stand_in(tmp_path, broken="run-1"), workers=3)
    assert not failed and {worker.name for worker in found.workers} == {"0", "2"}
    assert rows(tmp_path) == WHOLE


@pytest.mark.slow
def test_a_shard_that_cannot_be_drawn_is_one_line(farming: Call) -> None:
    with pytest.raises(StudyError, match=r"shard [1-8]/8: worker [01]: status 3: "):
        farming("import sys\nsys.exit(print('no such luck', file=sys.stderr) or 3)", workers=2)


SCHEDULER = """
import sys
from distributed import LocalCluster
about = {"processes": False, "protocol": "tcp://", "dashboard_address": None, "memory_limit": 0}
made = LocalCluster(n_workers=2, threads_per_worker=int(sys.argv[1]), local_directory=sys.argv[2], **about)
print(made.scheduler_address, flush=True)
sys.stdin.read()
"""


@pytest.fixture
def scheduler(dask, tmp_path):
    """Starts a scheduler with two workers of so many threads; its address."""
    with contextlib.ExitStack() as stack:

        def start(threads: int) -> str:
            command = [venvs.python_of(farm.HOME), "-I", "-c", SCHEDULER, str(threads), str(tmp_path)]
            pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
            program = stack.enter_context(subprocess.Popen(command, **pipes))
            stack.callback(program.kill)
            return program.stdout.readline().strip()

        yield start


@pytest.mark.slow
def test_the_workers_of_a_scheduler_elsewhere(farming: Call, scheduler, tmp_path: Path) -> None:
    found, failed = farming(stand_in(tmp_path), scheduler=scheduler(1))
    assert (len(found.workers), failed) == (2, []) and rows(tmp_path) == WHOLE


@pytest.mark.slow
def test_a_worker_of_more_threads_than_one_is_refused(farming: Call, scheduler, tmp_path: Path) -> None:
    with pytest.raises(StudyError, match="--nthreads 1"):
        farming(stand_in(tmp_path), scheduler=scheduler(2))


@pytest.mark.slow
def test_joined_they_are_the_bytes_of_one_run(dask: None, tmp_path: Path) -> None:
    """Two phases of one scene by the real command, pictures too."""
    words = ["--phase", "baseline", "opt4", "--scene", "trio", "-n", "24"]
    commands.called("farm", ["accuracy", "--workers", "2", "--run", tmp_path / "run", "--", *words])
    commands.called("accuracy", [*words, "--run", tmp_path / "whole"])
    whole, joined = (tmp_path / name / "accuracy.json" for name in ("whole", "run"))
    assert joined.read_bytes() == whole.read_bytes()
    for row in rows(tmp_path):
        path = row["picture"]
        assert (tmp_path / "run" / path).read_bytes() == (tmp_path / "whole" / path).read_bytes()


@pytest.mark.slow
def test_a_scheduler_that_is_not_there_is_one_line(dask: None, tmp_path: Path) -> None:
    words = ["stability", "--scheduler", "nonsense", "--run", tmp_path, "--", "--case", "7"]
    with pytest.raises(StudyError, match="nonsense") as error:
        commands.called("farm", words)
    assert error.value.exit_status == cli.CANNOT_RUN


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["accuracy"], "--workers"),
        (["sweep", "--workers", "2"], "'sweep'"),
        (["accuracy", "--workers", "0"], "'0'"),
        (["accuracy", "--workers", "2", "--", "--phase", "opt99"], "'opt99'"),
        (["accuracy", "--workers", "2", "--", "--scenes"], "--scenes"),
        (["stability", "--workers", "2", "--", "--jobs", "3"], "--jobs"),
        (["stability", "--workers", "2", "--shards", "9", "--", "--case", "7"], "--shards 9"),
    ],
)
def test_bad_input_is_one_line(words: list[str], said: str, stepwise: Callable) -> None:
    done = stepwise("farm", *words)
    assert done.returncode == cli.BAD_INPUT and said in done.stderr.splitlines()[-1]


def test_without_dask_it_is_said_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(venvs, "has", lambda python, modules: False)
    with pytest.raises(StudyError, match="--install") as error:
        farm.find_python(install=False)
    assert error.value.exit_status == cli.CANNOT_RUN
