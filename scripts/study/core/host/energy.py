"""What the processor's packages say that they have used: RAPL by Linux's powercap, of Intel and AMD.

Source: Documentation/power/powercap/powercap.rst. Zones below a package (core, uncore, dram) are parts of it
or beside it and are not added; nor is `psys`, which holds the packages. Changes nothing.
"""

import re
from collections.abc import Mapping
from pathlib import Path

from study.core.host import read_text

ZONES = Path("/sys/class/powercap")
_WHOLE = re.compile(r"intel-rapl:\d+")  # a zone of its own: parts have a second number


def packages() -> list[Path]:
    found = [path for path in ZONES.iterdir() if _WHOLE.fullmatch(path.name)] if ZONES.is_dir() else []
    named = [path for path in found if read_text(path / "name").startswith("package")]
    return sorted(named, key=lambda path: int(path.name.partition(":")[2]))


def missing() -> str | None:
    """Why there is no energy, in one line; None: it can be read."""
    if not (found := packages()):
        return f"no energy counter: {ZONES} has no package of RAPL (intel-rapl:N); it would add J per frame"
    for counter in (path / "energy_uj" for path in found):
        if not read_text(counter).isdigit():
            return f"needs read permission of {counter} (sudo chmod a+r {counter}); it would add J per frame"
    return None


def reading() -> dict[Path, int] | None:
    """Package → µJ since some time; None where one cannot be read."""
    found = {path: read_text(path / "energy_uj") for path in packages()}
    return {path: int(text) for path, text in found.items()} if found and missing() is None else None


def joules(before: Mapping[Path, int] | None, now: Mapping[Path, int] | None) -> float | None:
    """Energy of all packages between two readings; None: not known. That a counter began at 0 again once is
    made up for; twice cannot be seen (a busy server needs some ten minutes for it)."""
    if not before or not now or before.keys() != now.keys():
        return None
    total = 0
    for path, end in now.items():
        used = end - before[path]
        if used < 0:
            around = read_text(path / "max_energy_range_uj")
            if not around.isdigit():
                return None
            used += int(around) + 1
        total += used
    return total / 1e6
