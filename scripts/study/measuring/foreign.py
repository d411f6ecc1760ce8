"""Times that other tools measured: google/benchmark's, hyperfine's and pyperf's JSON, as runs of programs.

What each calls a sample is one here: google/benchmark's repetition, hyperfine's launch, pyperf's worker
process with its values. Aggregates, warm-ups and calibrations are none. All times become ns.
"""

import datetime
import json
import math
import re
import statistics
from collections import Counter
from collections.abc import Iterable, Iterator
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
GOOGLE, HYPERFINE, PYPERF = "google/benchmark", "hyperfine", "pyperf"


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
    date: str | None = None
    host_name: str | None = None
    num_cpus: int | None = None
    library_build_type: str | None = None
    cpu_scaling_enabled: bool | None = None


class Google(msgspec.Struct):
    context: GoogleContext
    benchmarks: list[GoogleRow]


class HyperfineRow(msgspec.Struct):
    command: str
    times: list[float] = []
    exit_codes: list[int | None] = []
    parameters: dict[str, str] = {}


class Hyperfine(msgspec.Struct):
    results: list[HyperfineRow]


class Metadata(msgspec.Struct):
    """Of a pyperf file, of a benchmark or of a worker: what is not in the one is in the one above it."""

    name: str | None = None
    unit: str | None = None
    date: str | None = None
    hostname: str | None = None
    cpu_model_name: str | None = None
    cpu_count: int | None = None


class Worker(msgspec.Struct):
    """Without values it found out how many loops take long enough."""

    values: list[float] = []
    metadata: Metadata = msgspec.field(default_factory=Metadata)


class Benchmark(msgspec.Struct):
    runs: list[Worker]
    metadata: Metadata = msgspec.field(default_factory=Metadata)


class Pyperf(msgspec.Struct):
    benchmarks: list[Benchmark]
    metadata: Metadata = msgspec.field(default_factory=Metadata)


@dataclass
class Series:
    """One program: of each sample its values in ns, and the exit status where it is known."""

    program: Program
    samples: list[list[float]] = field(default_factory=list)
    statuses: list[int | None] = field(default_factory=list)

    @property
    def medians(self) -> list[float]:
        return [statistics.median(values) for values in self.samples]


@dataclass
class Found:
    """What a file has: series by name and case, what was skipped or failed, and the machine as far as known.
    `time`: ISO 8601, UTC."""

    tool: str
    series: dict[tuple[str, str], Series] = field(default_factory=dict)
    skipped: list[Left] = field(default_factory=list)
    failures: list[Left] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)
    time: str | None = None
    host: str | None = None
    cpu: Cpu = field(default_factory=Cpu)

    def of(self, name: str, case: str = "") -> Series:
        program = Program(name=name, case=case, command=[name])
        return self.series.setdefault((name, case), Series(program))


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

    def ns(self, value: float | None, unit: float, where: str) -> float:
        """Raises StudyError for what is no duration."""
        if value is None or not 0 < value < math.inf:
            raise self.wrong(f"{'no time' if value is None else value} is no duration", where)
        return value * unit


def utc(text: str | None) -> str | None:
    """A date as ISO 8601 in UTC; one without a zone is taken for UTC. None for what is no date."""
    try:
        date = datetime.datetime.fromisoformat(text or "")
    except ValueError:
        return None
    date = date if date.tzinfo else date.replace(tzinfo=datetime.UTC)
    return date.astimezone(datetime.UTC).isoformat(timespec="seconds")


def google(source: Source) -> Found:
    file: Google = source.typed(Google)
    about = file.context
    found = Found(GOOGLE, time=utc(about.date), host=about.host_name, cpu=Cpu(logical_cpus=about.num_cpus))
    if about.library_build_type == "debug":
        found.remarks.append(
            "google/benchmark itself was built for debugging, which its times may have in them"
        )
    if about.cpu_scaling_enabled:
        found.remarks.append("the CPU's clock was not fixed (cpu_scaling_enabled)")
    names = {row.name for row in file.benchmarks}
    for number, row in enumerate(file.benchmarks):
        aggregate = AGGREGATE.search(row.name)
        if row.run_type == "aggregate" or (
            not row.run_type and aggregate and row.name[: aggregate.start()] in names
        ):
            continue
        name = row.run_name or row.name
        if row.error_occurred:
            found.failures.append(Left(spec=name, message=row.error_message))
        elif row.skipped:
            found.skipped.append(Left(spec=name, reason=row.skip_message))
        else:
            ns = source.ns(row.real_time, NS[row.time_unit], f"$.benchmarks[{number}].real_time")
            found.of(name).samples.append([ns])
    return found


