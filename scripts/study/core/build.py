"""Builds by the Makefile: build/SPEC/render and build/SPEC/probe."""

import contextlib
import fcntl
import functools
import os
import re
import subprocess
import threading
from collections.abc import Iterator, Sequence
from pathlib import Path

from study.core import progress
from study.core.cli import CANNOT_RUN, StudyError
from study.core.host import child
from study.core.registry import ROOT, Spec

# As make itself, dash and bash say it.
MISSING = re.compile(
    r"(?:make(?:\[\d+\])?|compile\.py): (\S+): No such file|"
    r"sh: (?:line )?(?:\d+: )?(\S+): (?:command )?not found"
)


BUILT = "STEPWISE_BUILT"  # paths of programs that tests/run.py has made: make is not asked again
ERROR = re.compile(r"undefined reference|(?<!collect2: )error")  # collect2's says only that ld's is above
LINES = 12  # of a compiler's text, from its first error on
_one_at_a_time = threading.RLock()  # two makes of one target would write the same files


def build(
    spec: Spec | str, target: str = "render", folder: str = "build", settings: tuple[str, ...] = ()
) -> Path:
    """Path of the binary, brought up to date once per process: what a script runs stays the same. `settings`
    are make's, with a folder of their own. StudyError with the compiler's last lines, or a missing tool's
    name."""
    with _one_at_a_time:
        return _build(str(spec), target, folder, settings)


def is_built(path: Path) -> bool:
    """Whether tests/run.py has built it."""
    return str(path) in os.environ.get(BUILT, "").split(os.pathsep)


@contextlib.contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """Keeps other processes from making anything in that folder: a phase's build may make its parent's."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock = (folder / ".making").open("w")
    except OSError:
        yield
        return
    with lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def build_together(tasks: Sequence[tuple[Spec, str]], jobs: int) -> None:
    """Programs by spec and target, by one make with `jobs` jobs. Of what fails, build() says why."""
    if all(is_built(ROOT / "build" / str(spec) / target) for spec, target in tasks):
        return
    command = ["make", "-s", "-k", f"-j{jobs}", "-C", str(ROOT), *(f"build/{s}/{t}" for s, t in tasks)]
    with _one_at_a_time, _alone(ROOT / "build"), contextlib.suppress(FileNotFoundError):
        paths = [ROOT / "build" / str(spec) / target for spec, target in tasks]
        missing = [path for path in paths if not path.exists()]
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        with child.started(command, **quiet) as make:
            total = len(missing) or None
            progress.until(make, "build", lambda: sum(path.exists() for path in missing), total)


@functools.cache
def _build(spec: str, target: str, folder: str, settings: tuple[str, ...]) -> Path:
    path = ROOT / folder / spec / target
    if is_built(path):
        return path
    command = ["make", "-s", "-C", str(ROOT), f"BUILD={folder}", *settings, str(path.relative_to(ROOT))]
    try:
        with _alone(ROOT / folder):
            done = child.run(command, capture_output=True, text=True)
    except FileNotFoundError:
        raise StudyError("make is missing; run `make setup` or install make and gcc", CANNOT_RUN) from None
    if done.returncode != 0:
        output = done.stderr + done.stdout
        if tool := MISSING.search(output):
            raise StudyError(
                f"cannot build {spec}: {tool[1] or tool[2]} is missing; run `make setup`", CANNOT_RUN
            )
        lines = [line for line in output.splitlines() if line.strip()]
        first = next((i for i, line in enumerate(lines) if ERROR.search(line)), len(lines) - LINES)
        raise StudyError(f"cannot build {spec}:\n  " + "\n  ".join(lines[max(first, 0) :][:LINES]))
    return path
