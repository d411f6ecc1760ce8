"""JSON files, plain or packed, with errors that name file, line and column."""

import gzip
import json
import re
import zlib
from pathlib import Path
from typing import Any

from study.core.cli import StudyError


def stored(path: Path) -> Path:
    """`path`, or where that is not the packed one (path.gz) of a published run; `path` if neither is."""
    packed = path.with_name(path.name + ".gz")
    return packed if packed.exists() and not path.exists() else path


def content(path: Path) -> bytes:
    """The bytes of a file, unpacked if its name ends in .gz. Raises StudyError."""
    try:
        data = path.read_bytes()
        return gzip.decompress(data) if path.suffix == ".gz" else data
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        raise StudyError(f"{path}: not a whole gzip file: {error}") from None
    except OSError as error:
        raise StudyError(f"{path}: {error.strerror or error}") from None


def read_json(path: Path) -> Any:
    """The JSON in `path`, which may be packed. Raises StudyError with file, line and column."""
    try:
        return json.loads(content(path))
    except json.JSONDecodeError as error:
        raise StudyError(f"{path}:{error.lineno}:{error.colno}: {error.msg}") from None
    except UnicodeDecodeError as error:
        line = error.object.count(b"\n", 0, error.start) + 1
        raise StudyError(f"{path}:{line}: not {error.encoding}: {error.reason}") from None
    except (ValueError, RecursionError) as error:
        raise StudyError(f"{path}: {error}") from None


def line(path: Path, where: str) -> int:
    """The line of the JSON file `path` in which a value begins, like $.results[0].times[2]; where that is not
    there, its parent. The file has been read before."""
    text = content(path).decode("utf-8-sig", errors="replace")
    value, space = json.JSONDecoder().raw_decode, re.compile(r"[\s,:]*")

    def skip(at: int) -> int:
        return space.match(text, at).end()  # type: ignore[union-attr]

    at = skip(0)
    for name, place in re.findall(r"\.(\w+)|\[(\d+)\]", where):
        inner, number, keyed = skip(at + 1), 0, text[at] == "{"
        while text[inner : inner + 1] not in ("", "]", "}"):
            key, end = value(text, inner) if keyed else (number, inner)
            inner, number = skip(end), number + 1
            if str(key) == (name or place):
                at = inner
                break
            inner = skip(value(text, inner)[1])
    return text.count("\n", 0, at) + 1
