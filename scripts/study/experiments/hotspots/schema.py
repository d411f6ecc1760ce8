"""hotspots.json."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal

from study.core.schema import ABSENT, Absent, Record, key
from study.numbers.schema import Result


class Share(Record, kw_only=True):
    """A function of a profile."""

    function: Annotated[str, key("", "its name")]
    samples: Annotated[int, key("samples", "in it")]
    weight: Annotated[int, key("`event`", "events that they stand for")]
    share: Annotated[float | Absent | None, key("share", "of the frame's samples")] = ABSENT
    share_low: Annotated[float | Absent | None, key("share", "lower end, 95 % (Wilson)")] = ABSENT
    share_high: Annotated[float | Absent | None, key("share", "upper end")] = ABSENT
    seconds: Annotated[float | Absent | None, key("s", "of a frame")] = ABSENT


class Profiled(Record, kw_only=True):
    """Samples of one build's timed frames."""

    phase: Annotated[str, key("", "its name")]
    flags_from: Annotated[str, key("", "the phase whose compiler flags built it")]
    variant: Annotated[str, key("", "`shipped`, or `calls`: without inlining")]
    scene: Annotated[str, key("", "its name")]
    width: Annotated[int, key("pixels", "of the picture", ge=1)]
    height: Annotated[int, key("pixels", "of the picture", ge=1)]
    event: Annotated[str, key("", "that was sampled")]
    frames: Annotated[int, key("frames", "sampled")]
    frame_ns: Annotated[float, key("ns", "median wall time of these")]
    cpu_ns: Annotated[float, key("ns", "of a frame in which the process ran")]
    core_cycles: Annotated[float, key("core cycles", "the same")]
    samples: Annotated[int, key("samples", "of frames")]
    weight: Annotated[int, key("`event`", "events that they stand for")]
    covered: Annotated[float, key("share", "sampled time over timed time")]
    functions: Annotated[list[Share], key("", "most first")]
    left_out: Annotated[dict[str, int], key("samples", "function → what was not of a frame")]
    addresses: Annotated[dict[str, int] | Absent, key("`event`", "weight by address of the phase's code")] = (
        ABSENT
    )
    kernel: Annotated[
        str | Absent | None, key("", "why general code ran; null: the phase generates none")
    ] = ABSENT


class Beside(Record, kw_only=True):
    """Counts that stand beside a profile."""

    per_cycle: Annotated[dict[str, float | None], key("flop/core cycle", "by function")]
    lanes_active: Annotated[
        dict[str, float | None], key("share of lanes", "whose ray is under way, by function (counts.json)")
    ]


class Region(Record, kw_only=True):
    """A hot region, its loop or straight code."""

    region: Annotated[str, key("", "its name")]
    function: Annotated[str, key("", "that it is in")]
    loop: Annotated[bool, key("", "whether it is one")]
    share: Annotated[float, key("share", "of the frame's samples")]
    instructions: Annotated[int | Absent, key("instructions", "of it")] = ABSENT
    calls: Annotated[int | Absent, key("calls", "in it")] = ABSENT
    mca: Annotated[
        dict[str, Any] | Absent | None, key("core cycles", "what llvm-mca says, by what bounds it")
    ] = ABSENT
    osaca: Annotated[dict[str, Any] | Absent | None, key("core cycles", "what OSACA says")] = ABSENT
    measured: Annotated[float | Absent | None, key("core cycles", "a pass, from samples and counts")] = ABSENT


class Bound(Record, kw_only=True):
    """What bounds a phase on a scene: a model of its hot regions, or the PMU's top-down split."""

    phase: Annotated[str, key("", "its name")]
    flags_from: Annotated[str | Absent, key("", "the phase whose compiler flags built it")] = ABSENT
    scene: Annotated[str, key("", "its name")]
    width: Annotated[int | Absent, key("pixels", "of the picture")] = ABSENT
    height: Annotated[int | Absent, key("pixels", "of the picture")] = ABSENT
    by: Annotated[str | Absent, key("", "`model`, or the PMU")] = ABSENT
    processor: Annotated[str | Absent | None, key("", "that it is of")] = ABSENT
    model: Annotated[str | Absent | None, key("", "program, version and processor modelled")] = ABSENT
    remark: Annotated[str | Absent | None, key("", "what limits it")] = ABSENT
    covered: Annotated[float | Absent | None, key("share", "of the samples in regions that are modelled")] = (
        ABSENT
    )
    split: Annotated[
        dict[str, float | None] | Absent | None, key("share", "retiring, memory, core, ports, dependencies")
    ] = ABSENT
    cpu_ns: Annotated[float | Absent | None, key("ns", "of a frame in which the process ran")] = ABSENT
    samples: Annotated[int | Absent | None, key("samples", "of frames")] = ABSENT
    compared: Annotated[
        dict[str, float | None] | Absent | None,
        key("core cycles", "modelled beside measured, of these regions"),
    ] = ABSENT
    regions: Annotated[list[Region] | Absent, key("", "hot regions")] = ABSENT


class Hotspots(Result, kw_only=True):
    """Samples by function, and a model of what bounds the hot regions."""

    made_by: ClassVar[str] = "hotspots"
    schema: Annotated[Literal[1] | Absent, key("", "version of the form")] = ABSENT
    profiles: Annotated[list[Profiled], key("", "by phase, scene and build")]
    beside: Annotated[dict[str, Beside] | Absent, key("", "`scene|phase|width|height` → counts")] = ABSENT
    bounds: Annotated[list[Bound] | Absent, key("", "what bounds each phase")] = ABSENT


SCHEMAS = {"hotspots.json": Hotspots}
