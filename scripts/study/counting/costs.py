"""phases/NAME/costs.def as Python reads it (its format: common/counting/flops.h), and residues.def.

A line of residues.def, RESIDUE(build, function, part, kind, least, most) // why, says where a compiler's code
does otherwise than costs.def: so many operations more per lane and execution of the part. No count has it in.
A derived phase without a residues.def has its ancestor's.
"""

import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from study.core import registry
from study.core.cli import StudyError

CLASSES = ("add", "mul", "fma", "div", "sqrt", "rsqrt", "minmax", "compare", "call")
_LINE = re.compile(r"COST(_MATH)?\(\s*(\w+),\s*(\w+),\s*(LANES|1),((?:\s*\d+\s*,){8}\s*\d+\s*)\)\s*(//.*)?")
_RESIDUE = re.compile(
    rf"RESIDUE\(\s*(shipped|calls|both),\s*(\w+),\s*(\w+),\s*({'|'.join(CLASSES[:7])}),"
    r"\s*(-?\d+),\s*(-?\d+)\s*\)\s*(//.*)?"
)
T = TypeVar("T")


@dataclass(frozen=True)
class Cost:
    """One line: operations per lane by class. `width` is LANES or 1; `stands_for_call`: COST_MATH."""

    function: str
    part: str
    width: str
    per_lane: dict[str, int]
    stands_for_call: bool = False


@dataclass(frozen=True)
class Residue:
    """What a compiler adds to a part in a build (shipped, calls or both), at least and at most. `kind`: of
    CLASSES that are FLOPs.
    """

    build: str
    function: str
    part: str
    kind: str
    least: int
    most: int


def _lines(path: Path, made: Callable[[str], T | None], form: str) -> Iterator[T]:
    """`made` of each line that is no comment. StudyError with file and line for one that it refuses."""
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except OSError as error:
        raise StudyError(f"{path}: {error.strerror}") from None
    for number, line in enumerate(map(str.strip, lines), 1):
        if line and not line.startswith("//"):
            if (one := made(line)) is None:
                raise StudyError(f"{path}:{number}: {form} is required")
            yield one


def _cost(line: str) -> Cost | None:
    if not (match := _LINE.fullmatch(line)):
        return None
    values = map(int, match[5].split(","))
    return Cost(*match.group(2, 3, 4), dict(zip(CLASSES, values, strict=True)), bool(match[1]))


def _residue(line: str) -> Residue | None:
    match = _RESIDUE.fullmatch(line)
    if not match or int(match[5]) > int(match[6]):
        return None
    return Residue(*match.group(1, 2, 3, 4), int(match[5]), int(match[6]))


def read(path: Path) -> list[Cost]:
    """The declared costs. Raises StudyError with file and line for one that is no COST line."""
    return list(_lines(path, _cost, "COST(function, part, LANES or 1, nine numbers with commas between)"))


def declares(phase: str) -> bool:
    """Whether the phase declares what its functions cost: a costs.def of zeros names steps alone."""
    path = registry.find_phase(phase).file("costs.def")
    return path.is_file() and any(any(cost.per_lane.values()) for cost in read(path))


def of_phase(name: str) -> list[Cost]:
    return read(registry.find_phase(name).file("costs.def"))


def residues_of(name: str, costs: Iterable[Cost]) -> list[Residue]:
    """The phase's residues; from an ancestor's file, those of parts that the phase has too."""
    path = registry.find_phase(name).file("residues.def")
    if not path.exists():
        return []
    form = "RESIDUE(shipped|calls|both, function, part, kind, least, most)"
    found, known = list(_lines(path, _residue, form)), {(cost.function, cost.part) for cost in costs}
    unknown = [one for one in found if (one.function, one.part) not in known]
    if unknown and path.parent == registry.find_phase(name).path:
        raise StudyError(f"{path}: costs.def has no line {unknown[0].function}, {unknown[0].part}")
    return [one for one in found if (one.function, one.part) in known]
