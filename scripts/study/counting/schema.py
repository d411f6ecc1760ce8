"""counts.json and validation.json."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal

from study.core.schema import ABSENT, Absent, Record, key
from study.numbers.schema import Result

OLD_NAMES = {"assembly blocks": "blocks"}  # of back ends, in files of earlier runs


class Flops(Record, kw_only=True):
    """FLOPs of all lanes, by two conventions (docs/method.md)."""

    paper: Annotated[int, key("FLOP", "the paper's")]
    machine: Annotated[int, key("FLOP", "the machine's")]


class Function(Record, kw_only=True):
    """One function of the source, by the macros of the counting build."""

    calls: Annotated[int, key("calls", "of it")]
    lanes: Annotated[int | Absent, key("lanes", "active, over all calls")] = ABSENT
    paper: Annotated[int | Absent, key("FLOP", "of all lanes, the paper's convention")] = ABSENT
    machine: Annotated[int | Absent, key("FLOP", "of all lanes, the machine's")] = ABSENT
    useful: Annotated[int | Absent, key("FLOP", "of lanes whose ray is under way, the machine's")] = ABSENT
    parts: Annotated[dict[str, int] | Absent, key("executions", "of each line of costs.def")] = ABSENT


class Declared(Record, kw_only=True):
    """Declared costs times counted calls, of one picture."""

    phase: Annotated[str, key("", "its name")]
    flags_from: Annotated[str | Absent, key("", "the phase whose compiler flags built it")] = ABSENT
    scene: Annotated[str, key("", "its name")]
    scene_hash: Annotated[str | Absent, key("", "as in frames.jsonl")] = ABSENT
    width: Annotated[int, key("pixels", "of the picture", ge=1)]
    height: Annotated[int, key("pixels", "of the picture", ge=1)]
    compiler: Annotated[str | Absent | None, key("", "name and version")] = ABSENT
    flags: Annotated[str | Absent | None, key("", "of the compiler")] = ABSENT
    lanes: Annotated[int | Absent, key("lanes", "rays at once")] = ABSENT
    kernel: Annotated[str | Absent | None, key("", "that general code was counted; null: another phase")] = (
        ABSENT
    )
    threads: Annotated[int | Absent, key("threads", "that drew it")] = ABSENT
    flops: Annotated[Flops, key("FLOP", "of the picture")]
    by_function: Annotated[dict[str, Function], key("", "function → its counts")]
    by_class: Annotated[dict[str, Any] | Absent, key("operations", "lane by lane, by class")] = ABSENT
    executed: Annotated[int | Absent, key("FLOP", "of all lanes, the machine's")] = ABSENT
    useful: Annotated[int | Absent, key("FLOP", "of lanes whose ray is under way, the machine's")] = ABSENT
    useful_paper: Annotated[int | Absent, key("FLOP", "the same, the paper's")] = ABSENT


class Operation(Record, kw_only=True):
    """Operations of one kind."""

    kind: Annotated[str, key("", "add, mul, fma …")]
    precision: Annotated[str, key("", "float or double")]
    bits: Annotated[int, key("bits", "of the register; the element's where scalar")]
    lanes: Annotated[int, key("operations", "lane by lane")]


class Executed(Record, kw_only=True):
    """What was executed of a function, or of all."""

    calls: Annotated[int, key("calls", "of it")]
    machine: Annotated[int | Absent, key("FLOP", "the machine's convention")] = ABSENT
    instructions: Annotated[int, key("instructions", "executed")]
    operations: Annotated[list[Operation], key("operations", "by kind")]
    load_bytes: Annotated[int, key("bytes", "loaded, as the core sees them")]
    store_bytes: Annotated[int, key("bytes", "stored")]
    mix: Annotated[dict[str, int], key("instructions", "by what they are for")]
    doublings: Annotated[int | Absent, key("lanes", "of sums x + x, as which compilers write 2·x")] = ABSENT


class Build(Record, kw_only=True):
    """One picture's timed region by one back end."""

    backend: Annotated[str, key("", "blocks, qemu, ptrace, sde or pmu (docs/method.md)")]
    variant: Annotated[str, key("", "`shipped`, or `calls`: without inlining")]
    phase: Annotated[str, key("", "its name")]
    flags_from: Annotated[str, key("", "the phase whose compiler flags built it")]
    scene: Annotated[str, key("", "its name")]
    scene_hash: Annotated[str, key("", "as in frames.jsonl")]
    width: Annotated[int, key("pixels", "of the picture", ge=1)]
    height: Annotated[int, key("pixels", "of the picture", ge=1)]
    total: Annotated[Executed, key("", "of the timed region, without libraries")]
    functions: Annotated[dict[str, Executed], key("", "function → its counts")]
    outside: Annotated[dict[str, Executed] | None, key("", "libraries; null: the back end does not see them")]
    calibrated: Annotated[bool | None, key("", "gave the known counts of tests/calibration on this machine")]
    edges: Annotated[dict[str, dict[str, int]] | Absent, key("calls", "caller → callee → direct calls")] = (
        ABSENT
    )
    compiler: Annotated[str | Absent | None, key("", "name and version")] = ABSENT
    flags: Annotated[str | Absent | None, key("", "of the compiler")] = ABSENT
    cpu: Annotated[str | Absent | None, key("", "it ran on")] = ABSENT
    kernel: Annotated[str | Absent | None, key("", "that general code was counted; null: another phase")] = (
        ABSENT
    )


