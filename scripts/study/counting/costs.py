"""phases/NAME/costs.def as Python reads it (its format: common/counting/flops.h), and residues.def.

A line of residues.def, RESIDUE(build, function, part, kind, least, most) // why, says where a compiler's code
does otherwise than costs.def: so many operations more per lane and execution of the part. No count has it in.
Of kind `call`: so many of the declared calls of math.h fewer go to libm, since they are an instruction.
RESIDUES_OF(opt4) // confirmed how: the lines of opt4 hold here too, of parts that the phase has.

A derived phase without a residues.def of its own has its ancestor's. That was read in other code: it explains
nothing until the phase has a file of its own. An empty one says that no residue is known.
"""

from __future__ import annotations

import re
from collections.abc import Container, Iterable
from dataclasses import dataclass
from pathlib import Path

from study.core import registry
from study.core.cli import StudyError

CLASSES = ("add", "mul", "fma", "div", "sqrt", "rsqrt", "minmax", "compare", "call")
_LINE = re.compile(r"COST(_MATH)?\(\s*(\w+),\s*(\w+),\s*(LANES|1),((?:\s*\d+\s*,){8}\s*\d+\s*)\)\s*(//.*)?")
_RESIDUE = re.compile(
    rf"RESIDUE\(\s*(shipped|calls|both),\s*(\w+),\s*(\w+),\s*({'|'.join((*CLASSES[:7], 'call'))}),"
    r"\s*(-?\d+),\s*(-?\d+)\s*\)\s*(//.*)?"
)
_SAME = re.compile(r"RESIDUES_OF\(\s*(\w+)\s*\)\s*//.+")


@dataclass(frozen=True)
class Cost:
    """One line: operations per lane by class. `width` is LANES or 1; `stands_for_call`: COST_MATH."""

    function: str
    part: str
    width: str
    per_lane: dict[str, int]
    stands_for_call: bool = False


def read(path: Path) -> list[Cost]:
    """The declared costs. Raises StudyError with file and line for one that is no COST line."""
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except OSError as error:
        raise StudyError(f"{path}: {error.strerror}") from None
    found = []
    for number, line in enumerate(lines, 1):
        if not line.strip() or line.lstrip().startswith("//"):
            continue
        match = _LINE.fullmatch(line.strip())
        if not match:
            text = "COST(function, part, LANES or 1, nine numbers with commas between) is required"
            raise StudyError(f"{path}:{number}: {text}")
        values = (int(n) for n in match[5].split(","))
        found.append(Cost(*match.group(2, 3, 4), dict(zip(CLASSES, values, strict=True)), bool(match[1])))
    return found


@dataclass(frozen=True)
class Residue:
    """What a compiler adds to a part in a build (shipped, calls or both), at least and at most. `kind`: of
    CLASSES, comparisons apart.
    """

    build: str
    function: str
    part: str
    kind: str
    least: int
    most: int


def residues_of(phase: registry.Phase, lines: Iterable[Cost]) -> list[Residue]:
    """Of the phase's residues.def. Of an ancestor's, what is about parts that the phase has too."""
    if ancestor := phase.inherits("residues.def"):
        return _of_ancestor(ancestor, {(cost.function, cost.part) for cost in lines})
    return residues(phase.file("residues.def"), lines)


def _of_ancestor(name: str, known: Container[tuple[str, str]]) -> list[Residue]:
    """The phase's residues of the known parts."""
    ancestor = registry.find_phase(name)
    every = residues(ancestor.file("residues.def"), read(ancestor.file("costs.def")))
    return [one for one in every if (one.function, one.part) in known]


def residues(path: Path, costs: Iterable[Cost]) -> list[Residue]:
    """The explained residues of a phase; none without the file. Raises StudyError with file and line."""
    if not path.exists():
        return []
    costs = list(costs)
    known = {(cost.function, cost.part) for cost in costs}
    found: list[Residue] = []
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
        if not line.strip() or line.lstrip().startswith("//"):
            continue
        if same := _SAME.fullmatch(line.strip()):
            found += _of_ancestor(same[1], known)
            continue
        match = _RESIDUE.fullmatch(line.strip())
        if not match or int(match[5]) > int(match[6]):
            text = "RESIDUE(shipped|calls|both, function, part, kind, least, most) is required"
            raise StudyError(f"{path}:{number}: {text}")
        if (match[2], match[3]) not in known:
            raise StudyError(f"{path}:{number}: costs.def has no line {match[2]}, {match[3]}")
        found.append(Residue(*match.groups()[:4], int(match[5]), int(match[6])))
    return found


def calls_of(
    costs: Iterable[Cost], by_function: dict[str, dict], functions: Iterable[str] | None = None
) -> int:
    """math.h calls (the class `call`) of a scalar phase's picture: parts counted times declared. `functions`:
    of these alone.
    """
    wanted = None if functions is None else set(functions)
    return sum(
        cost.per_lane["call"] * by_function.get(cost.function, {}).get("parts", {}).get(cost.part, 0)
        for cost in costs
        if wanted is None or cost.function in wanted
    )
