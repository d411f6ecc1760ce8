"""Samples of where a program's time goes, by Linux perf: PMU cycles where there are any, else its clock.

Formats: perf-record(1), perf-script(1). perf is used for samples, their addresses and the names of library
functions; the program's own functions are found from its ELF symbols by study.counting.elf.
"""

import functools
import os
import re
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from study.core import run, temporary
from study.core.build import build
from study.core.cli import CANNOT_RUN, StudyError
from study.core.host import child, read_text
from study.core.registry import Scene, Spec

FREQUENCY = 999  # samples a second: no multiple of the timer's tick
EVENTS = ("cycles:u", "cpu-clock:u")  # in the order of preference
PARANOID = Path("/proc/sys/kernel/perf_event_paranoid")
ADDS = "adds where the time goes (hotspots, Tables 2 to 4)"
FIELDS = "pid,tid,time,period,event,ip,sym,symoff,dso"

_RECORD = ("-q", "-B", "-N", "--no-bpf-event", "-F", str(FREQUENCY))
_MAP = re.compile(
    r"^\s*(-?\d{1,20})/-?\d+\s.*PERF_RECORD_MMAP2? -?\d+/-?\d+: "
    r"\[0x([0-9a-f]+)\(0x([0-9a-f]+)\) @ (?:0x)?([0-9a-f]+)[^\]]*\]: "
    r"\S+ (.+)$"
)
_SAMPLE = re.compile(
    r"^\s*(\d{1,20})/(\d{1,20})\s+(\d+\.\d+):\s+(\d{1,20})\s+(\S+):\s+"
    r"([0-9a-f]+) (.+?)(?:\+0x[0-9a-f]+)? \((.*)\)$"
)
_OTHER = re.compile(r"PERF_RECORD_\w+")  # records that carry neither: COMM, FORK, EXIT, LOST …


@dataclass(frozen=True)
class Sample:
    """`period`: events (ns of the clock, or cycles) it stands for; `name`: as perf has it, or [unknown]."""

    pid: int
    tid: int
    time: float
    period: int
    event: str
    ip: int
    name: str
    dso: str


@dataclass(frozen=True)
class Mapping:
    """`length` bytes of the file `path` from `offset` on, mapped at `start`."""

    pid: int
    start: int
    length: int
    offset: int
    path: str


@dataclass(frozen=True)
class Recording:
    samples: list[Sample]
    mappings: list[Mapping]

    def place(self, sample: Sample) -> tuple[str, int] | None:
        """File and offset in it of a sample's address; None where nothing was mapped."""
        for m in self.mappings:
            if m.pid in (sample.pid, -1) and m.start <= sample.ip < m.start + m.length:
                return m.path, sample.ip - m.start + m.offset
        return None


def parse(text: str) -> Recording:
    """Output of `perf script --show-mmap-events -F FIELDS`. StudyError with the line that is not of that
    form, or when there is no sample.
    """
    samples, mappings = [], []
    for number, line in enumerate(text.splitlines(), 1):
        if found := _SAMPLE.match(line):
            pid, tid, time, period, event, ip, name, dso = found.groups()
            samples.append(
                Sample(int(pid), int(tid), float(time), int(period), event, int(ip, 16), name, dso)
            )
        elif found := _MAP.match(line):
            pid, *where, path = found.groups()
            mappings.append(Mapping(int(pid), *(int(one, 16) for one in where), path))
        elif line.strip() and not line.startswith("#") and not _OTHER.search(line):
            raise StudyError(f"perf script:{number}: neither a sample nor a mapping: {line[:60]!r}")
    if not samples:
        raise StudyError(f"perf script: no sample in {len(text)} characters; a longer run is required")
    return Recording(samples, mappings)


@functools.cache
def program() -> str | None:
    """Path of a perf that starts. Ubuntu's /usr/bin/perf looks for the running kernel's own and gives up
    without; any version will do here.
    """
    versions = sorted(Path("/usr/lib").glob("linux-tools*/*/perf"), reverse=True)
    for path in [shutil.which("perf"), *map(str, [*versions, *Path("/usr/lib").glob("linux-tools*/perf")])]:
        if path and _status(path, "--version") == 0:
            return path
    return None


def _status(*command: str) -> int:
    try:
        return subprocess.run(command, capture_output=True, timeout=60).returncode
    except (OSError, subprocess.TimeoutExpired):
        return 127


@functools.cache
def event() -> str | None:
    """What can be sampled here, found by trying; None: nothing."""
    perf = program()
    if perf is None:
        return None
    with temporary.folder() as folder:
        for name in EVENTS:
            data = f"{folder}/{name}"
            command = (perf, "record", *_RECORD, "-e", name)
            # A PMU that is there and counts nothing (some hypervisors) gives no sample.
            busy = ("sh", "-c", "i=0; while [ $i -lt 200000 ]; do i=$((i+1)); done")
            if _status(*command, "-o", data, "--", *busy) == 0 and _samples(perf, data):
                return name
    return None


def _samples(perf: str, data: str) -> bool:
    done = child.run([perf, "script", "-i", data, "-F", "ip"], capture_output=True)
    return done.returncode == 0 and bool(done.stdout.strip())


def missing() -> str | None:
    if program() is None:
        return f"perf is missing; linux-perf (Debian) or linux-tools-generic (Ubuntu) {ADDS}"
    if event() is not None:
        return None
    return forbidden() or f"perf records nothing here (neither {' nor '.join(EVENTS)})"


def forbidden() -> str | None:
    """The setting of the kernel that keeps users from its counters, if there is none or it does."""
    text = read_text(PARANOID)
    if not text.removeprefix("-").isdecimal():
        return "this kernel offers no perf events"
    level = int(text)
    lets = "`sudo sysctl kernel.perf_event_paranoid=2` lets it"
    return f"perf may not count here: kernel.perf_event_paranoid is {level}; {lets}" if level > 2 else None


def record(
    spec: Spec | str, scene: Scene, height: int, width: int | None, reps: int, target: str, cpu: int | None
) -> tuple[Recording, dict[str, Any]]:
    """Samples of build/SPEC/TARGET over `reps` frames, and the driver's own JSON of the same frames.

    Raises StudyError if perf or its output fails, DriverError if the driver does.
    """
    if lacking := missing():
        raise StudyError(lacking, CANNOT_RUN)
    perf, (wide, high) = str(program()), scene.size(height, width)
    driver = [str(build(spec, target)), str(scene.path), "-n", str(high), "-w", str(wide)]
    with temporary.folder() as folder:
        data = f"{folder}/perf.data"
        options = [*_RECORD, "-e", str(event()), "-o", data]
        pin = run.cpu_set(cpu, 1)
        done = child.run(
            [perf, "record", *options, "--", *driver, "--reps", str(reps), "--json"],
            capture_output=True,
            text=True,
            stdin=subprocess.DEVNULL,
            env=run.environment(more=run.GENERAL),
            preexec_fn=functools.partial(os.sched_setaffinity, 0, pin) if pin else None,
        )
        if done.returncode:
            said = [line for line in done.stderr.splitlines() if line.strip()]
            ours = [line for line in said if line.startswith("render:")]
            raise run.DriverError(done.returncode, (ours or said or [f"perf record: {done.returncode}"])[-1])
        command = [perf, "script", "-i", data, "--show-mmap-events", "-F", FIELDS]
        script = child.run(command, capture_output=True, text=True)
    if script.returncode:
        raise StudyError(f"perf script: {(script.stderr.strip().splitlines() or ['failed'])[-1]}")
    return parse(script.stdout), run._parse(done.stdout, driver[0])
