"""Runs another program to its end, which comes in time: a child that hangs is killed with all it started."""

import contextlib
import math
import os
import signal
import subprocess
import threading
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from study.core import cli
from study.core.cli import CANNOT_RUN, StudyError
from study.core.host import sandbox

SECONDS = 3600.0  # of one program; a compiler or a tool takes minutes
LIMIT = "STEPWISE_CHILD_SECONDS"


def seconds(usual: float = SECONDS) -> float:
    """What a child may take, by the environment or as usual. StudyError for no number."""
    text = os.environ.get(LIMIT)
    with contextlib.suppress(ValueError):
        if (limit := float(text) if text else usual) > 0:
            return limit
    raise StudyError(f"{LIMIT}={text}: must be a number of seconds above 0")


def overdue(name: object, limit: float) -> StudyError:
    return StudyError(
        f"{Path(str(name)).name}: no end after {limit:g} s; killed ({LIMIT} allows more)", CANNOT_RUN
    )


_live: set[int] = set()  # process groups: they do not see a terminal's Ctrl-C by themselves
_ending = threading.Event()


def _end_all() -> None:
    """SIGTERM, at which make removes what is half made. Threads that still work start nothing more."""
    _ending.set()
    for group in list(_live):
        with contextlib.suppress(ProcessLookupError):
            os.killpg(group, signal.SIGTERM)


cli.at_signal(_end_all)


def may_start() -> None:
    """Is called before a child starts. StudyError once a signal ends the script: nobody waits for more."""
    if _ending.is_set():
        raise StudyError("nothing more is started: the script is ending", CANNOT_RUN)


class NotPinned(StudyError):
    """A program did not start since it may not run on the CPUs that it was to be pinned to."""

    def __init__(self, name: object) -> None:
        now = ", ".join(map(str, sorted(os.sched_getaffinity(0))))
        super().__init__(
            f"{Path(str(name)).name}: cannot be pinned as the run began; the CPUs that may be used "
            f"(taskset, cpuset) are now {now}",
            CANNOT_RUN,
        )


@contextlib.contextmanager
def started(command: Sequence[str | Path], **options: Any) -> Iterator[subprocess.Popen]:
    """The program in a process group of its own, which ends with the script, and with an exception. NotPinned
    where the CPUs that it was to be pinned to may no longer be used."""
    may_start()
    try:
        child = subprocess.Popen(sandbox.around(command), process_group=0, **options)
    except subprocess.SubprocessError:  # preexec_fn, which pins it; the system says no more
        raise NotPinned(command[0]) from None
    with child:
        _live.add(child.pid)
        try:
            may_start()  # the signal may have come in between
            yield child
        except BaseException as error:
            late = isinstance(error, subprocess.TimeoutExpired)
            with contextlib.suppress(ProcessLookupError):
                os.killpg(child.pid, signal.SIGKILL if late else signal.SIGTERM)
            raise
        finally:
            _live.discard(child.pid)


def run(
    command: Sequence[str | Path],
    *,
    input: Any = None,
    capture_output: bool = False,
    check: bool = False,
    timeout: float | None = None,
    **options: Any,
) -> subprocess.CompletedProcess:
    """Is subprocess.run for at most `timeout` (inf: without end) or `seconds()`; text is always UTF-8.
    StudyError (cannot run) when it was killed for that."""
    if options.get("text"):
        options = {"encoding": "utf-8", "errors": "replace"} | options
    if capture_output:
        options |= {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    if input is not None:
        options["stdin"] = subprocess.PIPE
    limit = timeout or seconds()
    try:
        with started(command, **options) as child:
            out, err = child.communicate(input, None if limit == math.inf else limit)
    except subprocess.TimeoutExpired:
        raise overdue(command[0], limit) from None
    if check and child.returncode:
        raise subprocess.CalledProcessError(child.returncode, command, out, err)
    return subprocess.CompletedProcess(command, sandbox.ended(child.returncode), out, err)
