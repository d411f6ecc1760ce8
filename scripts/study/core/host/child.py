"""Runs another program to its end, which comes in time: a child that hangs is killed with all it started."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from study.core.cli import CANNOT_RUN, StudyError

SECONDS = 3600.0  # of one program; a compiler or a tool takes minutes
LIMIT = "STEPWISE_CHILD_SECONDS"


def seconds() -> float:
    """What a child may take, by the environment or SECONDS. StudyError for no number."""
    text = os.environ.get(LIMIT)
    with contextlib.suppress(ValueError):
        if (limit := float(text) if text else SECONDS) > 0:
            return limit
    raise StudyError(f"{LIMIT}={text}: must be a number of seconds above 0")


def overdue(name: object, limit: float) -> StudyError:
    """What is said of a child that was killed."""
    return StudyError(
        f"{Path(str(name)).name}: no end after {limit:g} s; killed ({LIMIT} allows more)", CANNOT_RUN
    )


def run(
    command: Sequence[str | Path],
    *,
    input: Any = None,
    capture_output: bool = False,
    check: bool = False,
    timeout: float | None = None,
    **options: Any,
) -> subprocess.CompletedProcess:
    """As subprocess.run, for at most `timeout` or `seconds()`; text is UTF-8, whatever the locale's.

    StudyError (cannot run) when it was killed for that.
    """
    if options.get("text"):
        options = {"encoding": "utf-8", "errors": "replace"} | options
    if capture_output:
        options |= {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    if input is not None:
        options["stdin"] = subprocess.PIPE
    limit = timeout or seconds()
    with subprocess.Popen(command, process_group=0, **options) as child:
        try:
            out, err = child.communicate(input, limit)
        except BaseException as error:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(child.pid, signal.SIGKILL)
            if isinstance(error, subprocess.TimeoutExpired):
                raise overdue(command[0], limit) from None
            raise
    if check and child.returncode:
        raise subprocess.CalledProcessError(child.returncode, command, out, err)
    return subprocess.CompletedProcess(command, child.returncode, out, err)
