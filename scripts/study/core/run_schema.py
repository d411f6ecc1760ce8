"""The files of every run: context.json, plan.json, frames.jsonl and, where it is published, run.toml."""

from typing import Annotated, Any, ClassVar, Literal

import msgspec

from study.core.schema import File, Record, key

Natural = Annotated[int, msgspec.Meta(ge=0)]


class Cpu(Record, kw_only=True):
    """The CPU, as Linux tells it."""

    model: Annotated[str | None, key("", "its name")] = None
    vendor: Annotated[str | None, key("", "its maker")] = None
    family: Annotated[int | None, key("", "by CPUID; arm64: version of the architecture")] = None
    model_number: Annotated[int | None, key("", "by CPUID; arm64: part")] = None
    stepping: Annotated[int | None, key("", "by CPUID; arm64: variant and revision")] = None
    microcode: Annotated[str | None, key("", "its version")] = None
    microarchitecture: Annotated[str | None, key("", "from these numbers")] = None
    cores: Annotated[int | None, key("cores", "physical cores")] = None
    logical_cpus: Annotated[int | None, key("CPUs", "of the machine")] = None
    usable_cpus: Annotated[int | None, key("CPUs", "that the process may use")] = None
    flags: Annotated[list[str], key("", "instruction sets and features")] = []


class Cache(Record, kw_only=True):
    """A cache, as Linux tells it."""

    level: Annotated[str | None, key("", "1, 2 or 3")] = None
    type: Annotated[str | None, key("", "Data, Instruction or Unified")] = None
    size: Annotated[str | None, key("", "with its unit: 48K")] = None
    ways: Annotated[str | None, key("ways", "associativity")] = None
    shared_by: Annotated[str | None, key("", "CPUs that share it: 0-1")] = None


class Git(Record, kw_only=True):
    """The sources."""

    commit: Annotated[str | None, key("", "hash of the commit")] = None
    dirty: Annotated[bool | None, key("", "whether sources were changed; null: not known")] = None
    diff_sha256: Annotated[str | None, key("", "of that change; null: none")] = None
    unknown: Annotated[str | None, key("", "why something of it is not known")] = None


class Pinned(Record, kw_only=True):
    """The CPU that processes of one thread ran on."""

    cpu: Annotated[int | None, key("", "its number")] = None
    core_type: Annotated[str | None, key("", "P-core or E-core; null: all cores are alike")] = None
    siblings: Annotated[list[int], key("", "CPUs of its core, itself among them")] = []
    max_khz: Annotated[int | None, key("kHz", "highest frequency; null: not told")] = None
    governor: Annotated[str | None, key("", "how its clock is chosen")] = None


class Limits(Record, kw_only=True):
    """What the container may use, by its control groups."""

    cpus: Annotated[float | None, key("CPUs", "worth of time at once; null: no limit")] = None
    memory_bytes: Annotated[int | None, key("bytes", "null: no limit")] = None
    throttled: Annotated[int | None, key("times", "the quota was used up since the start")] = None


class End(Record, kw_only=True):
    """The machine when the sweep ended."""

    time: Annotated[str | None, key("UTC", "ISO 8601")] = None
    load_average: Annotated[list[float] | None, key("processes", "over 1, 5 and 15 minutes")] = None
    steal_ticks: Annotated[int | None, key("1/100 s", "as in context.json")] = None
    limits: Annotated[Limits, key("", "as in context.json")] = msgspec.field(default_factory=Limits)


