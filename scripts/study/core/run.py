"""Runs the driver: one process, pinned, its JSON parsed, its end looked after."""

from __future__ import annotations

import contextlib
import ctypes
import functools
import json
import os
import random
import signal
import subprocess
import tempfile
import threading
import time
from collections.abc import Callable, Generator, Hashable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from study.core import cli, progress
from study.core.build import build
from study.core.cli import BAD_INPUT, CANNOT_RUN, StudyError
from study.core.host import child, sandbox
from study.core.host.topology import FASTEST as FASTEST
from study.core.host.topology import USABLE, spread
from study.core.registry import Spec

T = TypeVar("T", bound=Hashable)
_LIBC = ctypes.CDLL(None)  # loaded here: between fork and exec nothing may be imported
_PR_SET_PDEATHSIG = 1
UNTIMED = "STEPWISE_UNTIMED"  # in a driver's environment: it does not measure the clocks' rates, 25 ms
# Every program but "render" counts, or tells code by its functions: that of costs.def, so that a phase that
# generates kernels for scenes makes none there.
GENERAL = {"STEPWISE_CC": "none"}
UNSAID = {"threads": 1, "warmup": 0, "aov": False, "display": False}  # options that say nothing
SPELT = {"width": "-w", "out": "-o", "animation": "--frames"}  # of the others the driver has the names
NO_ISA, UNSUPPORTED, NO_MEMORY = 3, 4, 5  # exit statuses of the driver


class DriverError(StudyError):
    """The driver ended with `status` (negative: killed by that signal) and said `message`."""

    def __init__(self, status: int, message: str, exit_status: int | None = None) -> None:
        super().__init__(message, exit_status or (CANNOT_RUN if status == NO_ISA else BAD_INPUT))
        self.status = status
        self.message = message


def cpu_set(cpu: int | None, threads: int) -> set[int] | None:
    """CPUs to pin to: `cpu` and threads - 1 of the usable ones, a core each first; None: no pinning."""
    if cpu is None:
        return None
    if cpu not in USABLE:
        raise StudyError(f"CPU {cpu} is not available; there are {', '.join(map(str, USABLE))}")
    return spread(cpu, threads, USABLE)


def _arguments(
    spec: Spec | str | Path,
    scene_path: Path,
    height: int,
    width: int | None,
    target: str = "render",
    **options: Any,
) -> list[str]:
    program = spec if isinstance(spec, Path) else build(spec, target)
    arguments = [str(program), str(scene_path), "-n", str(height)]
    options = {"reps": 1, "width": width} | options
    if options.get("animation") is not None:
        del options["reps"]
    for name, value in options.items():
        if value is not None and value != UNSAID.get(name):
            arguments += [SPELT.get(name, "--" + name.replace("_", "-"))] + [str(value)] * (value is not True)
    return arguments


def environment(
    env_bytes: int = 0, timed: bool = True, more: Mapping[str, str] | None = None
) -> dict[str, str]:
    """A driver's: as this process's, but whether clocks are measured is `timed`'s to say alone."""
    found = {key: value for key, value in os.environ.items() if key != UNTIMED}
    found |= {} if timed else {UNTIMED: "1"}
    found |= {"STEPWISE_PADDING": "x" * env_bytes} if env_bytes else {}
    return found | dict(more or {})


def _lines(
    arguments: list[str],
    cpus: set[int] | None,
    env_bytes: int,
    timed: bool = True,
    more: Mapping[str, str] | None = None,
) -> Iterator[str]:
    """Whole lines of a child's standard output as they come. DriverError at its end if it failed. The child
    dies with its reader: with the generator, when it says nothing for too long, and with this process."""
    with contextlib.ExitStack() as stack:
        errors = stack.enter_context(tempfile.TemporaryFile("w+", encoding="utf-8", errors="replace"))
        begun = child.started(
            arguments,
            stdout=subprocess.PIPE,
            stderr=errors,
            stdin=subprocess.DEVNULL,
            env=environment(env_bytes, timed, more),
            text=True,
            preexec_fn=functools.partial(_in_child, cpus),
        )
        try:
            process = stack.enter_context(begun)
        except OSError as error:
            raise DriverError(127, f"{arguments[0]}: {error.strerror}") from None
        except child.NotPinned as error:
            raise DriverError(126, str(error), CANNOT_RUN) from None
        watch = stack.enter_context(_Watch(process))
        stack.callback(process.kill)  # does nothing to one that has ended
        assert process.stdout
        for line in process.stdout:
            if not sandbox.active():  # there the whole program has a limit
                watch.heard = time.monotonic()
            if line.endswith("\n"):
                yield line
        status = sandbox.ended(process.wait())
        if watch.ran_out:
            raise DriverError(status, str(child.overdue(arguments[0], watch.seconds)))
        errors.seek(0)
        said = errors.read().strip().splitlines()
        for text in said if not status else []:
            _remark(text)
        if status:
            how = f"killed by {signal.Signals(-status).name}" if status < 0 else f"exit status {status}"
            raise DriverError(status, said[-1] if said else f"{arguments[0]}: {how}")


