"""counts.json and validation.json."""

from typing import Annotated, Any, ClassVar, Literal

from study.core.schema import Record, key
from study.numbers.schema import Result

# By kind of operation, of one lane (the machine convention: counting.decode).
FLOPS = {"add": 1, "mul": 1, "fma": 2, "div": 1, "sqrt": 1, "rsqrt": 1, "minmax": 1, "compare": 0, "any": 1}


class Drawn(Record, kw_only=True, omit_defaults=True):
    """A program's picture."""

    phase: Annotated[str, key("", "its name")]
    flags_from: Annotated[str, key("", "the phase whose compiler flags built it")] = ""
    scene: Annotated[str, key("", "its name")]
    width: Annotated[int, key("pixels", "of the picture", ge=1)]
    height: Annotated[int, key("pixels", "of the picture", ge=1)]

    def __post_init__(self) -> None:
        self.flags_from = self.flags_from or self.phase

    @property
    def spec(self) -> str:
        return self.phase if self.flags_from == self.phase else f"{self.phase}@{self.flags_from}"

    @property
    def size(self) -> tuple[int, int]:
        return self.width, self.height


class Picture(Drawn, kw_only=True, omit_defaults=True):
    """What was drawn, by which program."""

    scene_hash: Annotated[str | None, key("", "as in frames.jsonl")] = None
    compiler: Annotated[str | None, key("", "name and version")] = None
    flags: Annotated[str | None, key("", "of the compiler")] = None
    kernel: Annotated[str | None, key("", "that general code was counted; null: another phase")] = None


def named(one: Any) -> dict[str, Any]:
    """What says which program's picture it is, of any record that has it."""
    return {name: getattr(one, name) for name in ("phase", "flags_from", "scene", "width", "height")}


class Flops(Record, kw_only=True):
    """FLOPs of all lanes, by two conventions (docs/method.md)."""

    paper: Annotated[int, key("FLOP", "the paper's")]
    machine: Annotated[int, key("FLOP", "the machine's")]


class Function(Record, kw_only=True, omit_defaults=True):
    """One function of the source, by the macros of the counting build."""

    calls: Annotated[int, key("calls", "of it")]
    lanes: Annotated[int, key("lanes", "active, over all calls")] = 0
    paper: Annotated[int, key("FLOP", "of all lanes, the paper's convention")] = 0
    machine: Annotated[int, key("FLOP", "of all lanes, the machine's")] = 0
    useful: Annotated[int, key("FLOP", "of lanes whose ray is under way, the machine's")] = 0
    parts: Annotated[dict[str, int], key("executions", "of each line of costs.def")] = {}


class Declared(Picture, kw_only=True, omit_defaults=True):
    """What the counting build printed of one picture: calls and lanes, and FLOPs by declared costs."""

    lanes: Annotated[int, key("lanes", "rays at once")] = 1
    threads: Annotated[int | None, key("threads", "that drew it")] = None
    flops: Annotated[Flops | None, key("FLOP", "of the picture; null: the phase declares no costs")] = None
    by_function: Annotated[dict[str, Function], key("", "function → its counts")]
    by_class: Annotated[dict[str, int], key("operations", "lane by lane, by class")] = {}
    executed: Annotated[int, key("FLOP", "of all lanes, the machine's")] = 0
    useful: Annotated[int, key("FLOP", "of lanes whose ray is under way, the machine's")] = 0
    useful_paper: Annotated[int, key("FLOP", "the same, the paper's")] = 0

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.flops and not self.flops.machine:  # a costs.def of zeros names steps and declares no FLOPs
            self.flops = None


class Operation(Record):
    """Operations of one kind."""

    kind: Annotated[str, key("", "add, mul, fma …")]
    precision: Annotated[str, key("", "float or double")]
    bits: Annotated[int, key("bits", "of the register; the element's where scalar")]
    lanes: Annotated[int, key("operations", "lane by lane")]