class Context(File, kw_only=True):
    """What a run stands on: machine, toolchain, commit, noise. Files of experiments hold one of their own."""

    made_by: ClassVar[str] = "sweep"
    schema: Annotated[Literal[1] | None, key("", "version of the form")] = None
    time: Annotated[str | None, key("UTC", "when it was written; ISO 8601")] = None
    machine: Annotated[str | None, key("", "short name, made from the CPU's")] = None
    cpu: Annotated[Cpu, key("", "the CPU")] = msgspec.field(default_factory=Cpu)
    pinned: Annotated[Pinned, key("", "the CPU of one thread")] = msgspec.field(default_factory=Pinned)
    limits: Annotated[Limits, key("", "of the container")] = msgspec.field(default_factory=Limits)
    no_energy: Annotated[str | None, key("", "why there is no J per frame; null: there is")] = None
    caches: Annotated[list[Cache], key("", "its caches")] = []
    memory_kib: Annotated[int | None, key("KiB", "of the machine")] = None
    kernel: Annotated[str | None, key("", "version of the operating system's kernel")] = None
    system: Annotated[str | None, key("", "operating system")] = None
    hypervisor: Annotated[str | None, key("", "name; null: none is seen")] = None
    governor: Annotated[str | None, key("", "how the clock is chosen; null: not told")] = None
    no_turbo: Annotated[Any | None, key("", "whether turbo is off; null: not told")] = None
    boost: Annotated[
        str | None, key("", "1: the clock may exceed its base (AMD's switch); null: not told")
    ] = None
    huge_pages: Annotated[str | None, key("", "transparent ones: always, madvise or never")] = None
    compiler: Annotated[str | None, key("", "name and version")] = None
    libc: Annotated[str | None, key("", "name and version")] = None
    python: Annotated[str | None, key("", "version")] = None
    libraries: Annotated[dict[str, str | None], key("", "Python package → version")] = {}
    git: Annotated[Git, key("", "the sources")] = msgspec.field(default_factory=Git)
    load_average: Annotated[list[float] | None, key("processes", "over 1, 5 and 15 minutes")] = None
    steal_ticks: Annotated[int | None, key("1/100 s", "taken by the hypervisor since boot")] = None
    end: Annotated[End | None, key("", "of a sweep: the machine at its end")] = None
    scenes: Annotated[dict[str, str], key("", "scene given as a file → SHA-256 of own-scenes/NAME.json")] = {}


class Configuration(Record, kw_only=True):
    """A program, a scene, a size and a number of threads, timed together in every round."""

    config: Annotated[str, key("", "hash of what was asked for, as in frames.jsonl")] = ""
    spec: Annotated[str, key("", "phase, or phase@phase whose compiler flags built it")] = ""
    phase: Annotated[str, key("", "the source tree")]
    flags_from: Annotated[str, key("", "the phase whose compiler flags built it")] = ""
    scene: Annotated[str, key("", "its name")]
    scene_hash: Annotated[str, key("", "of its content, as in frames.jsonl")] = ""
    width: Annotated[int, key("pixels", "of the picture")] = 0
    height: Annotated[int, key("pixels", "of the picture")] = 0
    threads: Annotated[int, key("threads", "asked for")] = 1
    estimate_s: Annotated[float, key("s", "expected duration of a launch")] = 0
    once: Annotated[bool, key("", "one cold frame a launch: it takes longer than `long`")] = False
    launches: Annotated[int, key("launches", "of it; 0: the plan's")] = 0

    @property
    def group(self) -> tuple[str, int, int]:
        """Configurations that are compared with each other: same scene and size."""
        return self.scene, self.width, self.height

    def __str__(self) -> str:
        threads = f" threads={self.threads}" if self.threads > 1 else ""
        return f"{self.spec} {self.scene} {self.width}x{self.height}{threads}"


class Left(Record, kw_only=True):
    """What cannot run here, or crashed."""

    spec: Annotated[str, key("", "program")] = ""
    scene: Annotated[str | None, key("", "its name; null: all")] = None
    width: Annotated[int | None, key("pixels", "of the picture")] = None
    height: Annotated[int | None, key("pixels", "of the picture")] = None
    threads: Annotated[int | None, key("threads", "asked for")] = None
    reason: Annotated[str | None, key("", "why it cannot run")] = None
    launch: Annotated[int | None, key("", "that crashed")] = None
    status: Annotated[int | None, key("", "exit status of the driver; negative: a signal")] = None
    message: Annotated[str | None, key("", "what the driver said")] = None
    time: Annotated[str | None, key("UTC", "ISO 8601")] = None


