"""What perf stat prints, in the forms that its versions and options have: -x with ";", "," or "|", and -j.

Forms: perf-stat(1), CSV FORMAT and JSON FORMAT. Lines of intervals, of sockets, dies, cores, CPUs and threads
are added up. On a hybrid machine perf counts an event once for each kind of core; the kind that did not run
reads <not counted>.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from study.core.cli import CANNOT_RUN, StudyError

UNSUPPORTED, UNCOUNTED = "<not supported>", "<not counted>"
_FASTEST = 1e12  # events per second that no core reaches
_TIME = re.compile(r"\s*\d+[.,]\d{9}")  # of an interval
_PLACE = re.compile(r"([SDN]\d+\S*)|CPU\d+|\S.*-\d+")  # with the number of CPUs in it; one CPU; one thread
_NUMBER = re.compile(r"-?\d+([.,]\d+)?|nan|-?inf", re.IGNORECASE)
_PLACES = ("cpu", "core", "die", "socket", "node", "cluster", "cache", "thread")  # keys of JSON
_DATA = re.compile(
    r"\s*(-?\d|nan\b|<not |[;,|]|([SDN]\d+\S*?[;,|]\s*\d+|(CPU|[^;,|]*-)\d+)[;,|]\s*(-?\d|<not ))"
)
_KINDS = re.compile(r"cpu_(core|atom|lowpower)/(.*)/(.*)")


@dataclass(frozen=True)
class Line:
    """One event of perf's output. `value` is perf's, scaled to the whole run; `enabled`: share of it, %."""

    event: str
    value: float
    enabled: float


@dataclass(frozen=True)
class _Printed:
    """A line as printed: where it stands, which of the repeated parts it is of, its texts."""

    where: str
    part: tuple[str, str]  # interval, place
    event: str
    value: str
    running: str  # ns that the counter ran
    share: str  # of the time that the event was asked for, %

    @property
    def base(self) -> str:
        """The event without the kind of core."""
        if match := _KINDS.fullmatch(self.event):
            return f"{match[2]}:{match[3]}" if match[3] else match[2]
        return self.event


def parse(path: Path, names: Sequence[str]) -> dict[str, Line]:
    """Output of perf stat of the events `names`, which were asked for in that order.

    StudyError, with file and line, for what is none; for an event that is not supported or was not counted;
    and for a value that no processor reaches.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise StudyError(f"{path}: {getattr(error, 'strerror', None) or 'not text'}") from None
    parts: dict[tuple[str, str], dict[str, list[_Printed]]] = {}
    for one in _printed(path, text):
        parts.setdefault(one.part, {}).setdefault(one.base, []).append(one)
    for part in parts.values() or [{}]:
        if len(part) != len(names):
            raise StudyError(f"{path}: {len(part)} events, {len(names)} were asked for; cut off?")
    return {
        name: _sum([_line(list(part.values())[i]) for part in parts.values()]) for i, name in enumerate(names)
    }


def _sum(lines: list[Line]) -> Line:
    return Line(lines[0].event, sum(one.value for one in lines), min(one.enabled for one in lines))


def _printed(path: Path, text: str) -> Iterator[_Printed]:
    """Lines that say something of an event; comments, warnings and metrics of perf's own are passed over."""
    lines = text.splitlines()
    data = [line for line in lines if _is_data(line)]
    separator = max(";,|", key=lambda sign: sum(line.count(sign) for line in data))
    for number, line in enumerate(lines, 1):
        where = f"{path}:{number}"
        if line.lstrip().startswith("{"):
            for said in _objects(where, line):
                if said.get("event"):
                    yield _of_json(where, said)
        elif _is_data(line):
            one = _of_fields(where, _split(line, separator), line)
            if one.event:  # without: a metric that perf works out
                yield one


def _is_data(line: str) -> bool:
    """Begins with a number (a time or a value), with no value, or with a place and a number."""
    return _DATA.match(line) is not None


def _split(line: str, separator: str) -> list[str]:
    """Fields; a separator inside an event's slashes (cpu/event=0xc7,umask=1/) is none."""
    fields: list[str] = []
    for text in line.split(separator):
        if fields and re.match(r"\w+/[^/]*$", fields[-1]):
            fields[-1] += separator + text
        else:
            fields.append(text)
    return fields


