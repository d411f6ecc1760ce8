"""What the processor's packages say that they have used: RAPL by Linux's powercap, of Intel and AMD.

Without powercap it is perf's event power/energy-pkg/. Sources: Documentation/power/powercap/powercap.rst, and
sysfs-class-powercap and sysfs-bus-event_source-devices-events of Documentation/ABI/testing. Zones below a
package (core, uncore, dram) are parts of it or beside it and are not added; nor is `psys`, which holds the
packages. Changes nothing.
"""

from __future__ import annotations

import ctypes
import functools
import os
import re
import struct
from collections.abc import Mapping
from pathlib import Path

from study.core.host.topology import cpus_of

ZONES = Path("/sys/class/powercap")
PMU = Path("/sys/bus/event_source/devices/power")
PERF_EVENT_OPEN, CLOSE_ON_EXEC = 298, 8  # of x86-64, which alone has RAPL
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


@functools.cache
def _events(pmu: Path) -> tuple[dict[Path, tuple[int, float]], str | None]:
    """Of perf's event, by package: its open counter and J per count; else why there is none."""
    event = re.search(r"event=(0x[0-9a-f]+)", _text(pmu / "events/energy-pkg") or "")
    cpus = cpus_of(_text(pmu / "cpumask"))
    try:
        kind, joule = int(_text(pmu / "type") or ""), float(_text(pmu / "events/energy-pkg.scale") or "")
    except ValueError:
        event = None
    if not event or not cpus:
        return {}, f"{pmu} has no energy-pkg"
    # struct perf_event_attr of 64 bytes, which counts from now on: type, size, config, and the rest 0.
    attributes = struct.pack("<IIQ", kind, 64, int(event[1], 16)) + bytes(48)
    call, found = ctypes.CDLL(None, use_errno=True).syscall, {}
    for cpu in cpus:
        counter = call(PERF_EVENT_OPEN, attributes, -1, cpu, -1, ctypes.c_ulong(CLOSE_ON_EXEC))
        if counter < 0:
            for opened, _ in found.values():
                os.close(opened)
            return {}, f"perf refuses power/energy-pkg/: {os.strerror(ctypes.get_errno())}"
        found[pmu / f"cpu{cpu}"] = counter, joule
    return found, None


def missing() -> str | None:
    """Why there is no energy, in one line; None: it can be read."""
    if not (found := packages()):
        no_event = _events(PMU)[1]
        return no_event and (
            f"no energy counter: {ZONES} has no package of RAPL (intel-rapl:N), and {no_event}; "
            "it would add J per frame"
        )
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
    if not (zones := packages()):
        events = _events(PMU)[0].items()
        counts = {path: (int.from_bytes(os.read(file, 8), "little"), joule) for path, (file, joule) in events}
        return {path: round(count * joule * 1e6) for path, (count, joule) in counts.items()} or None
    found = {path: _text(path / "energy_uj") for path in zones}
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
