"""Command line of every script: arguments, exit statuses, errors in one line, JSON on stdout.

Importing this needs the standard library alone. When a package of the study is missing, the import
starts the script again with the Python of ROOT/.venv, or says how to make it.
"""

from __future__ import annotations

import argparse
import codecs
import contextlib
import dataclasses
import functools
import io
import json
import math
import os
import re
import signal
import sys
import traceback
from collections.abc import Callable, Iterable, Sequence
from importlib import metadata
from pathlib import Path
from types import TracebackType
from typing import Any

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
DECLARED = Path(__file__).resolve().parents[3] / "requirements.in"
RUN_TIME = "The study"  # the heading of what the scripts import
_GUARD = "STEPWISE_IN_VENV"


def declared(section: str) -> list[str]:
    """Distributions below the heading "# section" of requirements.in; none in a tree without that file."""
    lines = DECLARED.read_text(encoding="utf-8").splitlines() if DECLARED.exists() else []
    found, inside = [], False
    for line in lines:
        if line.startswith("#"):
            inside = line == f"# {section}"
        elif inside and (name := re.match(r"[\w.-]+", line)):
            found.append(name.group())
    return found


def _is_installed(distribution: str) -> bool:
    try:
        metadata.distribution(distribution)
    except metadata.PackageNotFoundError:
        return False
    return True


def _left_out() -> list[str]:
    """Distributions that have no wheel for the venv's Python (scripts/setup.sh)."""
    try:
        return (DECLARED.parent / ".venv" / ".without").read_text(encoding="ascii").split()
    except (OSError, UnicodeDecodeError):
        return []


def _need_packages() -> None:
    """Go on in the venv if a package is missing here; the guard stops a venv that lacks it too."""
    missing = [name for name in declared(RUN_TIME) if not _is_installed(name)]
    if sys.prefix != sys.base_prefix:
        missing = [name for name in missing if name not in _left_out()]
    if sys.version_info >= (3, 11) and not missing:
        return
    python = Path(__file__).resolve().parents[3] / ".venv" / "bin" / "python"
    if python.exists() and not os.environ.get(_GUARD):
        os.environ[_GUARD] = "1"
        os.execv(python, [str(python), *sys.orig_argv[1:]])
    lacking = "Python 3.11 or newer" if sys.version_info < (3, 11) else ", ".join(missing)
    print(f"{Path(sys.argv[0]).name}: {lacking} missing; run `make setup` first", file=sys.stderr)
    sys.exit(CANNOT_RUN)


def _crash(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
    """Say which script has a bug and where, and end it with CRASHED."""
    name = Path(sys.argv[0]).name
    if issubclass(kind, KeyboardInterrupt):
        print(f"{name}: interrupted", file=sys.stderr)
        sys.exit(INTERRUPTED)
    traceback.print_exception(kind, error, trace)
    print(f"{name}: crashed: {kind.__name__}", file=sys.stderr)
    sys.exit(CRASHED)


def _is_script() -> bool:
    """Whether one of our scripts imports this, and not a test or a program of somebody else."""
    path = getattr(sys.modules["__main__"], "__file__", None)
    return path is not None and Path(path).resolve().parent == Path(__file__).resolve().parents[2]


_ASCII = {
    "×": "x",
    "–": "-",
    "−": "-",
    "±": "+-",
    "≤": "<=",
    "≥": ">=",
    "µ": "u",
    "·": "*",
    "²": "^2",
    "→": "->",
    "\u00a0": " ",
    "…": "...",
}


def _spell(error: UnicodeError) -> tuple[str, int]:
    """What a terminal's encoding lacks, in letters that it has."""
    assert isinstance(error, UnicodeEncodeError)
    letters = (_ASCII.get(sign) or f"\\u{ord(sign):04x}" for sign in error.object[error.start : error.end])
    return "".join(letters), error.end


# Controls but tab and line feed, signs that turn text about, invisible ones, halves of surrogate pairs.
_HIDDEN = [*range(0x09), *range(0x0B, 0x20), *range(0x7F, 0xA0), 0xAD, 0x61C, 0x180E, *range(0x200B, 0x2010)]
_HIDDEN += [*range(0x2028, 0x202F), *range(0x2060, 0x2070), *range(0xFFF9, 0xFFFC), *range(0xD800, 0xE000)]
_HIDDEN += [0xFEFF, *range(0xE0000, 0xE0080)]
_SEEN = {sign: ascii(chr(sign))[1:-1] for sign in _HIDDEN}


def visible(text: str) -> str:
    """`text`, where what a terminal or a page would obey and not show stands as `\\x1b` or `\\u202e`."""
    return text.translate(_SEEN)


def one_line(text: str) -> str:
    """`text` made visible, without its line breaks: no part of it can pass for another line."""
    return visible(" ".join(text.splitlines()))


def _write(stream: io.TextIOWrapper, text: str) -> int:
    return io.TextIOWrapper.write(stream, visible(text))


def speak() -> None:
    """Standard output and errors take every text, whatever the terminal's encoding; none steers the terminal.

    What moves the cursor on purpose calls the class's own `write` (study.core.progress).
    """
    codecs.register_error("stepwise", _spell)
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:  # closed by the shell: else the next file to be opened would be it
            with contextlib.suppress(OSError):
                os.fstat(number)
                continue
            opened = os.open(os.devnull, os.O_RDWR)
            setattr(sys, name, os.fdopen(opened, "w" if number else "r", encoding="utf-8"))
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="stepwise")
            stream.write = functools.partial(_write, stream)  # type: ignore[method-assign]


