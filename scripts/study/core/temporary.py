"""Temporary folders, which go with all in them at the end, also at a signal (cli.main)."""

import contextlib
import tempfile
from collections.abc import Iterator
from pathlib import Path


@contextlib.contextmanager
def folder(beside: Path | None = None, prefix: str = "stepwise-") -> Iterator[Path]:
    """A new one in `beside`, else in the system's place for such. Moved away it stays."""
    with tempfile.TemporaryDirectory(dir=beside, prefix=prefix) as made:
        yield Path(made)
