"""Hard cases: generated scenes whose answer is known, each with one parameter that makes it harder.

A case is a module cNN_name.py of shapes/, rays/ or light/ that defines CASE. It is found by its file.
Numbers 1 to 22 are those of the study's specification; from 23 on they are this project's own.

    from study.hard import Case, Outcome, Phase
    from study.hard.scenes import rays, scene, shape

    def run(phase: Phase, strength: float) -> Outcome:
        picture = phase.render(scene([shape("sphere", radius=1)]), (1, 1))
        return Outcome(abs(float(picture["Z"][0, 0]) - 4.0))

    CASE = Case(number=2, name="silhouette", ..., run=run)

`run` says how wrong the phase is, as a number; NaN, a crash and a hang are seen without its help (phase.py).
"""

from __future__ import annotations

import functools
import importlib
import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from study.core.cli import StudyError
from study.experiments.stability.cases.phase import Crashed, Hung, Phase, Refused

__all__ = ["Case", "Crashed", "Hung", "Outcome", "Phase", "Refused", "cases", "find_cases"]

MODULE = re.compile(r"c(\d\d)_([a-z0-9_]+)")
OWN = 23  # the first number of this project's own cases


@dataclass(frozen=True)
class Outcome:
    """What a phase did at one strength. `error` in the case's unit, NaN or inf: no usable answer at all.

    `non_finite`: samples that are NaN or infinite where none may be, beyond those of the pictures that
    Phase.render read, which are counted there.
    """

    error: float
    non_finite: int = 0
    note: str = ""


@dataclass(frozen=True)
class Case:
    """One hard case. Texts are Markdown without headings; they become the case's page."""

    number: int
    name: str  # grazing_plane
    title: str  # Plane at a grazing angle
    what: str  # what it is: the construction, in a few sentences
    why: str  # why it is hard
    source: str  # who first described it, with year and where
    known: str  # from what the answer is known
    strength: str  # what the parameter is, and its unit: θ, degrees
    strengths: tuple[float, ...]  # from easy to hard
    metric: str  # max |Δt|
    unit: str  # of the metric; "" for a pure number
    fails_above: float  # a larger error (or NaN, a crash, a hang) is a failure
    limit: str  # why that limit
    run: Callable[[Phase, float], Outcome]

    def __post_init__(self) -> None:
        texts = ("name", "title", "what", "why", "source", "known", "strength", "metric", "limit")
        if empty := [name for name in texts if not getattr(self, name).strip()]:
            raise StudyError(f"case {self.number} {self.name}: {empty[0]} is empty; every text is required")
        if not self.strengths or len(set(self.strengths)) != len(self.strengths):
            raise StudyError(f"case {self.number} {self.name}: strengths must be given, each once")
        if not (self.fails_above >= 0 and math.isfinite(self.fails_above)):
            raise StudyError(f"case {self.number} {self.name}: fails_above must be a number of at least 0")

    @property
    def own(self) -> bool:
        """Whether the case is this project's own."""
        return self.number >= OWN

    def few(self) -> tuple[float, ...]:
        """The easiest, the middle and the hardest strength: what the tests run."""
        last = len(self.strengths) - 1
        return tuple(self.strengths[i] for i in sorted({0, (last + 1) // 2, last}))

    def failed(self, error: float) -> bool:
        """NaN never passes."""
        return not (error <= self.fails_above)


@functools.cache
def cases() -> tuple[Case, ...]:
    """All cases, by number. StudyError for a module whose CASE does not bear the file's number and name."""
    found = []
    for path in sorted(Path(__file__).parent.glob("*/c[0-9][0-9]_*.py")):
        match = MODULE.fullmatch(path.stem)
        case = getattr(importlib.import_module(f"{__name__}.{path.parent.name}.{path.stem}"), "CASE", None)
        if not match or not isinstance(case, Case) or (case.number, case.name) != (int(match[1]), match[2]):
            raise StudyError(f"{path}: must define CASE, a Case of the number and name in the file's name")
        found.append(case)
    if twice := {case.number for case in found if sum(c.number == case.number for c in found) > 1}:
        raise StudyError(f"hard cases: number {min(twice)} is given twice")
    return tuple(sorted(found, key=lambda case: case.number))


def find_cases(names: list[str] | None) -> list[Case]:
    """The cases of those names or numbers (7, c07, camera_shift), all of them for None."""
    if not names:
        return list(cases())
    known = {key: c for c in cases() for key in (c.name, str(c.number), f"c{c.number:02}")}
    known |= {f"c{c.number:02}_{c.name}": c for c in cases()}
    if unknown := [name for name in names if name not in known]:
        there = ", ".join(f"{c.number} {c.name}" for c in cases())
        raise StudyError(f"no hard case '{unknown[0]}'; there are {there}")
    return list(dict.fromkeys(known[name] for name in names))