class Executed(Record, kw_only=True, omit_defaults=True):
    """What was executed of a function, or of all."""

    calls: Annotated[int, key("calls", "of it")]
    machine: Annotated[int, key("FLOP", "the machine's convention")] = 0
    instructions: Annotated[int, key("instructions", "executed")]
    operations: Annotated[list[Operation], key("operations", "by kind")]
    load_bytes: Annotated[int, key("bytes", "loaded, as the core sees them")]
    store_bytes: Annotated[int, key("bytes", "stored")]


class Measurement(Picture, kw_only=True, omit_defaults=True):
    """One picture's timed region by one back end."""

    backend: Annotated[str, key("", "blocks, ptrace, sde or pmu (docs/method.md)")]
    variant: Annotated[str, key("", "`shipped`, or `calls`: without inlining")]
    total: Annotated[Executed, key("", "of the timed region, without libraries")]
    functions: Annotated[dict[str, Executed], key("", "function → its counts")]
    outside: Annotated[dict[str, Executed] | None, key("", "libraries; null: the back end does not see them")]
    calibrated: Annotated[
        bool | None, key("", "gave the known counts of tests/calibration on this machine; null: never tried")
    ]
    edges: Annotated[dict[str, dict[str, int]], key("calls", "caller → callee → direct calls")] = {}
    cpu: Annotated[str | None, key("", "it ran on")] = None


class Counts(Result, kw_only=True):
    """FLOPs declared and counted; FLOPs, bytes and instructions executed."""

    made_by: ClassVar[str] = "flops"
    schema: Annotated[Literal[1], key("", "version of the form")] = 1
    declared: Annotated[list[Declared], key("", "what the counting build printed")]
    measured: Annotated[list[Measurement], key("", "by back end and build")]


class Row(Record, kw_only=True):
    """Declared × counted against executed FLOPs, of a function or of all."""

    phase: Annotated[str, key("", "its name")]
    flags_from: Annotated[str, key("", "the phase whose compiler flags built it")]
    scene: Annotated[str, key("", "its name")]
    width: Annotated[int | None, key("pixels", "of the picture")] = None
    height: Annotated[int | None, key("pixels", "of the picture")] = None
    scope: Annotated[str, key("", "a function, or all; `calls of`: calls, which must be equal")]
    variant: Annotated[str, key("", "shipped or calls")] = "shipped"
    counted: Annotated[int, key("FLOP or calls", "declared × counted, the machine's")]
    measured: Annotated[int, key("FLOP or calls", "executed")]
    backend: Annotated[str, key("", "who measured")]
    calibrated: Annotated[bool | None, key("", "on this machine")] = None
    relative_difference: Annotated[float | None, key("", "(counted − measured)/measured")] = None
    residue_low: Annotated[int, key("FLOP", "known that the compiler adds, least")] = 0
    residue_high: Annotated[int, key("FLOP", "known that the compiler adds, most")] = 0
    unexplained: Annotated[float | None, key("share of measured", "that neither explains")] = None
    explained_to: Annotated[
        float | None, key("share of measured", "how wide the residue is: over 1 % it proves no more")
    ] = None
    judged: Annotated[bool, key("", "a function under 0.1 % of the picture is not")] = True
    within: Annotated[bool, key("", "1 %")] = True

    @property
    def of_calls(self) -> bool:
        return "calls of " in self.scope  # older runs have "math.h calls of " too


class Validation(Result, kw_only=True):
    """Declared costs against executed FLOPs, per phase, scene and function."""

    made_by: ClassVar[str] = "flops --validate"
    schema: Annotated[Literal[1], key("", "version of the form")] = 1
    tolerance: Annotated[float | None, key("share", "the greatest difference that is none")] = None
    rows: Annotated[list[Row], key("", "functions and totals")]


SCHEMAS = {"counts.json": Counts, "validation.json": Validation}
