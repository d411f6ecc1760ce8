"""Times that other tools measured: google/benchmark's, hyperfine's and pyperf's JSON, as runs of programs.

What each calls a sample is one here: google/benchmark's repetition, hyperfine's launch, pyperf's worker
process with its values. Aggregates, warm-ups and calibrations are none. All times become ns.
"""

import datetime
import json
import math
import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import msgspec

from study.core import json_files, store
from study.core.cli import StudyError
from study.core.run_schema import Context, Cpu, Left, Plan, Program
from study.measuring import programs

NS = {"ns": 1.0, "us": 1e3, "ms": 1e6, "s": 1e9}
AGGREGATE = re.compile(r"_(mean|median|stddev|cv|min|max|BigO|RMS)$")  # before 1.5 no row said so itself


class GoogleRow(msgspec.Struct):
    """A repetition, an aggregate, or a word on why there is none."""

    name: str
    run_name: str = ""
    run_type: str = ""
    error_occurred: bool = False
    error_message: str = ""
    skipped: bool = False
    skip_message: str = ""
    real_time: float | None = None
    time_unit: Literal["ns", "us", "ms", "s"] = "ns"


class GoogleContext(msgspec.Struct):
    date: str = ""
    host_name: str = ""
    num_cpus: int | None = None
    library_build_type: str = ""


class Google(msgspec.Struct):
    context: GoogleContext
    benchmarks: list[GoogleRow]


class HyperfineRow(msgspec.Struct):
    command: str
    times: list[float] = []
    exit_codes: list[int | None] = []  # none: an older version, which stopped at a failure
    parameters: dict[str, str] = {}


class Hyperfine(msgspec.Struct):
    results: list[HyperfineRow]


class Metadata(msgspec.Struct):
    """Metadata of a pyperf file, a benchmark or a worker: what is not in the one is in the one above it."""

    name: str = ""
    unit: str = ""
    date: str = ""
    hostname: str = ""
    cpu_model_name: str | None = None
    cpu_count: int | None = None


class Worker(msgspec.Struct):
    """A process. Without values it found out how many loops take long enough."""

    values: list[float] = []
    metadata: Metadata = msgspec.field(default_factory=Metadata)


class Benchmark(msgspec.Struct):
    runs: list[Worker]
    metadata: Metadata = msgspec.field(default_factory=Metadata)


class Pyperf(msgspec.Struct):
    benchmarks: list[Benchmark]
    metadata: Metadata = msgspec.field(default_factory=Metadata)


@dataclass
class Found:
    """What a file has: by program and case the samples, each its values in ns and what else is known of it;
    what was skipped or failed; and the machine as far as it is known. `time`: ISO 8601, UTC."""

    tool: str
    time: str = ""
    host: str = ""
    cpu: Cpu = field(default_factory=Cpu)
    samples: dict[tuple[str, str], list[tuple[list[float], dict[str, int]]]] = field(default_factory=dict)
    skipped: list[Left] = field(default_factory=list)
    failures: list[Left] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)

    def add(self, name: str, values: list[float], case: str = "", **more: int) -> None:
        self.samples.setdefault((name, case), []).append((values, more))

    def unused(self, name: str, case: str = "") -> str:
        """The name; of a second program of that name and case another one."""
        others = (f"{name} ({number})" for number in range(2, len(self.samples) + 2))
        return next(one for one in (name, *others) if (one, case) not in self.samples)


@dataclass(frozen=True)
class Source:
    """A file: where it is, and its content as JSON."""

    path: Path
    content: Any

    def wrong(self, what: str, where: str) -> StudyError:
        """`where`: like $.results[0].times[2], as msgspec says it."""
        return StudyError(f"{self.path}:{json_files.line(self.path, where)}: {where}: {what}")

    def typed(self, kind: type) -> Any:
        try:
            return msgspec.convert(self.content, kind)
        except msgspec.ValidationError as error:
            what, _, where = str(error).replace("`", "").partition(" - at ")
            raise self.wrong(what, where or "$") from None

    def ns(self, value: float | None, unit: str, where: str) -> float:
        """Raises StudyError for what is no duration."""
        if value is None or not 0 < value < math.inf:
            raise self.wrong("no duration" if value is None else f"{value} is no duration", where)
        return value * NS[unit]


def utc(text: str) -> str:
    """A date as ISO 8601 in UTC; one without a zone is taken for UTC. Empty for what is no date."""
    try:
        date = datetime.datetime.fromisoformat(text)
    except ValueError:
        return ""
    date = date if date.tzinfo else date.replace(tzinfo=datetime.UTC)
    return date.astimezone(datetime.UTC).isoformat(timespec="seconds")


def google(source: Source) -> Found:
    file: Google = source.typed(Google)
    about, names = file.context, {row.name for row in file.benchmarks}
    found = Found("google/benchmark", utc(about.date), about.host_name, Cpu(logical_cpus=about.num_cpus))
    if about.library_build_type == "debug":
        found.remarks.append("google/benchmark itself was built for debugging, which takes time of its own")
    for number, row in enumerate(file.benchmarks):
        name, suffix = row.run_name or row.name, AGGREGATE.search(row.name)
        old = not row.run_type and suffix and row.name[: suffix.start()] in names
        if row.run_type == "aggregate" or old:
            continue
        if row.error_occurred:
            found.failures.append(Left(spec=name, message=row.error_message))
        elif row.skipped:
            found.skipped.append(Left(spec=name, reason=row.skip_message))
        else:
            found.add(name, [source.ns(row.real_time, row.time_unit, f"$.benchmarks[{number}].real_time")])
    return found


