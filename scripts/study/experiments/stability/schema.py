"""stability.json."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from study.core.schema import ABSENT, Absent, Record, key
from study.numbers.schema import Result


class Phase(Record, kw_only=True):
    """A program that was tried."""

    name: Annotated[str, key("", "its name")]
    precision: Annotated[str, key("", "float or double")]
    sha256: Annotated[str | Absent, key("", "of the program")] = ABSENT


class Case(Record, kw_only=True):
    """A hard case: its texts, and strengths from easy to hard."""

    number: Annotated[int, key("", "of its file")]
    name: Annotated[str, key("", "of its file", pattern=r"^\w+$")]
    title: Annotated[str, key("", "in words")]
    what: Annotated[str, key("", "what it is")]
    why: Annotated[str, key("", "why it is hard")]
    source: Annotated[str, key("", "who described it")]
    known: Annotated[str, key("", "what the answer is known from")]
    strength: Annotated[str, key("", "what makes it harder, with its unit")]
    strengths: Annotated[list[float], key("as `strength` says", "tried, from easy to hard")]
    metric: Annotated[str, key("", "what the error is of")]
    unit: Annotated[str, key("", "of the error")]
    fails_above: Annotated[float, key("`unit`", "a larger error fails")]
    limit: Annotated[str, key("", "why that one")]
    own: Annotated[bool, key("", "whether the case is of this project")]


class Outcome(Record, kw_only=True):
    """A case on a phase, an entry per strength in each list."""

    case: Annotated[str | Absent, key("", "its name")] = ABSENT
    number: Annotated[int, key("", "of the case")]
    phase: Annotated[str, key("", "its name")]
    strengths: Annotated[list[float], key("as the case says", "tried")]
    errors: Annotated[list[float | None], key("unit of the case", "null: no usable answer")]
    states: Annotated[
        list[str], key("", "right, wrong, not finite, refused, crashed, hung; broken: the case's fault")
    ]
    notes: Annotated[list[str], key("", "in words")]
    first_failure: Annotated[float | None, key("as the case says", "first that is neither right nor refused")]
    non_finite: Annotated[int | Absent, key("samples", "over all pictures")] = ABSENT
    hung: Annotated[bool | Absent, key("", "at a strength")] = ABSENT
    crashed: Annotated[bool | Absent, key("", "at a strength")] = ABSENT
    refused: Annotated[bool, key("", "at every strength")]
    unit: Annotated[str | Absent, key("", "of the error")] = ABSENT
    limit: Annotated[float | Absent, key("`unit`", "a larger error fails")] = ABSENT


class Skipped(Record, kw_only=True):
    """A phase that could not run."""

    phase: Annotated[str | Absent, key("", "its name")] = ABSENT
    reason: Annotated[str | Absent, key("", "why")] = ABSENT


class Stability(Result, kw_only=True):
    """Hard cases with a known answer, per phase. Every phase has an outcome of every case."""

    made_by: ClassVar[str] = "stability"
    schema: Annotated[Literal[1], key("", "version of the form")]
    phases: Annotated[list[Phase], key("", "programs")]
    cases: Annotated[list[Case], key("", "what was tried")]
    results: Annotated[list[Outcome], key("", "cases on phases", min_length=1)]
    skipped: Annotated[list[Skipped] | Absent, key("", "phases that could not run")] = ABSENT

    def __post_init__(self) -> None:
        strengths = {case.number: case.strengths for case in self.cases}
        wanted = sorted((number, phase.name) for number in strengths for phase in self.phases)
        if sorted((one.number, one.phase) for one in self.results) != wanted:
            raise ValueError("not every phase has one result of every case")
        for one in self.results:
            lists = (one.errors, one.states, one.notes)
            if one.strengths != strengths[one.number] or {len(each) for each in lists} != {
                len(one.strengths)
            }:
                raise ValueError(f"case {one.number} of {one.phase}: not one entry per strength of the case")


SCHEMAS = {"stability.json": Stability}
