"""What a container may use of the machine, by control groups, and whether it was throttled."""

import re
from pathlib import Path

from study.core.host import read_text
from study.core.run_schema import Context, Limits

CGROUP, MOUNTED = Path("/proc/self/cgroup"), Path("/sys/fs/cgroup")


def _mounted(controller: str, otherwise: Path) -> Path:
    """The folder of a controller of version 1 and of those mounted with it, whatever their order."""
    folders = sorted(path for path in MOUNTED.glob(f"*{controller}*") if path.is_dir())
    return next((path for path in folders if controller in path.name.split(",")), otherwise)


def _groups(controller: str) -> list[Path]:
    """Folders of this process's group and of all above it; of version 1, those of the controller."""
    found = []
    for line in read_text(CGROUP).splitlines():
        _, names, place = [*line.split(":", 2), "", ""][:3]
        if names and controller not in names.split(","):
            continue
        root = _mounted(controller, MOUNTED / names) if names else MOUNTED
        parts = [part for part in Path(place).parts[1:] if part != ".."]
        found += [root.joinpath(*parts[:n]) for n in range(len(parts), -1, -1)]
    return found


def _cpus(group: Path) -> float | None:
    """CPUs' worth of time that a group may have at once."""
    two = read_text(group / "cpu.max").split()
    one = (read_text(group / f"cpu.cfs_{n}_us") for n in ("quota", "period"))
    quota, period = two if len(two) == 2 else one
    return int(quota) / int(period) if quota.isdigit() and period.isdigit() and int(period) else None


def throttled() -> int | None:
    """How often a group of this process had used up its quota since it was made; None: not known."""
    counts = [
        int(found[1])
        for group in _groups("cpu")
        for found in re.finditer(r"^nr_throttled (\d+)$", read_text(group / "cpu.stat"), re.MULTILINE)
    ]
    return sum(counts) if counts else None


def limits() -> Limits:
    cpus = [n for n in map(_cpus, _groups("cpu")) if n is not None]
    memory = [
        int(text)
        for group in _groups("memory")
        for name in ("memory.max", "memory.limit_in_bytes")
        if (text := read_text(group / name)).isdigit() and int(text) < 1 << 60  # version 1: no limit is 2^63
    ]
    return Limits(cpus=min(cpus, default=None), memory_bytes=min(memory, default=None), throttled=throttled())


def notices(context: Context) -> list[str]:
    """What a run's context says of quotas that its times must not be read without."""
    said = []
    usable, quota = context.cpu.usable_cpus, context.limits.cpus
    if quota is not None and usable and quota < usable:
        whose = "times of more threads are the quota's" if quota >= 1 else "all times are the quota's"
        said.append(f"this container may use {quota:g} CPUs' time (its quota) on {usable} CPUs: {whose}")
    before, after = context.limits.throttled, context.end.limits.throttled if context.end else None
    if before is not None and after is not None and after > before:
        said.append(f"throttled {after - before} times while it was measured (nr_throttled)")
    return said
