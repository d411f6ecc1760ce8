"""JSON files, plain or packed, with errors that name file, line and column."""

import gzip
import json
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
