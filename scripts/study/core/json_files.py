"""JSON files, plain or packed, with errors that name file, line and column."""

from __future__ import annotations

import gzip
import json
import math
import os
import re
import stat
import zlib
from pathlib import Path
from typing import Any

from study.core.cli import StudyError

LARGEST = (
    1 << 25
)  # bytes of a file, unpacked: ten times what any run has; Python's objects take twenty times it
DEEPEST = 100  # objects and lists in one another; readers of what was read call themselves as often
_BRACKETS = b"[]{}"
_OTHERS = bytes(set(range(256)) - set(_BRACKETS))
_TEXTS = re.compile(rb'"(?:[^"\\]|\\.)*"', re.DOTALL)
_LARGE = re.compile(r"\d{19}|[eE]\+?\d{3}")
_HALF = re.compile(r"\\u[dD][89abABcdefCDEF]")


def stored(path: Path) -> Path:
    """`path`, or where that is not the packed one (path.gz) of a published run; `path` if neither is."""
    packed = path.with_name(path.name + ".gz")
    return packed if packed.exists() and not path.exists() else path


def content(path: Path, most: int = LARGEST) -> bytes:
    """Of a file, unpacked if its name ends in .gz.

    StudyError for what is no regular file (a pipe would be waited for), is larger than `most` bytes or cut
    short; OSError for what cannot be read.
    """
    with open(os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC), "rb") as file:
        if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
            raise StudyError(f"{path}: not a file")
        try:
            if path.suffix == ".gz":
                with gzip.GzipFile(fileobj=file) as packed:
                    data = packed.read(most + 1)
            else:
                data = file.read(most + 1)
        except (EOFError, zlib.error, gzip.BadGzipFile) as error:
            raise StudyError(f"{path}: not a whole gzip file: {error}") from None
    if len(data) > most:
        raise StudyError(f"{path}: larger than {most >> 20} MiB")
    return data


def _depth(data: bytes) -> int:
    """Of the deepest place, by brackets; those in texts count as well."""
    now = deepest = 0
    for sign in data.translate(None, _OTHERS):
        now += 1 if sign in b"[{" else -1
        deepest = max(now, deepest)
    return deepest


def _not_json(word: str) -> float:
    raise ValueError(f"{word} is no number of JSON")


def _whole(digits: str) -> int:
    if len(digits) > 20 or not -(1 << 63) <= (value := int(digits)) < 1 << 64:
        raise ValueError("a whole number of more than 64 bits")
    return value


def _real(digits: str) -> float:
    if math.isinf(value := float(digits)):
        raise ValueError(f"{digits[:20]} is greater than any number of 64 bits")
    return value


def _loaded(text: str, any_number: bool) -> Any:
    """json.loads, which is faster where no number can be too large: Python's have no end, others' do."""
    if any_number:
        return json.loads(text)
    hooks = {"parse_int": _whole, "parse_float": _real} if _LARGE.search(text) else {}
    return json.loads(text, parse_constant=_not_json, **hooks)


def parsed(data: bytes, where: str, any_number: bool = False) -> Any:
    """The JSON in `data`, which is UTF-8. Raises StudyError: `where`, line and column.

    `any_number`: NaN and numbers of over 64 bits pass, for a reader that names their keys.
    """
    try:
        if _depth(data) > DEEPEST and _depth(_TEXTS.sub(b"", data)) > DEEPEST:
            raise StudyError(f"{where}: nested too deep")
        text = data.decode("utf-8")
        made = _loaded(text, any_number)
        if _HALF.search(text):
            json.dumps(made, ensure_ascii=False).encode()
        return made
    except json.JSONDecodeError as error:
        raise StudyError(f"{where}:{error.lineno}:{error.colno}: {error.msg}") from None
    except UnicodeEncodeError:
        raise StudyError(f"{where}: a text has half of a surrogate pair") from None
    except RecursionError:
        raise StudyError(f"{where}: nested too deep") from None
    except ValueError as error:  # not UTF-8; a number of thousands of digits
        raise StudyError(f"{where}: {error}") from None


def read_json(path: Path, any_number: bool = False) -> Any:
    """`parsed` of `path`, which may be packed (`stored`). Raises StudyError with file, line and column."""
    try:
        return parsed(content(path), str(path), any_number)
    except OSError as error:
        raise StudyError(f"{path}: {error.strerror or error}") from None