def hyperfine(source: Source) -> Found:
    file: Hyperfine = source.typed(Hyperfine)
    found, seen = Found(HYPERFINE), Counter[tuple[str, str]]()
    for number, row in enumerate(file.results):
        case = " ".join(f"{name}={value}" for name, value in row.parameters.items())
        seen[row.command, case] += 1
        name = row.command + (f" #{again}" if (again := seen[row.command, case]) > 1 else "")
        statuses = row.exit_codes or [0] * len(row.times)
        if not row.times or len(statuses) != len(row.times):
            reason = f"{len(row.times)} times and {len(row.exit_codes)} exit codes"
            found.skipped.append(Left(spec=name, scene=case, reason=reason))
            continue
        series = found.of(name, case)
        for place, (seconds, status) in enumerate(zip(row.times, statuses, strict=True)):
            ns = source.ns(seconds, NS["s"], f"$.results[{number}].times[{place}]")
            if status is None:
                message = "killed by a signal"
                found.failures.append(Left(spec=name, scene=case, launch=place, message=message))
            else:
                series.samples.append([ns])
                series.statuses.append(status)
        if failed := [status for status in series.statuses if status]:
            said = f"{len(failed)} of {len(statuses)} launches ended with status {failed[0]}"
            found.remarks.append(f"{name}: {said}, which hyperfine was told to ignore")
    return found


def pyperf(source: Source) -> Found:
    file: Pyperf = source.typed(Pyperf)
    first = file.benchmarks[0].runs[0].metadata if file.benchmarks and file.benchmarks[0].runs else Metadata()
    levels = (first, file.benchmarks[0].metadata if file.benchmarks else Metadata(), file.metadata)

    def said(name: str, *levels: Metadata) -> Any:
        return next((value for level in levels if (value := getattr(level, name)) is not None), None)

    cpu = Cpu(model=said("cpu_model_name", *levels), logical_cpus=said("cpu_count", *levels))
    found = Found(PYPERF, time=utc(said("date", *levels)), host=said("hostname", *levels), cpu=cpu)
    seen = Counter[str]()
    for number, one in enumerate(file.benchmarks):
        name = said("name", one.metadata, file.metadata) or source.path.name.partition(".")[0]
        seen[name] += 1
        name += f" #{seen[name]}" if seen[name] > 1 else ""
        unit = said("unit", one.metadata, file.metadata) or "second"
        if unit != "second":
            found.skipped.append(Left(spec=name, reason=f"its unit is {unit}, which is no time"))
            continue
        for process, worker in enumerate(one.runs):
            where = f"$.benchmarks[{number}].runs[{process}].values"
            if worker.values:
                values = [source.ns(v, NS["s"], f"{where}[{i}]") for i, v in enumerate(worker.values)]
                found.of(name).samples.append(values)
    return found


def tool(content: Any) -> Any:
    """The reader of a file with that content; None where it is of none of the tools."""
    if not isinstance(content, dict):
        return None
    rows = content.get("benchmarks")
    if isinstance(content.get("results"), list):
        return hyperfine
    if isinstance(rows, list) and "context" in content:
        return google
    return pyperf if isinstance(rows, list) else None


def read(path: Path, content: Any) -> Found:
    """Raises StudyError: file, line and what is wrong; and for a file without a time."""
    found: Found = tool(content)(Source(path, content))
    found.series = {key: one for key, one in found.series.items() if one.samples}
    if not found.series:
        why = "; ".join(
            f"{one.spec}: {one.reason or one.message}" for one in (*found.skipped, *found.failures)
        )
        raise StudyError(
            f"{path}:1: no time of a sample in this file of {found.tool} ({why or 'aggregates only?'})"
        )
    if found.time is None:
        date = datetime.datetime.fromtimestamp(path.stat().st_mtime, datetime.UTC)
        found.time = date.isoformat(timespec="seconds")
    return found


def lines(found: Found, plan: Plan) -> Iterator[dict[str, Any]]:
    for of, one in zip(plan.configurations, found.series.values(), strict=True):
        for launch, values in enumerate(one.samples):
            status = {"exit_status": one.statuses[launch]} if one.statuses else {}
            for frame, ns in enumerate(values):
                yield programs.line(of, launch, ns, frame=frame, time=found.time, **status)


def written(found: Found, path: Path, results: Path) -> store.Run:
    """As a run below `results`, in a folder of its machine, as far as that is known. Raises StudyError."""
    where = found.cpu.model or found.host or found.tool
    slug = "imported-" + re.sub(r"[^a-z0-9]+", "-", where.lower()).strip("-")
    plan = Plan(
        launches=max(len(one.samples) for one in found.series.values()),
        reps=max(len(values) for one in found.series.values() for values in one.samples),
        began=found.time or "",
        programs=[one.program for one in found.series.values()],
        read_from=[str(path)],
        skipped=found.skipped,
        failures=found.failures,
    )
    context = Context(schema=1, time=found.time, machine=slug, cpu=found.cpu)
    run = programs.begin(results, slug, plan, context)
    made: Iterable[str] = (json.dumps(line) + "\n" for line in lines(found, plan))
    store.write_text(run.frames_path, "".join(made))
    programs.end(run, plan)
    return run
