"""functions.json."""

from __future__ import annotations

from typing import Annotated, ClassVar

from study.core.schema import ABSENT, Absent, Record, key
from study.numbers.schema import Measured, Range


class Edge(Record, kw_only=True):
    """A value at the edge of a function's range."""

    argument: Annotated[str, key("", "in words")]
    value: Annotated[str, key("", "given")]
    exact: Annotated[str, key("", "wanted")]
    right: Annotated[bool, key("", "whether they agree")]


class Entry(Record, kw_only=True):
    """One function, precision, implementation and instruction set."""

    id: Annotated[int | Absent, key("", "number in the program")] = ABSENT
    function: Annotated[str, key("", "rsqrt, exp, sin …")]
    family: Annotated[str, key("", "how it is made: libm, instruction, polynomial …")]
    name: Annotated[str, key("", "of the implementation")]
    isa: Annotated[str, key("", "instruction set")]
    bits: Annotated[int, key("bits", "of the register")]
    precision: Annotated[str, key("", "float or double")]
    arguments: Annotated[int | Absent, key("", "1 or 2")] = ABSENT
    missing: Annotated[str | Absent | None, key("", "why it did not run; else null")] = ABSENT
    count: Annotated[int | Absent, key("", "arguments tried")] = ABSENT
    non_finite: Annotated[int | Absent, key("results", "not finite within its range")] = ABSENT
    max_ulp: Annotated[
        float | Absent | None, key("ulp of the exact value", "largest error; of samples a lower bound")
    ] = ABSENT
    rms_ulp: Annotated[float | Absent | None, key("ulp of the exact value", "root mean square error")] = (
        ABSENT
    )
    worst_a: Annotated[float | Absent | None, key("", "argument of the largest error")] = ABSENT
    worst_b: Annotated[float | Absent | None, key("", "the second argument there")] = ABSENT
    edges: Annotated[list[Edge] | Absent, key("", "values at the edges")] = ABSENT
    stream_ns: Annotated[
        Range | Absent | None, key("ns", "per element, independent ones; median over rounds")
    ] = ABSENT
    stream_cycles: Annotated[Range | Absent | None, key("core cycles", "the same")] = ABSENT
    latency_ns: Annotated[Range | Absent | None, key("ns", "per call in a chain, less the chain's own")] = (
        ABSENT
    )
    latency_cycles: Annotated[Range | Absent | None, key("core cycles", "the same")] = ABSENT
    front: Annotated[
        bool | Absent | None, key("", "whether none is faster at a smaller error (throughput)")
    ] = ABSENT


class Segment(Record, kw_only=True):
    """Floats that are tried."""

    first: Annotated[float, key("", "first")]
    last: Annotated[float, key("", "last")]
    stride: Annotated[int, key("floats", "from one to the next")]


class Arguments(Record, kw_only=True):
    """Where samples are drawn."""

    low: Annotated[float, key("", "least magnitude")]
    high: Annotated[float, key("", "greatest magnitude")]
    both_signs: Annotated[bool, key("", "whether negative ones, too")]


class Target(Record, kw_only=True):
    """A function, and where its errors are measured."""

    function: Annotated[str, key("", "its name")]
    float_segments: Annotated[list[Segment] | Absent, key("", "all floats that are tried")] = ABSENT
    float_a: Annotated[Arguments | Absent, key("", "first argument, floats by samples")] = ABSENT
    float_b: Annotated[Arguments | Absent, key("", "second argument")] = ABSENT
    double_a: Annotated[Arguments | Absent, key("", "first argument, doubles")] = ABSENT
    double_b: Annotated[Arguments | Absent, key("", "second argument")] = ABSENT
    timed_a: Annotated[Arguments | Absent, key("", "first argument, where it is timed")] = ABSENT
    timed_b: Annotated[Arguments | Absent, key("", "second argument")] = ABSENT


class Normalise(Record, kw_only=True):
    """One way to normalise vectors."""

    vectors: Annotated[int, key("vectors", "normalised")]
    isa: Annotated[str, key("", "instruction set")]
    bits: Annotated[int | Absent, key("bits", "of the register")] = ABSENT
    name: Annotated[str, key("", "of the kernel")]
    layout: Annotated[str, key("", "AoS or SoA")]
    max_ulp: Annotated[float | Absent | None, key("ulp", "largest error")] = ABSENT
    rms_ulp: Annotated[float | Absent | None, key("ulp", "root mean square error")] = ABSENT
    ns: Annotated[Range, key("ns", "per vector")]
    speedup: Annotated[Range, key("×", "over scalar triples")]
    share_of_memory: Annotated[
        float | Absent | None, key("share", "time of the same loads and stores alone over its own")
    ] = ABSENT
    bytes: Annotated[int | Absent, key("bytes", "moved")] = ABSENT
    gb_per_s: Annotated[float | Absent, key("GB/s", "moved")] = ABSENT


class Article(Record, kw_only=True):
    """The article's figures beside it."""

    cpu: Annotated[str, key("", "its machine")]
    vectors: Annotated[int, key("vectors", "normalised")]
    scalar_ms: Annotated[float, key("ms", "scalar code")]
    sse_ms: Annotated[float, key("ms", "SSE code")]
    speedup: Annotated[float, key("×", "of the two")]
    source: Annotated[str | Absent, key("", "the article")] = ABSENT


class Table(Record, kw_only=True):
    """Results of an instruction for the 2²⁴ floats in [1, 4). They differ by CPU maker."""

    instruction: Annotated[str, key("", "its name")]
    isa: Annotated[str, key("", "instruction set")]
    precision: Annotated[str, key("", "float or double")]
    sha256: Annotated[str, key("", "of all results")]
    max_relative_error: Annotated[float, key("", "largest relative error")]


class Functions(Measured, kw_only=True):
    """Roots, exp, log, pow, sin …: time against ulp, values at the edges.

    Floats of one argument are tried all; other errors are of samples, whose maximum is a lower bound. So is
    every error of a quick run. Ulp are of the exact value.
    """

    made_by: ClassVar[str] = "functions"
    quick: Annotated[bool | Absent, key("", "samples alone: every maximum is a lower bound")] = ABSENT
    rounds: Annotated[int | Absent, key("rounds", "timed")] = ABSENT
    vectors: Annotated[int | Absent, key("vectors", "of the timed arrays")] = ABSENT
    threads: Annotated[int | Absent, key("threads", "that tried arguments")] = ABSENT
    clocks: Annotated[dict[str, Range] | Absent, key("Hz", "core clock by bits of the register")] = ABSENT
    targets: Annotated[list[Target] | Absent, key("", "functions and where errors are measured")] = ABSENT
    entries: Annotated[list[Entry], key("", "implementations", min_length=1)]
    normalise: Annotated[list[Normalise] | Absent, key("", "vectors normalised")] = ABSENT
    article: Annotated[Article | Absent, key("", "figures beside it")] = ABSENT
    rsqrt_tables: Annotated[list[Table] | Absent, key("", "what this CPU's approximate roots give")] = ABSENT
    without: Annotated[list[str] | Absent, key("", "libraries that are not here")] = ABSENT


SCHEMAS = {"functions.json": Functions}
