"""JSON files, plain or packed, with errors that name file, line and column."""

from __future__ import annotations

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


def unpacked(packed: Path) -> bytes:
    """Raises StudyError for a file that is cut short or no gzip file, OSError for one that cannot be read."""
    try:
        return gzip.decompress(packed.read_bytes())
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        raise StudyError(f"{packed}: not a whole gzip file: {error}") from None


def read_json(path: Path) -> Any:
    """Of `path`, which may be packed (`stored`). Raises StudyError with file, line and column."""
    try:
        data = unpacked(path) if path.suffix == ".gz" else path.read_bytes()
        return json.loads(data.decode("utf-8"))
    except json.JSONDecodeError as error:
        raise StudyError(f"{path}:{error.lineno}:{error.colno}: {error.msg}") from None
    except RecursionError:
        raise StudyError(f"{path}: nested too deep") from None
    except (OSError, UnicodeDecodeError) as error:
        raise StudyError(f"{path}: {getattr(error, 'strerror', None) or error}") from None
