"""Temporary files and folders that are removed however the process is ended, SIGKILL apart."""

from __future__ import annotations

import contextlib
import signal
import tempfile
from collections.abc import Iterator
from pathlib import Path

ENDING = (signal.SIGTERM, signal.SIGINT)


@contextlib.contextmanager
def held() -> Iterator[None]:
    """SIGTERM and SIGINT wait for the end of the block, when its files have names. Start no child inside."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, ENDING)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextlib.contextmanager
def folder(beside: Path | None = None, prefix: str = "stepwise-") -> Iterator[Path]:
    """A new folder in `beside`, else in the system's place for such; removed with all in it at the end."""
    made = None
    try:
        with held():
            made = tempfile.TemporaryDirectory(dir=beside, prefix=prefix)
        yield Path(made.name)
    finally:
        if made:
            made.cleanup()


@contextlib.contextmanager
def file(beside: Path, prefix: str) -> Iterator[Path]:
    """A new empty file in `beside`; removed at the end, if it still has its name. Raises OSError."""
    made = None
    try:
        with held():
            handle, name = tempfile.mkstemp(dir=beside, prefix=prefix)
            made = Path(name)
        open(handle).close()
        yield made
    finally:
        if made:
            made.unlink(missing_ok=True)
