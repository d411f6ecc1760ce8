"""phases/NAME/costs.def as Python reads it: the format is at the head of common/flops.h."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from study.cli import StudyError

CLASSES = ("add", "mul", "fma", "div", "sqrt", "rsqrt", "minmax", "compare", "call")
_LINE = re.compile(r"COST(?:_MATH)?\(\s*(\w+),\s*(\w+),\s*(\w+),((?:\s*\d+\s*,?){9})\)")


@dataclass(frozen=True)
class Cost:
    """One line: operations per lane by class. `width` is LANES or 1."""

    function: str
    part: str
    width: str
    per_lane: dict[str, int]


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
        match = _LINE.match(line.strip())
        if not match:
            raise StudyError(f"{path}:{number}: COST(function, part, width, nine numbers) is required")
        values = (int(n) for n in match[4].split(","))
        found.append(Cost(match[1], match[2], match[3], dict(zip(CLASSES, values, strict=True))))
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