@functools.cache
def _remark(text: str) -> None:
    """A driver's warning, once, however many launches there are."""
    cli.say(text)


class _Watch:
    """Kills a process that says nothing for child.seconds(). One thread that sleeps: a line costs no more."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        usual = sandbox.SECONDS if sandbox.active() else child.SECONDS
        self.process, self.seconds, self.ran_out = process, child.seconds(usual), False
        self.heard = time.monotonic()
        self.ended = threading.Event()

    def __enter__(self) -> _Watch:
        threading.Thread(target=self._watch, daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        self.ended.set()

    def _watch(self) -> None:
        while not self.ended.wait(left := self.heard + self.seconds - time.monotonic()):
            if left <= 0:
                self.ran_out = True
                self.process.kill()
                return


def _in_child(cpus: set[int] | None) -> None:
    # Not what this process has: `interleaved` keeps it off the measured CPU; threads would share the others.
    os.sched_setaffinity(0, cpus or USABLE)
    _LIBC.prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


def render(
    spec: Spec | str | Path,
    scene_path: Path,
    height: int,
    width: int | None = None,
    *,
    cpu: int | None = None,
    threads: int = 1,
    env_bytes: int = 0,
    timed: bool = True,
    general: bool | None = None,
    told: Mapping[str, str] | None = None,
    target: str = "render",
    **options: Any,
) -> dict[str, Any]:
    """Render once and return the driver's JSON object (times in ns and cycles of the named clock). `spec`: or
    the path of a driver that was built elsewhere. Options:
    the driver's, `animation` for its frames. Not `timed`: for a picture or
    counts alone; the clocks' rates are 0. `general`: no kernel is generated for the scene; so run all other
    targets than render. `told`: variables of its environment. Raises DriverError(status, message)."""
    options |= {"threads": threads}
    arguments = [*_arguments(spec, scene_path, height, width, target, **options), "--json"]
    more = dict(told or {}) | (GENERAL if (target != "render" if general is None else general) else {})
    said = _lines(arguments, cpu_set(cpu, threads), env_bytes, timed, more)
    return _parse("".join(said), arguments[0])


def frames(
    spec: Spec | str,
    scene_path: Path,
    height: int,
    width: int | None = None,
    *,
    cpu: int | None = None,
    threads: int = 1,
    env_bytes: int = 0,
    timed: bool = True,
    **options: Any,
) -> Generator[dict[str, Any], None, None]:
    """The same, frame by frame, as each is done. `env_bytes`: padding of the child's environment. Not
    `timed`: the clocks' rates are 0; without them a frame costs no more than itself."""
    options |= {"threads": threads}
    arguments = [*_arguments(spec, scene_path, height, width, "render", **options), "--jsonl"]
    for line in _lines(arguments, cpu_set(cpu, threads), env_bytes, timed):
        yield _parse(line, arguments[0])


def compiled_by(compiler: str) -> dict[str, str]:
    """What tells a driver to compile by that compiler what it generates for a scene."""
    return {} if os.environ.get("STEPWISE_CC") == "none" else {"STEPWISE_CC": compiler}


@contextlib.contextmanager
def off(cpu: int | None) -> Iterator[None]:
    """Meanwhile this process, which only waits and writes, keeps off the CPU that is measured on."""
    here = os.sched_getaffinity(0)
    try:
        if others := set(USABLE) - {cpu}:
            with contextlib.suppress(OSError):  # no longer allowed there: the first launch says so
                os.sched_setaffinity(0, others)
        yield
    finally:
        with contextlib.suppress(OSError):  # the cpuset has changed: the kernel has moved this process
            os.sched_setaffinity(0, here)


def interleaved(
    what: Sequence[T],
    launches: int,
    seed: int,
    cpu: int,
    once: Callable[[T, int], float],
    about: str = "time",
) -> dict[T, list[float]]:
    """`once(item, env_bytes)` of every item once a round in random order: what it returns per launch. The
    environment's size is random too: it shifts the stack, which can look like 10 %."""
    values: dict[T, list[float]] = {item: [] for item in what}
    dice = random.Random(seed)
    order = [item for _ in range(launches) for item in dice.sample(list(what), len(what))]
    with off(cpu):
        for item in progress.each(order, about):
            values[item].append(once(item, dice.randint(0, 4096)))
    return values


def _parse(text: str, program: str) -> dict[str, Any]:
    try:
        parsed = json.loads(text)
    except json.JSONDecodeError:
        parsed = None
    if not isinstance(parsed, dict):
        raise DriverError(0, f"{program}: printed no JSON object but {text[:60]!r}")
    return parsed
