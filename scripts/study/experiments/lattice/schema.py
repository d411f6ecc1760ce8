"""lattice.json."""

from __future__ import annotations

from typing import Annotated, ClassVar

from study.core.schema import Record, key
from study.measuring.schema import HitErrors
from study.numbers.schema import Measured


class Row(HitErrors, kw_only=True):
    """One phase, size and number of threads. Errors are of pictures of `error_size`."""

    phase: Annotated[str, key("", "its name")]
    width: Annotated[int, key("pixels", "of the picture", ge=1)]
    n: Annotated[int, key("pixels", "its height", ge=1)]
    threads: Annotated[int, key("threads", "that drew it", ge=1)]
    ms: Annotated[float | None, key("ms", "median over launches")]
    ms_low: Annotated[float | None, key("ms", "lower end")] = None
    ms_high: Annotated[float | None, key("ms", "upper end")] = None
    ns: Annotated[list[float] | None, key("ns", "one per launch: median of its frames")] = None
    program_ms: Annotated[float | None, key("ms", "CPU-RTRM's; null: another size or number of threads")]
    program: Annotated[float | None, key("×", "that over `ms`; another machine's figure")] = None
    program_low: Annotated[float | None, key("×", "lower end")] = None
    program_high: Annotated[float | None, key("×", "upper end")] = None


class Program(Record, kw_only=True):
    """CPU-RTRM's own program with its own shading, as others measured it."""

    size: Annotated[list[int], key("pixels", "width and height")]
    ms: Annotated[dict[str, float], key("ms", "of a frame, by threads")]
    machine: Annotated[str, key("", "where it was measured")]


class Lattice(Measured, kw_only=True):
    """CPU-RTRM's scene by every phase, beside that program's figures."""

    made_by: ClassVar[str] = "lattice"
    threads: Annotated[list[int] | None, key("threads", "tried")] = None
    program: Annotated[Program, key("", "CPU-RTRM")]
    paper: Annotated[float, key("×", "what the paper says of its last step")]
    error_size: Annotated[list[int], key("pixels", "of the pictures that errors are of")]
    rows: Annotated[list[Row], key("", "phases, sizes, threads")]

    def best(self, threads: int) -> Row | None:
        """The fastest at the size of CPU-RTRM's figure on so many threads."""
        mine = [row for row in self.rows if row.threads == threads and row.program_ms is not None and row.ms]
        return min(mine, key=lambda row: row.ms or 0, default=None)


FILE, SCENE = "lattice.json", "lattice"
SCHEMAS = {FILE: Lattice}