class Short(Record, kw_only=True):
    """A configuration that the budget left short."""

    name: Annotated[str, key("", "program, scene, size and threads")]
    config: Annotated[str, key("", "its hash")]
    launches: Annotated[int, key("launches", "that there are")]


class Variant(Record, kw_only=True):
    """A phase's sources built for another number of lanes."""

    flags: Annotated[str, key("", "of the compiler, after the phase's")]
    lanes: Annotated[int, key("lanes", "rays at once")] = 0
    isa: Annotated[list[str], key("", "what it needs beyond the phase's")] = []


class PhaseJson(Record, kw_only=True):
    """A phase.json (`class Phase` in scripts/study/core/registry.py)."""

    name: Annotated[str | None, key("", "of the phase")] = None
    title: Annotated[str | None, key("", "in a few words")] = None
    family: Annotated[str | None, key("", "ladder, systems or truth")] = None
    order: Annotated[float | None, key("", "place in its family")] = None
    parent: Annotated[str | None, key("", "what it changes")] = None
    idea: Annotated[str | None, key("", "in a sentence")] = None
    paper: Annotated[str | None, key("", "the paper's name for it")] = None
    isa: Annotated[list[str] | None, key("", "instruction sets that it needs")] = None
    precision: Annotated[str | None, key("", "float or double")] = None
    lanes: Annotated[int | None, key("lanes", "rays at once, at the most")] = None
    threads: Annotated[bool | None, key("", "whether it takes several")] = None
    algorithm: Annotated[str | None, key("", "its name")] = None
    cflags: Annotated[str | None, key("", "of the compiler")] = None
    variants: Annotated[list[Variant], key("", "builds by lanes, widest first")] = []


class Program(Record, kw_only=True):
    """A program that is no phase, timed by `stepwise time` or read from another tool's file."""

    name: Annotated[str, key("", "`phase` of its frames")]
    case: Annotated[str, key("", "`scene` of its frames: n=128 of --vary; empty: there is one case")] = ""
    command: Annotated[list[str], key("", "words; one alone: a line for a shell, or another tool's")] = []
    prepare: Annotated[str | None, key("", "command that ran before each launch")] = None
    cleanup: Annotated[str | None, key("", "command that ran at the end")] = None
    sha256: Annotated[str | None, key("", "of the file that was run; null: not known")] = None


class Plan(File, kw_only=True):
    """What a sweep or `stepwise time` set out to measure."""

    made_by: ClassVar[str] = "sweep"
    schema: Annotated[Literal[1], key("", "version of the form")] = 1
    seed: Annotated[int, key("", "of the order and of the padding")] = 0
    cpu: Annotated[int | None, key("", "CPU that processes of one thread are pinned to")] = None
    launches: Annotated[int, key("launches", "of each configuration")] = 0
    reps: Annotated[int, key("frames", "timed in a launch")] = 0
    warmup: Annotated[int, key("frames", "before them, in no statistic")] = 0
    long: Annotated[float | None, key("s", "a longer frame is timed alone; null: none is")] = None
    few: Annotated[float | None, key("s", "a longer frame has three launches; null: all have the same")] = (
        None
    )
    budget_s: Annotated[float | None, key("s", "after which no round begins; null: no limit")] = None
    hit_distance: Annotated[float | None, key("scene units", "null: each scene's own")] = None
    max_steps: Annotated[int | None, key("evaluations", "null: each scene's own")] = None
    began: Annotated[str, key("UTC", "ISO 8601")] = ""
    finished: Annotated[str | None, key("UTC", "ISO 8601; null: not yet")] = None
    phases: Annotated[dict[str, PhaseJson], key("", "phase → its phase.json as it was")] = {}
    binaries: Annotated[dict[str, str], key("", "program → SHA-256")] = {}
    configurations: Annotated[list[Configuration], key("", "what is timed")] = []
    skipped: Annotated[list[Left], key("", "what cannot run here")] = []
    failures: Annotated[list[Left], key("", "what crashed")] = []
    not_reached: Annotated[list[Short], key("", "configurations the budget left out")] = []
    programs: Annotated[list[Program], key("", "timed instead of phases; empty: a sweep")] = []
    words: Annotated[list[str], key("", "of the command that timed the programs")] = []
    read_from: Annotated[list[str], key("", "files of other tools that the times are of")] = []
    precision: Annotated[float | None, key("", "relative half width that ends it; null: `launches` do")] = (
        None
    )
    seconds: Annotated[float | None, key("s", "after which it ends all the same")] = None
    time_from: Annotated[str | None, key("", "pattern of times in the output; null: wall time")] = None


