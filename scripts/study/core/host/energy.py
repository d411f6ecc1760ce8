"""What the processor's packages say that they have used: RAPL by Linux's powercap, of Intel and AMD.

Source: Documentation/power/powercap/powercap.rst, and the ABI in
Documentation/ABI/testing/sysfs-class-powercap. Zones below a package (core, uncore, dram) are parts of it or
beside it and are not added; nor is `psys`, which holds the packages. Changes nothing.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

ZONES = Path("/sys/class/powercap")
_WHOLE = re.compile(r"intel-rapl:\d+")  # a zone of its own: parts have a second number


def _text(path: Path) -> str | None:
    try:
        return path.read_text(encoding="ascii").strip()
    except (OSError, UnicodeDecodeError):
        return None


def packages() -> list[Path]:
    """Folders of the packages, by number."""
    if not ZONES.is_dir():
        return []
    found = [path for path in ZONES.iterdir() if _WHOLE.fullmatch(path.name)]
    named = [path for path in found if (_text(path / "name") or "").startswith("package")]
    return sorted(named, key=lambda path: int(path.name.partition(":")[2]))


def missing() -> str | None:
    """Why there is no energy, in one line; None: it can be read."""
    if not (found := packages()):
        return f"no energy counter: {ZONES} has no package of RAPL (intel-rapl:N); it would add J per frame"
    for path in found:
        counter = path / "energy_uj"
        try:
            int(counter.read_text(encoding="ascii"))
        except PermissionError:
            return f"needs read permission of {counter} (sudo chmod a+r {counter}); it would add J per frame"
        except (OSError, ValueError):
            return f"no energy counter: {counter} cannot be read; it would add J per frame"
    return None


def reading() -> dict[Path, int] | None:
    """Package → µJ since some time; None where one cannot be read."""
    found = {path: _text(path / "energy_uj") for path in packages()}
    numbers = {path: int(text) for path, text in found.items() if text and text.isdigit()}
    return numbers if numbers and len(numbers) == len(found) else None


def joules(before: Mapping[Path, int] | None, now: Mapping[Path, int] | None) -> float | None:
    """Of all packages between two readings; None: not known.

    A counter begins at 0 again behind its `max_energy_range_uj`. Once is made up for; twice cannot be seen
    (a busy server needs some ten minutes for it).
    """
    if not before or not now or before.keys() != now.keys():
        return None
    total = 0
    for path, end in now.items():
        used = end - before[path]
        if used < 0:
            around = _text(path / "max_energy_range_uj")
            if not around or not around.isdigit():
                return None
            used += int(around) + 1
        total += used
    return total / 1e6
