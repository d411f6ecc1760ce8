"""Tools that hang or die: their end is told in one line, and what they started ends with them."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import processes
import pytest

from study.core import build, progress, run
from study.core.cli import CANNOT_RUN, StudyError
from study.core.host import child
from study.core.registry import ROOT, Spec


def hanging(folder: Path, name: str = "tool") -> Path:
    """A tool whose child hangs with its output open, as gcc's cc1 would; the child's number is in `pid`."""
    tool = folder / name
    tool.write_text(f"#!/bin/sh\nsleep 600 &\necho $! >{folder}/pid\nwait\n")
    tool.chmod(0o755)
    return tool


def test_a_tool_that_hangs_goes_with_what_it_started(tmp_path: Path) -> None:
    begun = time.monotonic()
    with pytest.raises(StudyError, match=r"tool: .* 0\.5 s.*STEPWISE") as error:
        child.run([hanging(tmp_path)], capture_output=True, text=True, timeout=0.5)
    assert error.value.exit_status == CANNOT_RUN and time.monotonic() - begun < 30
    assert processes.ends((tmp_path / "pid").read_text().strip())


def test_as_subprocess_run_otherwise(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LC_ALL", "C")
    done = child.run(["cat"], input="käfig \u00d7", capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (0, "käfig \u00d7")
    assert child.run(["sh", "-c", "kill -SEGV $$"], capture_output=True).returncode == -signal.SIGSEGV
    with pytest.raises(subprocess.CalledProcessError):
        child.run(["false"], check=True)
    with pytest.raises(OSError):
        child.run(["/nowhere/tool"])
    monkeypatch.setenv(child.LIMIT, "soon")
    with pytest.raises(StudyError, match="STEPWISE_CHILD_SECONDS=soon"):
        child.seconds()


def test_a_compiler_that_hangs(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    hanging(tmp_path, "make")
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    monkeypatch.setenv(child.LIMIT, "0.5")
    monkeypatch.delenv(build.BUILT, raising=False)
    with pytest.raises(StudyError, match=r"make: .* 0\.5 s"):
        build._build.__wrapped__("opt1", "render", "build", ())
    with pytest.raises(StudyError, match=r"build: .* 0\.5 s"):
        build.build_together([(Spec("opt1", "opt1"), "render")], 1)
    assert processes.ends((tmp_path / "pid").read_text().strip())


def test_a_driver_that_hangs(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv(child.LIMIT, "0.5")
    lines = run._lines(["sh", "-c", "for i in 1 2 3; do echo $i; sleep 0.3; done; exec sleep 600"], None, 0)
    found = []
    with pytest.raises(run.DriverError, match=r"sh: .* 0\.5 s"):
        found += lines  # three lines, for longer than the limit: each sets the watch again
    lines = run._lines(["sh", "-c", "for i in 1 2 3; do echo $i; sleep 0.3; done"], None, 0)
    assert list(lines) == ["1\n", "2\n", "3\n"]


def test_work_that_stands_still(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(child.LIMIT, "0.5")
    sleeping = [sys.executable, "-c", "import time; time.sleep(600)"]
    with (
        subprocess.Popen(sleeping) as process,
        pytest.raises(StudyError, match=r"frames: .* 0\.5 s"),
    ):
        progress.until(process, "frames", lambda: 1, 2)
    assert process.returncode == -signal.SIGKILL


POOL = """
import sys, time
from concurrent.futures import ThreadPoolExecutor
from study.core import cli, run
from study.core.host import child

def one(number):
    if sys.argv[1] == "tool":
        child.run(["sleep", "20"])
    else:
        list(run._lines(["sleep", "20"], None, 0))

def main():
    with ThreadPoolExecutor(2) as pool:
        waiting = [pool.submit(one, number) for number in range(6)]
        print("begun", flush=True)
        waiting[0].result()

cli.main(main)
"""


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
@pytest.mark.parametrize("what", ["tool", "driver"])
def test_threads_start_nothing_more_once_a_signal_came(number: signal.Signals, what: str) -> None:
    """Six children of 20 s by two threads: all is over within the first's time."""
    begun = time.monotonic()
    with subprocess.Popen(
        [sys.executable, "-c", POOL, what],
        env=os.environ | {"PYTHONPATH": str(ROOT / "scripts")},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    ) as script:
        assert script.stdout and script.stdout.readline() == b"begun\n"
        time.sleep(0.5)
        script.send_signal(number)
        script.communicate(timeout=90)
    assert script.returncode == 128 + number
    assert time.monotonic() - begun < 19
