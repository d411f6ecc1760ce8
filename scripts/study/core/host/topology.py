"""Which CPUs are fast, which share a core, and what their caches are: from sysfs. Changes nothing."""

import os
import re
from collections.abc import Collection
from pathlib import Path

from study.core.host import read_text
from study.core.run_schema import Cache, Pinned

SYSTEM = Path("/sys/devices/system/cpu")
_HYBRID = (("P-core", "cpu_core"), ("E-core", "cpu_atom"), ("LP E-core", "cpu_lowpower"))


def cpus_of(text: str) -> list[int]:
    """A kernel's list like "0-3,8"; what is none gives nothing."""
    found: list[int] = []
    for part in text.split(","):
        if match := re.fullmatch(r"(\d+)(?:-(\d+))?", part.strip()):
            found += range(int(match[1]), int(match[2] or match[1]) + 1)
    return found


def siblings(cpu: int) -> list[int]:
    folder = SYSTEM / f"cpu{cpu}" / "topology"
    lists = (cpus_of(read_text(folder / name)) for name in ("core_cpus_list", "thread_siblings_list"))
    return next(filter(None, lists), [cpu])


def core_type(cpu: int) -> str | None:
    """P-core or E-core of a hybrid processor; by capacity where the kernel tells no more; None: all alike."""
    for name, unit in _HYBRID:
        if cpu in cpus_of(read_text(SYSTEM.parents[1] / unit / "cpus")):
            return name
    capacity = read_text(SYSTEM / f"cpu{cpu}" / "cpu_capacity")
    return f"capacity {capacity}" if capacity else None


def speed(cpu: int) -> tuple[int, int, int]:
    """The greater the faster: kind of core, capacity, highest frequency."""
    folder = SYSTEM / f"cpu{cpu}"
    names = [name for name, _ in reversed(_HYBRID)]
    kind = core_type(cpu)
    figures = (read_text(folder / name) for name in ("cpu_capacity", "cpufreq/cpuinfo_max_freq"))
    capacity, frequency = (int(text) if text.isdigit() else 0 for text in figures)
    return names.index(kind) if kind in names else len(names), capacity, frequency


def fastest(cpus: Collection[int]) -> int:
    """The last of the fastest cores, by the first of its hardware threads that may be used."""
    first = [cpu for cpu in cpus if cpu == min(set(siblings(cpu)) & set(cpus), default=cpu)]
    return max(first, key=lambda cpu: (speed(cpu), cpu))


def spread(cpu: int, threads: int, cpus: Collection[int]) -> set[int]:
    """`cpu` and threads - 1 of the others: one of each core, fast ones first, before a second."""
    ordered = sorted(cpus)
    at = ordered.index(cpu)
    others = ordered[at + 1 :] + ordered[:at]
    if threads <= 1 or threads > len(others):
        return {cpu} if threads <= 1 else set(ordered)
    taken = {min(siblings(cpu)): 1}
    ranked: list[tuple[int, int, int]] = []
    for other in sorted(others, key=speed, reverse=True):  # stable: the next first
        core = min(siblings(other))
        ranked.append((taken.get(core, 0), len(ranked), other))
        taken[core] = taken.get(core, 0) + 1
    return {cpu, *(other for _, _, other in sorted(ranked)[: threads - 1])}


def caches(cpu: int) -> list[Cache]:
    """Caches as the kernel lists them; sizes as it writes them, e.g. 48K."""
    files = ("level", "type", "size", "ways_of_associativity", "shared_cpu_list")
    folders = sorted((SYSTEM / f"cpu{cpu}" / "cache").glob("index*"))
    told = ([read_text(folder / file) or None for file in files] for folder in folders)
    return [Cache(level=a, type=b, size=c, ways=d, shared_by=e) for a, b, c, d, e in told]


def pinned(cpu: int) -> Pinned:
    """Kind, siblings and highest frequency of the CPU that is measured on."""
    governor = read_text(SYSTEM / f"cpu{cpu}" / "cpufreq" / "scaling_governor")
    return Pinned(
        cpu=cpu,
        core_type=core_type(cpu),
        siblings=siblings(cpu),
        max_khz=speed(cpu)[2] or None,
        governor=governor or None,
    )


USABLE = sorted(os.sched_getaffinity(0))  # before a script moves itself out of the way
FASTEST = fastest(USABLE)
