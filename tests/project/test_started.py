"""The fork server that starts the tests' scripts: they see and leave what they would in a new Python."""

import os
import subprocess
import sys

import pytest
import started

SAYS = """
import atexit, os, sys
atexit.register(print, "at exit")
own = sorted(name for name in sys.modules if name.partition(".")[0] in ("study", "started", "pytest"))
print(sys.argv[1:], __name__, os.getcwd(), os.environ.get("STEPWISE_TOLD"), own, sys.path[0], len(os.environ))
print("an error", file=sys.stderr)
print(os.read(0, 1))
"""
ENDS = {
    "falls through": "",
    "a status": "sys.exit(3)",
    "none": "sys.exit()",
    "words": "sys.exit('words')",
    "a signal": "sys.stdout.flush(); os.kill(os.getpid(), 9)",
}


@pytest.mark.parametrize("end", ENDS)
def test_it_is_as_a_python_of_its_own(tmp_path, end):
    script = tmp_path / "script.py"
    script.write_text(SAYS + ENDS[end])
    command = [sys.executable, script, "one", "--two=3"]
    told = {**os.environ, "STEPWISE_TOLD": "yes"}
    mine = started.run(command, env=told, cwd=tmp_path)
    own = subprocess.run(
        command, env=told, cwd=tmp_path, stdin=subprocess.DEVNULL, capture_output=True, text=True
    )
    if end == "a signal":
        assert mine.returncode == own.returncode == -9
        return
    words = mine.stdout.replace("['started']", "[]")  # the one module that it cannot be without
    assert (mine.returncode, words, mine.stderr) == (own.returncode, own.stdout, own.stderr)
    assert "at exit" in own.stdout and "yes" in own.stdout


def test_an_exception_is_a_traceback_and_status_1(tmp_path):
    script = tmp_path / "script.py"
    script.write_text("raise ValueError('a bug')\n")
    done = started.run([sys.executable, script])
    assert done.returncode == 1 and "Traceback" in done.stderr and "ValueError: a bug" in done.stderr


def test_what_does_not_end_is_killed(tmp_path):
    script = tmp_path / "script.py"
    script.write_text("import time\ntime.sleep(60)\n")
    with pytest.raises(subprocess.TimeoutExpired):
        started.run([sys.executable, script], timeout=0.5)