class Frame(File, kw_only=True):
    """One timed frame. Analysis drops a line that was cut off in mid-write; the frame is measured again."""

    made_by: ClassVar[str] = "sweep"
    schema: Annotated[Literal[1] | None, key("", "version of the form")] = None
    config: Annotated[str, key("", "hash of what was asked for: program, scene, size, threads, overrides")]
    launch: Annotated[int, key("", "number of the process launch within this configuration", ge=0)]
    round: Annotated[Natural | None, key("", "of the sweep, by which launches are paired")] = None
    frame: Annotated[int, key("", "in its launch, from 0; warm-up: −K to −1; or the animation's")]
    warmup: Annotated[bool, key("", "a frame that no statistic uses")]
    first: Annotated[bool | None, key("", "the first of its process, warm-up or not")] = None
    phase: Annotated[str, key("", "the source tree")]
    flags_from: Annotated[str, key("", "the phase whose compiler flags built it; as a rule the same")]
    scene: Annotated[str, key("", "its name")]
    scene_hash: Annotated[str, key("", "64-bit FNV-1a of the canonical JSON with overrides")]
    width: Annotated[int, key("pixels", "of the picture", ge=1)]
    height: Annotated[int, key("pixels", "of the picture", ge=1)]
    threads: Annotated[int, key("threads", "that drew it", ge=1)]
    isa: Annotated[str, key("", "instruction sets of the code that ran")]
    precision: Annotated[str, key("", "float or double")]
    lanes: Annotated[int | None, key("lanes", "rays at once, of the variant that ran")] = None
    flags: Annotated[str, key("", "of the compiler")]
    compiler: Annotated[str, key("", "name and version")]
    libc: Annotated[str, key("", "version")]
    hit_distance: Annotated[float | None, key("scene units", "as used")] = None
    max_steps: Annotated[int | None, key("evaluations", "step cap, as used")] = None
    overridden: Annotated[bool | None, key("", "the command line changed one of the two")] = None
    ns: Annotated[float, key("ns", "`phase_render` (CLOCK_MONOTONIC_RAW), with an update", gt=0)]
    update_ns: Annotated[int | None, key("ns", "`phase_update`'s share; 0 where nothing moves")] = None
    scene_time: Annotated[float | None, key("s", "where an animation is: frame/60")] = None
    tsc_cycles: Annotated[int, key("timer cycles", "the same time by fenced RDTSC or CNTVCT_EL0")]
    tsc_hz: Annotated[float, key("Hz", "timer's rate, as this process has it; 0: STEPWISE_UNTIMED")]
    core_hz_before: Annotated[float, key("Hz", "core clock right before the frame")]
    core_hz_after: Annotated[float, key("Hz", "core clock right after it")]
    core_hz_load: Annotated[float | None, key("Hz", "core clock under its vector FMAs; 0: scalar")] = None
    core_cycles: Annotated[float, key("core cycles", "ns times the mean core clock: an estimate")]
    prepare_ns: Annotated[int, key("ns", "set-up (`phase_prepare`), once a process")]
    image: Annotated[str | None, key("", "picture that was written; null: none")] = None
    settings: Annotated[str | None, key("", "how a phase was told to work (STEPWISE_RODS …)")] = None
    display: Annotated[str | None, key("", "who presents frames: `phase` or `driver`; else null")] = None
    kernel: Annotated[str | None, key("", "`generated`, or `general: ` and why; null: neither")] = None
    kernel_hash: Annotated[str | None, key("", "its name in the cache")] = None
    kernel_compiler: Annotated[str | None, key("", "what compiled it")] = None
    kernel_generate_ns: Annotated[int | None, key("ns", "of prepare_ns: writing the source")] = None
    kernel_compile_ns: Annotated[int | None, key("ns", "of it compiling; 0: cached")] = None
    kernel_load_ns: Annotated[int | None, key("ns", "of prepare_ns: checking and loading it")] = None
    present_ns: Annotated[int, key("ns", "gamma and 8 bits of this frame, not in ns")]
    timer_overhead_cycles: Annotated[int | None, key("timer cycles", "least of empty readings")] = None
    steal_ticks: Annotated[int | None, key("1/100 s", "taken by the hypervisor meanwhile")] = None
    ctx_voluntary: Annotated[int | None, key("switches", "voluntary, during the frame")] = None
    ctx_involuntary: Annotated[int | None, key("switches", "involuntary, during the frame")] = None
    faults_minor: Annotated[int | None, key("faults", "minor page faults during the frame")] = None
    faults_major: Annotated[int | None, key("faults", "major page faults during the frame")] = None
    max_rss_kib: Annotated[int | None, key("KiB", "peak resident memory of the process so far")] = None
    cpu: Annotated[int | None, key("", "CPU it was pinned to; −1: not pinned")] = None
    joules: Annotated[float | None, key("J per frame", "at the last frame: RAPL, of timed frames")] = None
    env_bytes: Annotated[int | None, key("bytes", "padding of the environment (layout bias)")] = None
    user_ns: Annotated[int | None, key("ns", "of a program: CPU time in user mode")] = None
    system_ns: Annotated[int | None, key("ns", "of a program: CPU time in the kernel")] = None
    unused_ns: Annotated[int | None, key("ns", "of a program: its CPUs' time that it did not use")] = None
    instructions: Annotated[int | None, key("instructions", "of a program, in user mode")] = None
    exit_status: Annotated[int | None, key("", "of a program; negative: the signal that killed it")] = None
    time: Annotated[str | None, key("UTC", "when the line was written; ISO 8601")] = None

    @property
    def spec(self) -> str:
        return self.phase if self.phase == self.flags_from else f"{self.phase}@{self.flags_from}"


class About(File, kw_only=True):
    """What a reader must know of a published run before its numbers."""

    made_by: ClassVar[str] = "publish"
    machine: Annotated[str, key("", "its CPU, and what is special about it")]
    compiler: Annotated[str, key("", "name and version")]
    time: Annotated[str, key("UTC", "when the run began; ISO 8601")]
    commit: Annotated[str, key("", "first ten digits; several where files are of several commits")]
    commands: Annotated[list[str], key("", "what made the run")]
    caveat: Annotated[str, key("", "what limits its numbers")]


class Cuts(File, kw_only=True):
    """What a quick study cut of each experiment (without an entry it is whole), and what was remarked."""

    made_by: ClassVar[str] = "study"
    schema: Annotated[Literal[1], key("", "version of the form")] = 1
    cut: Annotated[dict[str, str], key("", "experiment → a sentence: what the run has of it")]
    remarks: Annotated[list[str], key("", "of the study's commands, each after its chapter's name")] = []


RUN_TOML = "run.toml"
STUDY = "study.json"
SCHEMAS = {"context.json": Context, "plan.json": Plan, "frames.jsonl": Frame}