def hyperfine(source: Source) -> Found:
    file: Hyperfine = source.typed(Hyperfine)
    found = Found("hyperfine")
    for number, row in enumerate(file.results):
        case = " ".join(f"{name}={value}" for name, value in row.parameters.items())
        name, codes = found.unused(row.command, case), row.exit_codes or [0] * len(row.times)
        short = 0 in row.times  # after hyperfine has taken off its shell's own time
        if short or not row.times or len(codes) != len(row.times):
            reason = f"{len(row.times)} times and {len(codes)} exit codes"
            reason = "faster than the start of its shell; time it with hyperfine -N" if short else reason
            found.skipped.append(Left(spec=name, scene=case, reason=reason))
            continue
        for place, (seconds, code) in enumerate(zip(row.times, codes, strict=True)):
            ns = source.ns(seconds, "s", f"$.results[{number}].times[{place}]")
            if code is None:
                left = Left(spec=name, scene=case, launch=place, message="killed by a signal")
                found.failures.append(left)
            else:
                found.add(name, [ns], case, exit_status=code)
        if failed := [code for code in codes if code]:
            said = f"{len(failed)} of {len(codes)} launches ended with status {failed[0]}"
            found.remarks.append(f"{name}: {said}, which hyperfine was told to ignore")
    return found


def pyperf(source: Source) -> Found:
    file: Pyperf = source.typed(Pyperf)
    runs = [worker.metadata for one in file.benchmarks for worker in one.runs]

    def said(name: str, *levels: Metadata) -> Any:
        return next((value for level in levels if (value := getattr(level, name))), None)

    every = (file.metadata, *(one.metadata for one in file.benchmarks), *runs)
    cpu = Cpu(model=said("cpu_model_name", *every), logical_cpus=said("cpu_count", *every))
    found = Found("pyperf", utc(said("date", *every) or ""), said("hostname", *every) or "", cpu)
    for number, one in enumerate(file.benchmarks):
        levels = (one.metadata, file.metadata)
        name = found.unused(said("name", *levels) or source.path.name.partition(".")[0])
        if (unit := said("unit", *levels) or "second") != "second":
            found.skipped.append(Left(spec=name, reason=f"its unit is {unit}, which is no time"))
            continue
        for process, worker in enumerate(one.runs):
            where = f"$.benchmarks[{number}].runs[{process}].values"
            values = [source.ns(value, "s", f"{where}[{i}]") for i, value in enumerate(worker.values)]
            if values:
                found.add(name, values)
    return found


def reader(content: Any) -> Any:
    """The reader of a file with that content; None where it is of none of the tools."""
    if not isinstance(content, dict):
        return None
    if isinstance(content.get("results"), list):
        return hyperfine
    if isinstance(content.get("benchmarks"), list):
        return google if "context" in content else pyperf
    return None


def read(path: Path, content: Any) -> Found:
    """Raises StudyError: file, line and what is wrong; and for a file without a time."""
    found: Found = reader(content)(Source(path, content))
    if not found.samples:
        left = [f"{one.spec}: {one.reason or one.message}" for one in (*found.skipped, *found.failures)]
        why = "; ".join(left) or "an empty list" if found.tool == "hyperfine" else "aggregates alone are none"
        raise StudyError(f"{path}:1: this file of {found.tool} has no sample ({why})")
    made = datetime.datetime.fromtimestamp(path.stat().st_mtime, datetime.UTC)
    found.time = found.time or made.isoformat(timespec="seconds")
    return found


def written(found: Found, path: Path, results: Path) -> store.Run:
    """Writes a run below `results`, in a folder of its machine as far as it is known. Raises StudyError."""
    where = found.cpu.model or found.host or found.tool
    slug = "imported-" + re.sub(r"[^a-z0-9]+", "-", where.lower()).strip("-")
    every = found.samples.values()
    plan = Plan(
        launches=max(map(len, every)),
        reps=max(len(values) for samples in every for values, _ in samples),
        began=found.time,
        programs=[Program(name=name, case=case, command=[name]) for name, case in found.samples],
        read_from=[str(path)],
        skipped=found.skipped,
        failures=found.failures,
    )
    run = programs.begin(results, slug, plan, Context(schema=1, time=found.time, machine=slug, cpu=found.cpu))
    lines: Iterable[dict[str, Any]] = (
        programs.line(of, launch, ns, frame=frame, time=found.time, **more)
        for of, samples in zip(plan.configurations, every, strict=True)
        for launch, (values, more) in enumerate(samples)
        for frame, ns in enumerate(values)
    )
    store.write_text(run.frames_path, "".join(json.dumps(line) + "\n" for line in lines))
    programs.end(run, plan)
    return run
