"""Processes that a test started, as the kernel has them."""

from __future__ import annotations

import time
from pathlib import Path


def is_alive(pid: int | str) -> bool:
    """A zombie, which its parent has not looked at, is none."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except OSError:  # it ended between the opening and the reading of the file, or before
        return False


def ends(pid: int | str) -> bool:
    """Whether it does within five seconds."""
    for _ in range(100):
        if not is_alive(pid):
            return True
        time.sleep(0.05)
    return False


def children(pid: int) -> set[int]:
    return set(map(int, Path(f"/proc/{pid}/task/{pid}/children").read_text().split()))


def only_warned(stderr: str) -> bool:
    """Whether a driver said nothing, or that a picture may not show its scene right."""
    return all(line.startswith("render: warning: ") for line in stderr.splitlines())
