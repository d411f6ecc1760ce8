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
    """Of a file, unpacked if its name ends in .gz. Raises StudyError."""
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
    except (ValueError, RecursionError) as error:  # not UTF-8
        raise StudyError(f"{path}: {error}") from None


def line(path: Path, where: str) -> int:
    """The line of the JSON file `path` in which the value `where` begins, like $.results[0].times[2]; that of
    the last step there is where the path goes on. The file has been read before."""
    text = content(path).decode("utf-8-sig", errors="replace")
    decoder, space = json.JSONDecoder(), re.compile(r"[\s,:]*")

    def skip(at: int) -> int:
        found = space.match(text, at)
        return found.end() if found else at

    at = skip(0)
    for name, place in re.findall(r"\.(\w+)|\[(\d+)\]", where):
        inner, number = skip(at + 1), 0
        while text[inner : inner + 1] not in ("", "]", "}"):
            known = str(number)
            if text[at] == "{":
                known, end = decoder.raw_decode(text, inner)
                inner = skip(end)
            if known == (name or place):
                at = inner
                break
            inner, number = skip(decoder.raw_decode(text, inner)[1]), number + 1
        else:
            break
    return text.count("\n", 0, at) + 1
