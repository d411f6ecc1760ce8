"""functions.json."""

import math
from typing import Annotated, ClassVar

from study.core.schema import Record, key
from study.measuring.function_bench import Article, Normalise
from study.numbers.schema import Measured, Range


class Edge(Record, kw_only=True):
    """A value at the edge of a function's range."""

    argument: Annotated[str, key("", "in words")]
    value: Annotated[str, key("", "given")]
    exact: Annotated[str, key("", "wanted")]
    right: Annotated[bool, key("", "whether they agree")]


class Entry(Record, kw_only=True):
    """One function, precision, implementation and instruction set."""

    id: Annotated[int, key("", "number in the program")] = 0
    function: Annotated[str, key("", "rsqrt, exp, sin …")]
    family: Annotated[str, key("", "how it is made: libm, instruction, polynomial …")]
    name: Annotated[str, key("", "of the implementation")]
    isa: Annotated[str, key("", "instruction set")]
    bits: Annotated[int, key("bits", "of the register")]
    precision: Annotated[str, key("", "float or double")]
    arguments: Annotated[int, key("", "1 or 2")] = 1
    missing: Annotated[str | None, key("", "why it did not run; else null")] = None
    count: Annotated[int, key("", "arguments tried")] = 0
    non_finite: Annotated[int, key("results", "not finite within its range")] = 0
    max_ulp: Annotated[float | None, key("ulp", "largest error; of samples a lower bound")] = None
    rms_ulp: Annotated[float | None, key("ulp of the exact value", "root mean square error")] = None
    worst_a: Annotated[float | None, key("", "argument of the largest error")] = None
    worst_b: Annotated[float | None, key("", "the second argument there")] = None
    edges: Annotated[list[Edge], key("", "values at the edges")] = []
    stream_ns: Annotated[Range | None, key("ns", "per element, independent ones; median over rounds")] = None
    stream_cycles: Annotated[Range | None, key("core cycles", "the same")] = None
    latency_ns: Annotated[Range | None, key("ns", "per call in a chain, less the chain's own")] = None
    latency_cycles: Annotated[Range | None, key("core cycles", "the same")] = None
    front: Annotated[bool, key("", "whether none is faster at a smaller error (throughput)")] = False

    @property
    def kind(self) -> tuple[str, str]:
        return self.function, self.precision

    def ns(self, time: str) -> float:
        """The value of `stream_ns` or `latency_ns`; NaN where there is none. A latency that the noise of the
        chain's own cost leaves at nothing is none."""
        found = getattr(self, time)
        return found.value if found and found.value and found.value > 0 else math.nan

    @property
    def ulp(self) -> float:
        """Largest error; NaN where none was measured."""
        return math.nan if self.max_ulp is None else self.max_ulp

    @property
    def agrees(self) -> bool:
        return all(edge.right for edge in self.edges)


class Functions(Measured, kw_only=True):
    """Roots, exp, log, pow, sin …: time against ulp, values at the edges.

    Floats of one argument are tried all; other errors are of samples, whose maximum is a lower bound. So is
    every error of a quick run. Ulp are of the exact value.
    """

    made_by: ClassVar[str] = "functions"
    quick: Annotated[bool, key("", "samples alone: every maximum is a lower bound")] = False
    rounds: Annotated[int | None, key("rounds", "timed")] = None
    vectors: Annotated[int | None, key("vectors", "of the timed arrays")] = None
    threads: Annotated[int | None, key("threads", "that tried arguments")] = None
    clocks: Annotated[dict[str, Range], key("Hz", "core clock by bits of the register")] = {}
    entries: Annotated[list[Entry], key("", "implementations", min_length=1)]
    normalise: Annotated[list[Normalise], key("", "vectors normalised")] = []
    article: Annotated[Article | None, key("", "figures beside it")] = None
    without: Annotated[list[str], key("", "libraries that are not here")] = []


FILE = "functions.json"
SCHEMAS = {FILE: Functions}