class Counts(Result, kw_only=True):
    """FLOPs declared and counted; FLOPs, bytes and instructions executed."""

    made_by: ClassVar[str] = "flops"
    schema: Annotated[Literal[1] | Absent, key("", "version of the form")] = ABSENT
    declared: Annotated[list[Declared], key("", "what the counting build printed")]
    measured: Annotated[list[Build], key("", "by back end and build")]

    @classmethod
    def current(cls, data: Any) -> Any:
        for one in data["measured"]:
            one["backend"] = OLD_NAMES.get(one["backend"], one["backend"])
        return data


class Row(Record, kw_only=True):
    """Declared × counted against executed FLOPs, of a function or of all."""

    phase: Annotated[str, key("", "its name")]
    flags_from: Annotated[str, key("", "the phase whose compiler flags built it")]
    scene: Annotated[str, key("", "its name")]
    width: Annotated[int | Absent, key("pixels", "of the picture")] = ABSENT
    height: Annotated[int | Absent, key("pixels", "of the picture")] = ABSENT
    scope: Annotated[
        str, key("", "a function, or all; `calls of` and `math.h calls of`: calls, which must be equal")
    ]
    variant: Annotated[str | Absent, key("", "shipped or calls")] = ABSENT
    counted: Annotated[int, key("FLOP or calls", "declared × counted, the machine's")]
    measured: Annotated[int, key("FLOP or calls", "executed")]
    backend: Annotated[str, key("", "who measured")]
    calibrated: Annotated[bool | Absent | None, key("", "on this machine")] = ABSENT
    relative_difference: Annotated[float | Absent | None, key("", "(counted − measured)/measured")] = ABSENT
    residue_low: Annotated[int | Absent, key("FLOP", "known that the compiler adds, least")] = ABSENT
    residue_high: Annotated[int | Absent, key("FLOP", "known that the compiler adds, most")] = ABSENT
    unexplained: Annotated[float | Absent | None, key("share of measured", "that neither explains")] = ABSENT
    explained_to: Annotated[
        float | Absent | None, key("share of measured", "how wide the residue is: over 1 % it proves no more")
    ] = ABSENT
    judged: Annotated[bool | Absent, key("", "a function under 0.1 % of the picture is not")] = ABSENT
    within: Annotated[bool | Absent, key("", "1 %")] = ABSENT


class Validation(Result, kw_only=True):
    """Declared costs against executed FLOPs, per phase, scene and function."""

    made_by: ClassVar[str] = "flops --validate"
    schema: Annotated[Literal[1] | Absent, key("", "version of the form")] = ABSENT
    tolerance: Annotated[float | Absent, key("share", "the greatest difference that is none")] = ABSENT
    rows: Annotated[list[Row], key("", "functions and totals")]

    @classmethod
    def current(cls, data: Any) -> Any:
        for row in data["rows"]:
            row["backend"] = OLD_NAMES.get(row["backend"], row["backend"])
        return data


SCHEMAS = {"counts.json": Counts, "validation.json": Validation}
