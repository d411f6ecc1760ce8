"""Command line of every command: arguments, exit statuses, errors in one line, JSON on stdout."""

import argparse
import contextlib
import dataclasses
import io
import json
import math
import os
import signal
import sys
import traceback
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import msgspec

OK, FAILED, BAD_INPUT, CANNOT_RUN = 0, 1, 2, 3
CRASHED = 70  # EX_SOFTWARE of sysexits.h; Python's own status of a traceback is FAILED
INTERRUPTED = 130
STATUSES = {  # the table of docs/exit-statuses.md
    OK: "done",
    FAILED: "done, and a check failed",
    BAD_INPUT: "bad arguments or input",
    CANNOT_RUN: "nothing could run here",
    CRASHED: "crashed: a bug of the script, whose traceback is on standard error",
    INTERRUPTED: "interrupted from the keyboard",
}


class StudyError(Exception):
    """One line for the user: what is wrong and what would be right. Ends a script with `exit_status`."""

    def __init__(self, message: str, exit_status: int = BAD_INPUT) -> None:
        super().__init__(message)
        self.exit_status = exit_status


class Unwritten(StudyError):
    """A file that the disk does not take: nothing is wrong with what was read."""


@dataclasses.dataclass(frozen=True)
class Outcome:
    """How a command ended. `result`: what --json prints; `lines`: what a person reads instead; `run`: the
    folder that was read or written; `remarks` and `failed` (checks): a sentence each, on standard error;
    `status`: where it is not FAILED for what failed, else OK."""

    result: Any = None
    lines: Iterable[object] = ()
    run: Path | None = None
    remarks: Sequence[str] = ()
    failed: Sequence[str] = ()
    status: int | None = None

    @property
    def ended(self) -> int:
        return self.status if self.status is not None else FAILED if self.failed else OK

    def tell(self, as_json: bool) -> int:
        """Prints it, with --json as one object; the exit status."""
        if as_json:
            status = "failed" if self.ended else "ok"
            about = {"command": _name().removeprefix("stepwise "), "status": status, "run": self.run}
            made = about | {"result": self.result}
            print(json.dumps(plain(made), allow_nan=False))
        else:
            for line in self.lines:
                print(line)
        for text in [*self.remarks, *(f"FAIL {text}" for text in self.failed)]:
            say(text)
        return self.ended


def parser(description: str, statuses: dict[int, str] | None = None) -> argparse.ArgumentParser:
    """A parser with --json and the exit statuses (the usual ones, then `statuses`) in its help."""
    meaning = {status: text for status, text in STATUSES.items() if status != FAILED} | (statuses or {})
    lines = "\n".join(f"  {status:3d}  {meaning[status]}" for status in sorted(meaning))
    made = argparse.ArgumentParser(
        description=description,
        epilog=f"exit status:\n{lines}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    made.add_argument("--json", action="store_true", help="one JSON object: command, status, run, result")
    return made


def of_run(parser: argparse.ArgumentParser, out: str, height: bool = False) -> None:
    """RUN and -o, whose default is `out`; -n of the ladder's pictures if `height`."""
    add = parser.add_argument
    add("run", nargs="?", type=Path, metavar="RUN", help="its folder; default: the newest run")
    add("-o", "--out", type=Path, metavar="PATH", help=out)
    if height:
        add("-n", type=int, metavar="HEIGHT", help="of the ladder's pictures; default: the best measured")


def at_least(lowest: float, kind: type = int) -> Callable[[str], Any]:
    """An argparse type: a finite number of `kind` that is `lowest` or more."""
    what = "a whole number" if kind is int else "a number"

    def parse(text: str) -> Any:
        with contextlib.suppress(ValueError):
            if lowest <= (value := kind(text)) < math.inf:
                return value
        raise argparse.ArgumentTypeError(f"'{text}': must be {what} of at least {lowest:g}")

    return parse


def percent(text: str) -> float:
    """An argparse type: `2%` as .02."""
    with contextlib.suppress(ValueError):
        if text.endswith("%") and 0 <= (value := float(text[:-1])) < math.inf:
            return value / 100
    raise argparse.ArgumentTypeError(f"'{text}': must be a percentage of at least 0, like 2%")


_enders: list[Callable[[], None]] = []


def at_signal(end: Callable[[], None]) -> None:
    """`end` is called when SIGTERM or Ctrl-C ends the script, before anything is unwound."""
    _enders.append(end)


def _signalled(number: int, frame: object) -> None:
    """Ends by an exception: what has a temporary name goes with it. A second signal ends at once."""
    signal.signal(number, signal.SIG_DFL)
    for end in _enders:
        end()
    if number == signal.SIGINT:
        raise KeyboardInterrupt
    say(f"ended by {signal.Signals(number).name}")
    sys.exit(128 + number)


def _name() -> str:
    """The command's name as it was called, `stepwise sweep`: it stands where the script's path did."""
    return Path(sys.argv[0]).name


def _say_no_more() -> None:
    """Standard output takes nothing: the flush at exit must not say so again."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def main(run: Callable[[], int | None]) -> None:
    """Runs a command's function and exits with its status (STATUSES). Errors are one line on stderr."""
    signal.signal(signal.SIGTERM, _signalled)
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # else it is ignored, as under nohup
        signal.signal(signal.SIGINT, _signalled)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # whatever the terminal's encoding lacks
    try:
        status = run() or OK
        if sys.stdout:
            sys.stdout.flush()
    except StudyError as error:
        print(f"{_name()}: {' '.join(str(error).split())}", file=sys.stderr)
        status = error.exit_status
    except KeyboardInterrupt:
        print(f"{_name()}: interrupted", file=sys.stderr)
        status = INTERRUPTED
    except BrokenPipeError:
        _say_no_more()  # the reader has gone (head, less): that is no error
        status = OK
    except OSError as error:  # a full disk behind standard output
        _say_no_more()
        print(f"{_name()}: {error.filename or 'standard output'}: {error.strerror}", file=sys.stderr)
        status = BAD_INPUT
    except Exception as error:
        traceback.print_exc()
        print(f"{_name()}: crashed: {type(error).__name__}", file=sys.stderr)
        status = CRASHED
    sys.exit(status)


def plain(value: Any) -> Any:
    """`value` as JSON types: dataclasses and Structs as objects, NumPy as lists, NaN and inf as null."""
    if isinstance(value, msgspec.Struct):
        value = msgspec.to_builtins(value)
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        value = dataclasses.asdict(value)
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple, set)):
        return [plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return str(value) if isinstance(value, Path) else value


listeners: list[Callable[[str], None]] = []  # the last one hears what commands say, instead of the terminal


@contextlib.contextmanager
def heard(listener: Callable[[str], None]) -> Iterator[None]:
    """Meanwhile the listener is told all remarks, and progress is a bar on a terminal or nothing."""
    listeners.append(listener)
    try:
        yield
    finally:
        listeners.remove(listener)


def doing(text: str) -> None:
    """Progress, which is no remark: nothing where somebody listens for those."""
    if not listeners:
        say(text)


def say(text: str) -> None:
    """Remarks for people: standard error, so that --json stays parseable."""
    if listeners:
        return listeners[-1](text)
    sys.stderr.write(text + "\n")  # one write: lines of several threads stay whole
    sys.stderr.flush()