def _of_fields(where: str, fields: list[str], line: str) -> _Printed:
    time = place = ""
    rest = list(fields)
    if rest and _TIME.fullmatch(rest[0]):
        time = rest.pop(0).strip()
    if rest and not _NUMBER.fullmatch(rest[0].strip()) and (match := _PLACE.fullmatch(rest[0].strip())):
        place = rest.pop(0).strip()
        if match[1] and rest:
            rest.pop(0)  # how many CPUs are in it
    if len(rest) > 3 and re.fullmatch(r"\d+[.,]\d+%", rest[3]):
        rest.pop(3)  # spread over repetitions (-r)
    if len(rest) < 5 or not (
        rest[0] == "" or rest[0].startswith("<not ") or _NUMBER.fullmatch(rest[0].strip())
    ):
        raise StudyError(f"{where}: not a line of perf stat -x ';': {line.strip()[:60]!r}")
    if rest[2] and rest[4].isdigit() and not rest[0].startswith("<"):  # perf writes two decimals
        raise StudyError(f"{where}: decimal commas between commas; run perf with LC_ALL=C or -x ';'")
    return _Printed(where, (time, place), rest[2], rest[0].strip(), rest[3], rest[4])


def _objects(where: str, line: str) -> Iterator[dict[str, Any]]:
    """JSON objects of a line, which may be several; numbers may have a decimal comma."""
    decoder, rest = json.JSONDecoder(), re.sub(r"(:\s*-?\d+),(\d)", r"\1.\2", line).strip().rstrip(",")
    while rest:
        try:
            found, end = decoder.raw_decode(rest)
        except (ValueError, RecursionError):
            found, end = None, 0
        if not isinstance(found, dict):
            raise StudyError(f"{where}: not a JSON object of perf stat -j: {line.strip()[:60]!r}")
        yield found
        rest = rest[end:].lstrip(" ,")


def _of_json(where: str, said: dict[str, Any]) -> _Printed:
    place = next((str(said[key]) for key in _PLACES if key in said), "")
    value, running, share = (
        str(said.get(key, "")) for key in ("counter-value", "event-runtime", "pcnt-running")
    )
    return _Printed(where, (str(said.get("interval", "")), place), str(said["event"]), value, running, share)


def _line(printed: list[_Printed]) -> Line:
    """Of one event: as it stands; the longer counted of what stands twice; the kind of core that ran."""
    first = printed[0]
    if all(one.value == UNSUPPORTED for one in printed):
        raise StudyError(
            f"{first.where}: {first.event} is not supported by this kernel or machine", CANNOT_RUN
        )
    counted = [_counted(one) for one in printed if one.value not in (UNSUPPORTED, UNCOUNTED)]
    if not counted:
        raise StudyError(
            f"{first.where}: {first.event} was not counted: no counter was free, or another kind of core"
        )
    ran = {one.event: one for one in counted if one.enabled > 0 and _KINDS.fullmatch(one.event)}
    if len(ran) > 1:
        shares = " and ".join(f"{name} {one.enabled:.0f} %" for name, one in ran.items())
        raise StudyError(f"{first.where}: ran on two kinds of core ({shares}): pin it to one, as by taskset")
    return max(counted, key=lambda one: one.enabled)


def _counted(one: _Printed) -> Line:
    try:
        value, nanoseconds, enabled = (
            float(text.replace(",", ".")) for text in (one.value, one.running, one.share)
        )
    except ValueError:
        said = ";".join((one.value, one.event, one.running, one.share))
        raise StudyError(f"{one.where}: not a value, a time and a share: {said[:60]!r}") from None
    if not 0 <= enabled <= 100 or not (math.isfinite(value) and nanoseconds >= 0):
        raise StudyError(f"{one.where}: {one.event}: counted {enabled} % of the time")
    # The kernel's counters have 64 bits; what runs over in 48 shows as a value out of all proportion.
    seconds = nanoseconds / 1e9 * 100 / enabled if enabled else 0
    if value < 0 or value > _FASTEST * max(seconds, 1e-3):
        raise StudyError(
            f"{one.where}: {one.event}: {one.value} in {seconds:.3g} s cannot be; the counter has overflowed"
        )
    return Line(one.event, value, enabled)
