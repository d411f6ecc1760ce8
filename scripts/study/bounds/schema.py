"""hotspots.json."""

from collections.abc import Collection
from typing import Annotated, ClassVar, Literal

from study.core.schema import Record, key
from study.counting.schema import Drawn
from study.numbers.schema import Result


class Share(Record, kw_only=True, omit_defaults=True):
    """A function of a profile."""

    function: Annotated[str, key("", "its name")]
    samples: Annotated[int, key("samples", "in it")]
    weight: Annotated[int, key("`event`", "events that they stand for")]
    share: Annotated[float | None, key("share", "of the frame's samples")] = None
    share_low: Annotated[float | None, key("share", "lower end, 95 % (Wilson)")] = None
    share_high: Annotated[float | None, key("share", "upper end")] = None
    seconds: Annotated[float | None, key("s", "of a frame")] = None


class Profiled(Drawn, kw_only=True, omit_defaults=True):
    """Samples of one build's timed frames."""

    variant: Annotated[Literal["shipped", "calls"], key("", "`shipped`, or `calls`: without inlining")]
    event: Annotated[str, key("", "that was sampled")]
    frames: Annotated[int, key("frames", "sampled", gt=0)]
    frame_ns: Annotated[float, key("ns", "median wall time of these")]
    cpu_ns: Annotated[float, key("ns", "of a frame in which the process ran", gt=0)]
    core_cycles: Annotated[float, key("core cycles", "the same")]
    samples: Annotated[int, key("samples", "of frames", gt=0)]
    weight: Annotated[int, key("`event`", "events that they stand for", gt=0)]
    covered: Annotated[float, key("share", "sampled time over timed time")]
    functions: Annotated[list[Share], key("", "most first", min_length=1)]
    left_out: Annotated[dict[str, int], key("samples", "function → what was not of a frame")]
    kernel: Annotated[str | None, key("", "why general code ran; null: the phase generates none")] = None

    @property
    def picture(self) -> tuple[str, str, int, int]:
        return self.scene, self.spec, self.width, self.height

    def samples_of(self, names: Collection[str]) -> int:
        return sum(one.samples for one in self.functions if one.function in names)

    def share_of(self, names: Collection[str]) -> float:
        """Share of the frame that these functions take together."""
        return sum(one.weight for one in self.functions if one.function in names) / self.weight


class Beside(Record, kw_only=True, omit_defaults=True):
    """Counts that stand beside a profile."""

    per_cycle: Annotated[dict[str, float | None], key("flop/core cycle", "by function")]
    lanes_active: Annotated[
        dict[str, float | None], key("share of lanes", "whose ray is under way, by function (counts.json)")
    ]


class Split(Record, kw_only=True, omit_defaults=True):
    """Shares of the cycles, by a model without front end and speculation."""

    retiring: Annotated[float | None, key("share", "at work")] = None
    memory: Annotated[float | None, key("share", "waiting for memory")] = None
    core: Annotated[float | None, key("share", "waiting for ports and results")] = None
    ports: Annotated[float | None, key("share", "of core: for ports")] = None
    dependencies: Annotated[float | None, key("share", "of core: for results")] = None


class Mca(Record, kw_only=True):
    """llvm-mca's view of one pass."""

    throughput: Annotated[float, key("core cycles", "when passes overlap")]
    latency: Annotated[float, key("core cycles", "alone")]
    block_throughput: Annotated[float, key("core cycles", "by the busiest resource")]
    uops: Annotated[float, key("micro-operations", "of a pass")]
    width: Annotated[int, key("micro-operations", "dispatched a cycle")]
    resources: Annotated[float, key("share of cycles", "in which the pressure of resources grows")]
    registers: Annotated[float, key("share of cycles", "the same of registers")]
    memory: Annotated[float, key("share of cycles", "the same of memory")]
    split: Annotated[Split | None, key("share", "of the cycles, by what is blamed")] = None


class Compared(Record, kw_only=True):
    """The modelled regions' cycles of a frame."""

    share: Annotated[float, key("share", "of the frame's samples")]
    throughput: Annotated[float, key("core cycles", "predicted, passes overlapping")]
    latency: Annotated[float, key("core cycles", "predicted, one after the other")]
    measured: Annotated[float, key("core cycles", "sampled")]


class Region(Record, kw_only=True, omit_defaults=True):
    """A hot region, its loop or straight code."""

    region: Annotated[str, key("", "its name")]
    function: Annotated[str, key("", "that it is in")]
    loop: Annotated[bool, key("", "whether it is one")]
    share: Annotated[float, key("share", "of the frame's samples")]
    instructions: Annotated[int, key("instructions", "of it")] = 0
    calls: Annotated[int, key("calls", "in it")] = 0
    mca: Annotated[Mca | None, key("", "what llvm-mca says")] = None
    measured: Annotated[float | None, key("core cycles", "a pass, from samples and counts")] = None


class Bound(Drawn, kw_only=True, omit_defaults=True):
    """What bounds a phase on a scene: a model of its hot regions."""

    by: Annotated[str, key("", "`model`")]
    processor: Annotated[str | None, key("", "that it is of")] = None
    model: Annotated[str | None, key("", "program, version and processor modelled")] = None
    remark: Annotated[str | None, key("", "what limits it")] = None
    covered: Annotated[float | None, key("share", "of the samples in regions that are modelled")] = None
    split: Annotated[Split | None, key("share", "of the cycles, by what they went to")] = None
    cpu_ns: Annotated[float, key("ns", "of a frame in which the process ran")]
    samples: Annotated[int | None, key("samples", "of frames")] = None
    compared: Annotated[Compared | None, key("core cycles", "modelled beside measured")] = None
    regions: Annotated[list[Region], key("", "hot regions")] = []


class Hotspots(Result, kw_only=True):
    """Samples by function, and a model of what bounds the hot regions."""

    made_by: ClassVar[str] = "hotspots"
    schema: Annotated[Literal[1], key("", "version of the form")] = 1
    profiles: Annotated[list[Profiled], key("", "by phase, scene and build")] = []
    beside: Annotated[dict[str, Beside], key("", "`scene|phase|width|height` → counts")] = {}
    bounds: Annotated[list[Bound], key("", "what bounds each phase")] = []


SCHEMAS = {"hotspots.json": Hotspots}
