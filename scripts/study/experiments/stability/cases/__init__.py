"""Hard cases: generated scenes whose answer is known, each with one parameter that makes it harder.

A case is a function cNN_name of a module of this folder, and the table of that name in cases.toml: texts,
strengths and limit. Numbers 1 to 22 are those of the study's specification; from 23 on they are this
project's own. The function says how wrong the phase is, as a number:

    def c99_ball(phase: Phase, strength: float) -> Outcome:
        return Outcome(abs(one_ray(phase, scene([ball(strength)])).t - (5 - strength)))

NaN, a crash and a hang are seen without its help (phase.py).
"""

import functools
import importlib
import re
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import msgspec

from study.core.cli import StudyError
from study.experiments.stability import schema
from study.experiments.stability.cases.phase import Crashed, Hung, Phase, Refused

__all__ = ["Case", "Crashed", "Hung", "Outcome", "Phase", "Refused", "cases", "find_cases"]

FOLDER = Path(__file__).parent
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
    """One hard case: what it is, and how to run it."""

    about: schema.Case
    run: Callable[[Phase, float], Outcome]

    @property
    def name(self) -> str:
        return self.about.name

    @property
    def number(self) -> int:
        return self.about.number

    @property
    def strengths(self) -> tuple[float, ...]:
        return self.about.strengths

    def few(self) -> tuple[float, ...]:
        """The easiest, the middle and the hardest strength: what the tests run."""
        last = len(self.strengths) - 1
        return tuple(self.strengths[i] for i in sorted({0, (last + 1) // 2, last}))

    def failed(self, error: float) -> bool:
        """NaN never passes."""
        return not (error <= self.about.fails_above)


@functools.cache
def cases() -> tuple[Case, ...]:
    """All cases, by number. Raises StudyError for a case whose table in cases.toml lacks something."""
    texts = tomllib.loads((FOLDER / "cases.toml").read_text(encoding="utf-8"))
    functions: dict = {}
    for path in sorted(FOLDER.glob("[!_]*.py")):
        module = vars(importlib.import_module(f"{__name__}.{path.stem}"))
        functions |= {name: one for name, one in module.items() if re.fullmatch(r"c\d\d_\w+", name)}
    found = []
    for name, run in sorted(functions.items()):
        table = {key: " ".join(v.split()) if isinstance(v, str) else v for key, v in texts[name].items()}
        number = int(name[1:3])
        known = {"number": number, "name": name[4:], "own": number >= OWN}
        try:
            found.append(Case(msgspec.convert(table | known, schema.Case), run))
        except msgspec.ValidationError as error:
            raise StudyError(f"cases.toml: {name}: {error}") from None
    return tuple(found)


def find_cases(names: list[str] | None) -> list[Case]:
    """The cases of those names or numbers (7, c07, camera_shift), all of them for None."""
    known = {key: c for c in cases() for key in (c.name, str(c.number), f"c{c.number:02}")}
    if unknown := [name for name in names or () if name not in known]:
        there = ", ".join(f"{c.number} {c.name}" for c in cases())
        raise StudyError(f"no hard case '{unknown[0]}'; there are {there}")
    return list(dict.fromkeys(known[name] for name in names)) if names else list(cases())
