"""Files that are nearly what they should be, for hypothesis, and how their readers must end."""

from __future__ import annotations

import copy
import os
import re
import resource
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from hypothesis import strategies as st

from study.core.cli import StudyError
from study.core.registry import ROOT

SECONDS = 20  # of one file

VALUES: list[Any] = [
    None,
    True,
    False,
    0,
    -1,
    1,
    10**400,
    -(2**63),
    1e308,
    5e-324,
    "",
    "x",
    "\0",
    "a\nb",
    "../a",
    "{0}",
]
VALUES += [
    "9" * 400,
    "\u202e<b>",
    [],
    {},
    [[]],
    [None],
    {"": None},
    [1, "x"],
    {"value": None, "low": None, "high": None},
]
WORDS = [
    b"",
    b"-1",
    b"0",
    b"nan",
    b"inf",
    b"1e999",
    b"9" * 400,
    b"9" * 5000,
    b"-",
    b"\0",
    b"\xff",
    b"\xe4",
    b"\xef\xbb\xbf",
]
WORDS += [
    b"<not counted>",
    b"{",
    b"}",
    b"[1]",
    b"[" * 3000,
    b'{"a":' * 3000,
    b"*",
    b"#",
    b"'",
    b'"',
    b"(",
    b"%s",
    b"\r",
    b"\x1b[2J",
]


def _places(value: Any, at: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Paths to what is in an object or list, of each list the first, the second and the last."""
    found = []
    if isinstance(value, dict):
        inner: Any = value.items()
    elif isinstance(value, list):
        inner = [(i, value[i]) for i in sorted({0, 1, len(value) - 1} & set(range(len(value))))]
    else:
        return []
    for key, one in inner:
        found += [(*at, key), *_places(one, (*at, key))]
    return found


def edits(sound: Any) -> st.SearchStrategy[list[tuple[tuple[Any, ...], str, Any]]]:
    """Up to three values to be replaced, removed, doubled or put in: where, how, by what."""
    how = st.sampled_from(["replace"] * 4 + ["remove", "double", "new"])
    return st.lists(
        st.tuples(st.sampled_from(_places(sound)), how, st.sampled_from(VALUES)), min_size=1, max_size=3
    )


def edited(sound: Any, changes: list[tuple[tuple[Any, ...], str, Any]]) -> Any:
    made = copy.deepcopy(sound)
    for place, how, value in changes:
        try:
            holder = made
            for key in place[:-1]:
                holder = holder[key]
            key = place[-1]
            if how == "remove":
                del holder[key]
            elif how == "new" and isinstance(holder, dict):
                holder["of another version"] = {"of": [copy.deepcopy(value)]}
            elif how == "double" and isinstance(holder, list):
                holder.insert(0, holder[key])
            else:
                holder[key] = copy.deepcopy(value)
        except (KeyError, IndexError, TypeError, AttributeError):  # it went before
            continue
    return made


@st.composite
def bytes_like(draw: st.DrawFn, sound: bytes) -> bytes:
    """`sound` with up to three words, lines or bytes replaced, removed or put elsewhere."""
    made = sound
    for _ in range(draw(st.integers(1, 3))):
        how = draw(
            st.sampled_from(["word", "word", "word", "line", "cut", "byte", "front", "swap", "utf-16"])
        )
        at = draw(st.integers(0, max(len(made) - 1, 0)))
        word = draw(st.sampled_from(WORDS))
        if how == "word":
            found = re.compile(rb"[\w.+-]+").search(made, at)
            made = made[: found.start()] + word + made[found.end() :] if found else made + word
        elif how == "line":
            lines = made.splitlines(keepends=True) or [b""]
            i, j = (draw(st.integers(0, len(lines) - 1)) for _ in range(2))
            made = b"".join([*lines[:i], *lines[i + draw(st.integers(0, 1)) :][: len(lines)], lines[j]])
        elif how == "cut":
            made = made[:at]
        elif how == "byte":
            made = made[:at] + bytes([draw(st.integers(0, 255))]) + made[at + 1 :]
        elif how == "front":
            made = word + made
        elif how == "swap":
            made = made[at:] + made[:at]
        else:
            made = made.decode("latin-1").encode("utf-16")
    return made


@contextmanager
def in_time(seconds: int = SECONDS) -> Iterator[None]:
    """What hangs fails. For the main thread alone."""

    def late(number: int, frame: object) -> None:
        raise AssertionError(f"no end within {seconds} s")

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def held(read: Callable[[], object], named: str) -> None:
    """`read` ends, with one line that names the file if not well."""
    with in_time():
        try:
            read()
        except StudyError as error:
            said = str(error)
            assert re.search(named, said) and len(said.splitlines()) == 1, said


def limited(code: str) -> subprocess.CompletedProcess[str]:
    """Python in 2 GB of addresses."""

    def few() -> None:
        resource.setrlimit(resource.RLIMIT_AS, (2 << 30, 2 << 30))

    path = os.pathsep.join([str(ROOT / "scripts"), str(ROOT / "tests" / "py")])
    environment = os.environ | {"PYTHONPATH": path, "OPENBLAS_NUM_THREADS": "1"}
    command = [sys.executable, "-c", code]
    return subprocess.run(
        command, env=environment, capture_output=True, text=True, timeout=120, preexec_fn=few
    )
