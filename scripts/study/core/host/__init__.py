"""The machine and the tools at hand: CPUs, quotas, the checkout, children that end in time."""

from pathlib import Path


def read_text(path: Path | str) -> str:
    """What stands in a file of the kernel's; "" where it cannot be read."""
    try:
        return Path(path).read_text(encoding="utf-8").strip()
    except (OSError, UnicodeDecodeError):
        return ""
