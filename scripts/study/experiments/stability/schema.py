"""stability.json."""

from typing import Annotated, ClassVar, Literal

from study.core.schema import Record, key
from study.numbers.schema import Result, Skipped


class Phase(Record, kw_only=True):
    """A program that was tried."""

    name: Annotated[str, key("", "its name")]
    precision: Annotated[str, key("", "float or double")]
    sha256: Annotated[str | None, key("", "of the program")] = None


class Case(Record, kw_only=True, frozen=True):
    """A hard case: its texts, and strengths from easy to hard."""

    number: Annotated[int, key("", "of its file")]
    name: Annotated[str, key("", "of its file", pattern=r"^\w+$")]
    title: Annotated[str, key("", "in words", min_length=1)]
    what: Annotated[str, key("", "what it is", min_length=1)]
    why: Annotated[str, key("", "why it is hard", min_length=1)]
    source: Annotated[str, key("", "who described it", min_length=1)]
    known: Annotated[str, key("", "what the answer is known from", min_length=1)]
    strength: Annotated[str, key("", "what makes it harder, with its unit", min_length=1)]
    strengths: Annotated[
        tuple[float, ...], key("as `strength` says", "tried, from easy to hard", min_length=1)
    ]
    metric: Annotated[str, key("", "what the error is of", min_length=1)]
    unit: Annotated[str, key("", "of the error")] = ""
    fails_above: Annotated[float, key("`unit`", "a larger error fails", ge=0)]
    limit: Annotated[str, key("", "why that one", min_length=1)]
    own: Annotated[bool, key("", "whether the case is of this project")]


class Row(Record, kw_only=True):
    """A case on a phase, an entry per strength in each list."""

    case: Annotated[str, key("", "its name")] = ""
    number: Annotated[int, key("", "of the case")]
    phase: Annotated[str, key("", "its name")]
    strengths: Annotated[tuple[float, ...], key("as the case says", "tried")]
    errors: Annotated[list[float | None], key("unit of the case", "null: no usable answer")]
    states: Annotated[
        list[str], key("", "right, wrong, not finite, refused, crashed, hung; broken: the case's fault")
    ]
    notes: Annotated[list[str], key("", "in words")]
    first_failure: Annotated[float | None, key("as the case says", "first that is neither right nor refused")]
    non_finite: Annotated[int | None, key("samples", "over all pictures")] = None
    hung: Annotated[bool | None, key("", "at a strength")] = None
    crashed: Annotated[bool | None, key("", "at a strength")] = None
    refused: Annotated[bool, key("", "at every strength")]
    unit: Annotated[str, key("", "of the error")] = ""
    limit: Annotated[float | None, key("`unit`", "a larger error fails")] = None

    @property
    def place(self) -> int:
        """Number of the first strength that fails; that of all strengths where none does."""
        return len(self.strengths) if self.first_failure is None else self.strengths.index(self.first_failure)


class Stability(Result, kw_only=True):
    """Hard cases with a known answer, per phase. Every phase has a result of every case."""

    made_by: ClassVar[str] = "stability"
    schema: Annotated[Literal[1], key("", "version of the form")] = 1
    phases: Annotated[list[Phase], key("", "programs")]
    cases: Annotated[list[Case], key("", "what was tried")]
    results: Annotated[list[Row], key("", "cases on phases", min_length=1)]
    skipped: Annotated[list[Skipped], key("", "phases that could not run")] = []

    def rows_of(self, case: Case) -> list[Row]:
        return [row for row in self.results if row.number == case.number]


FILE = "stability.json"
SCHEMAS = {FILE: Stability}
