"""What a run's files say of themselves: machine, commit and time of each, and what disturbed them.

A file may be of another commit or hour than the run's context.json: a part measured anew and put into it.
"""

import datetime
import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from study.core import machine, show, store
from study.core.cli import StudyError
from study.core.host import checkout
from study.core.run_schema import Context

SPREADS = ("launches", "ns")  # keys of a row that hold a time per process launch
CONTEXT = "context.json"  # is its own context


def contexts(path: Path, names: Iterable[str] | None = None) -> dict[str, Context]:
    """Where each JSON file at the top of a run (of those named) was made, if it says so: name without
    suffix → context, in order of time. Raises StudyError for a broken file."""
    files = sorted(path.glob("*.json")) if names is None else [path / name for name in names]
    found = {}
    for file in files:
        content = store.read_json(file) if file.exists() else None
        if not isinstance(content, Mapping):
            continue
        context = content if file.name == CONTEXT else content.get("context")
        if isinstance(context, Mapping):
            found[file.stem] = Context.of(context, str(file))
    return dict(sorted(found.items(), key=lambda item: item[1].time or ""))


def commit(context: Context) -> str:
    """The first ten digits, and whether sources were changed."""
    return checkout.said(context.git)


def place(context: Context) -> str:
    return f"{machine.name(context)}; {context.compiler or 'unknown compiler'}"


def line(found: Mapping[str, Context]) -> str:
    """CPU and compiler, then each commit, once for all files that share them, with the time of each file."""
    alike: dict[str, dict[str, list[str]]] = {}
    for name, context in found.items():
        by_commit = alike.setdefault(place(context), {})
        by_commit.setdefault(commit(context), []).append(
            f"{name} {(context.time or 'at an unknown time')[:16]}"
        )
    return "; and on ".join(
        "; ".join([where, *(f"{of} ({', '.join(files)})" for of, files in by_commit.items())])
        for where, by_commit in alike.items()
    )


def commits(path: Path) -> dict[str, list[str]]:
    """Commit → the files of a run that were measured of it."""
    found: dict[str, list[str]] = {}
    for name, context in contexts(path).items():
        found.setdefault(commit(context), []).append(name)
    return found


def need_clean(path: Path, allowed: bool) -> None:
    """Raises StudyError if a file of a run is of changed or unknown sources and that is not `allowed`."""
    unclean = {
        commit(one): one.git.unknown for one in contexts(path).values() if not checkout.is_clean(one.git)
    }
    if unclean and not allowed:
        said = "; ".join(f"{what} ({why})" if why else what for what, why in unclean.items())
        raise StudyError(f"{path}: measured of {said}; --unclean takes it all the same")


def _launches(content: Any) -> Iterator[Sequence[float]]:
    values = content.items() if isinstance(content, Mapping) else [("", one) for one in content]
    for key, value in values:
        if key in SPREADS and isinstance(value, list):
            if len(value) > 1 and all(isinstance(one, int | float) and one > 0 for one in value):
                yield value
        elif isinstance(value, Mapping | list):
            yield from _launches(value)


def spread(content: Any) -> tuple[float, float] | None:
    """Median launch over the least launch: the median of all rows with launches, and the greatest."""
    ratios = [float(np.median(times)) / min(times) for times in _launches(content)]
    return (float(np.median(ratios)), max(ratios)) if ratios else None


def stolen(found: Mapping[str, Context]) -> float | None:
    """Share of all CPUs' time that the hypervisor took between the first and the last file's begin, of those
    that the same boot of the same machine made. None: not known."""
    time, ticks, seconds = datetime.datetime.fromisoformat, 0, 0.0
    for one, other in itertools.pairwise(found.values()):
        before, after, cpus = one.steal_ticks, other.steal_ticks, one.cpu.usable_cpus
        if before is None or after is None or after < before or not cpus or place(one) != place(other):
            continue
        if one.time and other.time:
            ticks += after - before
            seconds += cpus * (time(other.time) - time(one.time)).total_seconds()
    return ticks / 100 / seconds if seconds > 0 else None


def disturbed(path: Path, names: Sequence[str]) -> str:
    """What these files know of how quiet the machine was, in sentences. Raises StudyError."""
    contents = {name: store.read_json(path / name) for name in names if (path / name).exists()}
    spreads = {name: found for name, content in contents.items() if (found := spread(content))}
    said = [
        f"{Path(name).stem} {show.number(middle)} (at most {show.number(most)})"
        for name, (middle, most) in spreads.items()
    ]
    text = []
    if said:
        text.append(
            "How quiet the machine was: a row's median launch over its least (1: nothing disturbed it), in "
            f"the median row and at most: {', '.join(said)}."
        )
    if (steal := stolen(contexts(path, names))) is not None:
        text.append(
            f"From the first of these files' start to the last's the hypervisor took {100 * steal:.1f} % of "
            "the CPUs' time (steal; what a neighbour takes of a shared core is not in it)."
        )
    if any(isinstance(one, Mapping) and one.get("animation") for one in contents.values()):
        text.append(
            "Rows of one process have no interval and are not interleaved: what disturbed one is in it."
        )
    return " ".join(text)