_need_packages()
if _is_script():
    speak()
    sys.excepthook = _crash  # of what is raised outside `main`: a module that cannot be imported


class StudyError(Exception):
    """One line for the user: what is wrong and what would be right. Ends a script with `exit_status`."""

    def __init__(self, message: str, exit_status: int = BAD_INPUT) -> None:
        super().__init__(message)
        self.exit_status = exit_status


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
        """Prints it; the exit status."""
        if as_json:
            emit(self.result, self.run)
        else:
            print(*self.lines, sep="\n", end="\n" if self.lines else "")
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


def add_unclean(parser: argparse.ArgumentParser) -> None:
    """--unclean, of what would pass a run's numbers on."""
    text = "take runs of sources with uncommitted changes, or of an unknown commit"
    parser.add_argument("--unclean", action="store_true", help=text)


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


_enders: list[Callable[[], None]] = []


def at_signal(end: Callable[[], None]) -> None:
    """`end` is called when SIGTERM or Ctrl-C ends the script, before anything is unwound."""
    _enders.append(end)


def _interrupted(number: int, frame: object) -> None:
    for end in _enders:
        end()
    raise KeyboardInterrupt


def _ended(number: int, frame: object) -> None:
    """As an exception: what a script has under a temporary name goes with it. A second one ends at once."""
    signal.signal(number, signal.SIG_DFL)
    for end in _enders:
        end()
    os.write(2, f"{Path(sys.argv[0]).name}: ended by {signal.Signals(number).name}\n".encode())
    _ending.append(128 + number)
    sys.exit(128 + number)


def _swallowed(found: sys.UnraisableHookArgs) -> None:
    """Python swallows what a signal raises in a callback, as of fork. `main` still ends by `_ending`."""
    if not (_ending and isinstance(found.exc_value, SystemExit)):
        sys.__unraisablehook__(found)


_emitted: list[dict[str, Any]] = []
_ending: list[int] = []  # the status of a script that a signal ends


def _name() -> str:
    """Of the command as it was called, `stepwise sweep`: it stands where the script's path did."""
    return Path(sys.argv[0]).name


def main(run: Callable[[], int | None]) -> None:
    """Run a script's main function and exit with its status (STATUSES). Errors are one line on stderr."""
    before, at_key = signal.signal(signal.SIGTERM, _ended), signal.getsignal(signal.SIGINT)
    if at_key is signal.default_int_handler:  # else it is ignored, as under nohup
        signal.signal(signal.SIGINT, _interrupted)
    sys.unraisablehook = _swallowed
    try:
        status = finish(run() or OK)
        sys.stdout.flush()
    except StudyError as error:
        if not _ending:
            print(f"{_name()}: {one_line(str(error))}", file=sys.stderr)
        status = error.exit_status
    except KeyboardInterrupt:
        print(f"{_name()}: interrupted", file=sys.stderr)
        status = INTERRUPTED
    except BrokenPipeError:
        # The reader has gone (head, less): that is no error, and the flush at exit must not say so.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        status = OK
    except OSError as error:  # of files the scripts speak themselves: a full disk behind standard output
        print(f"{_name()}: {error.filename or 'standard output'}: {error.strerror}", file=sys.stderr)
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        status = BAD_INPUT
    except Exception as error:
        _crash(type(error), error, error.__traceback__)
    finally:
        signal.signal(signal.SIGTERM, before)
        signal.signal(signal.SIGINT, at_key)
    sys.exit(_ending[0] if _ending else status)


def plain(value: Any) -> Any:
    """`value` as JSON types: dataclasses and Structs as objects, NumPy as lists, NaN and inf as null."""
    if hasattr(value, "__struct_fields__"):
        import msgspec  # a package: this module must be importable without

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


def emit(result: Any, run: Path | str | None = None) -> None:
    """What a command found, for --json; `run`: the folder that it read or wrote. See `finish`."""
    command = _name().removeprefix("stepwise ")
    _emitted[:] = [{"command": command, "status": None, "run": plain(run), "result": plain(result)}]


def finish(status: int) -> int:
    """Writes what was emitted as one JSON object to standard output, with how the command ended."""
    if _emitted:
        print(json.dumps(_emitted.pop() | {"status": "failed" if status else "ok"}, allow_nan=False))
    return status


def say(text: str) -> None:
    """Progress and remarks for people: standard error, so that --json stays parseable."""
    sys.stderr.write(text + "\n")  # one write: lines of several threads stay whole
    sys.stderr.flush()
