"""What results/README.md says of a file's keys."""

from __future__ import annotations

import re
from pathlib import Path

README = Path(__file__).parents[2] / "results" / "README.md"


def keys(file: str) -> set[str]:
    """Names in code marks in the section of that file; none where there is no such section."""
    for section in re.split(r"^##+ ", README.read_text(encoding="utf-8"), flags=re.MULTILINE)[1:]:
        if file in section.partition("\n")[0]:
            return set(re.findall(r"`([A-Za-z0-9_]+)`", section))
    return set()
