"""The files of every run: context.json, plan.json, frames.jsonl and, where it is published, run.toml."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal

import msgspec

from study.core.schema import ABSENT, Absent, File, Record, key


class Cpu(Record, kw_only=True):
    """The CPU, as Linux tells it."""

    model: Annotated[str | Absent | None, key("", "its name")] = ABSENT
    vendor: Annotated[str | Absent | None, key("", "its maker")] = ABSENT
    family: Annotated[int | Absent | None, key("", "by CPUID")] = ABSENT
    model_number: Annotated[int | Absent | None, key("", "by CPUID")] = ABSENT
    stepping: Annotated[int | Absent | None, key("", "by CPUID")] = ABSENT
    microcode: Annotated[str | Absent | None, key("", "its version")] = ABSENT
    microarchitecture: Annotated[str | Absent | None, key("", "from family and model")] = ABSENT
    cores: Annotated[int | Absent | None, key("cores", "physical cores")] = ABSENT
    logical_cpus: Annotated[int | Absent | None, key("CPUs", "of the machine")] = ABSENT
    usable_cpus: Annotated[int | Absent | None, key("CPUs", "that the process may use")] = ABSENT
    flags: Annotated[list[str] | Absent, key("", "instruction sets and features")] = ABSENT


class Cache(Record, kw_only=True):
    """A cache, as Linux tells it."""

    level: Annotated[str | Absent | None, key("", "1, 2 or 3")] = ABSENT
    type: Annotated[str | Absent | None, key("", "Data, Instruction or Unified")] = ABSENT
    size: Annotated[str | Absent | None, key("", "with its unit: 48K")] = ABSENT
    ways: Annotated[str | Absent | None, key("ways", "associativity")] = ABSENT
    shared_by: Annotated[str | Absent | None, key("", "CPUs that share it: 0-1")] = ABSENT


class Git(Record, kw_only=True):
    """The sources."""

    commit: Annotated[str | Absent | None, key("", "hash of the commit")] = ABSENT
    dirty: Annotated[bool | Absent | None, key("", "whether sources were changed; null: not known")] = ABSENT
    diff_sha256: Annotated[str | Absent | None, key("", "of that change; null: none")] = ABSENT
    unknown: Annotated[str | Absent | None, key("", "why something of it is not known")] = ABSENT
    kind: Annotated[str | Absent | None, key("", "clone, worktree, submodule, archive")] = ABSENT


class Pinned(Record, kw_only=True):
    """The CPU that processes of one thread ran on."""

    cpu: Annotated[int | Absent | None, key("", "its number")] = ABSENT
    core_type: Annotated[str | Absent | None, key("", "P-core or E-core; null: all cores are alike")] = ABSENT
    siblings: Annotated[list[int] | Absent, key("", "CPUs of its core, itself among them")] = ABSENT
    max_khz: Annotated[int | Absent | None, key("kHz", "highest frequency; null: not told")] = ABSENT
    governor: Annotated[str | Absent | None, key("", "how its clock is chosen")] = ABSENT


class Limits(Record, kw_only=True):
    """What the container may use, by its control groups."""

    cpus: Annotated[float | Absent | None, key("CPUs", "worth of time at once; null: no limit")] = ABSENT
    memory_bytes: Annotated[int | Absent | None, key("bytes", "null: no limit")] = ABSENT
    throttled: Annotated[int | Absent | None, key("times", "the quota was used up since the start")] = ABSENT


class End(Record, kw_only=True):
    """The machine when the sweep ended."""

    time: Annotated[str | Absent | None, key("UTC", "ISO 8601")] = ABSENT
    load_average: Annotated[list[float] | Absent | None, key("processes", "over 1, 5 and 15 minutes")] = (
        ABSENT
    )
    steal_ticks: Annotated[int | Absent | None, key("1/100 s", "as in context.json")] = ABSENT
    limits: Annotated[Limits | Absent | None, key("", "as in context.json")] = ABSENT


class Context(File, kw_only=True):
    """What a run stands on: machine, toolchain, commit, noise. Files of experiments hold one of their own."""

    made_by: ClassVar[str] = "sweep"
    schema: Annotated[Literal[1] | Absent, key("", "version of the form")] = ABSENT
    time: Annotated[str | Absent | None, key("UTC", "when it was written; ISO 8601")] = ABSENT
    machine: Annotated[str | Absent | None, key("", "short name, made from the CPU's")] = ABSENT
    cpu: Annotated[Cpu | Absent | None, key("", "the CPU")] = ABSENT
    pinned: Annotated[Pinned | Absent | None, key("", "the CPU of one thread")] = ABSENT
    limits: Annotated[Limits | Absent | None, key("", "of the container")] = ABSENT
    no_energy: Annotated[str | Absent | None, key("", "why there is no J per frame; null: there is")] = ABSENT
    caches: Annotated[list[Cache] | Absent | None, key("", "its caches")] = ABSENT
    memory_kib: Annotated[int | Absent | None, key("KiB", "of the machine")] = ABSENT
    kernel: Annotated[str | Absent | None, key("", "version of the operating system's kernel")] = ABSENT
    system: Annotated[str | Absent | None, key("", "operating system")] = ABSENT
    hypervisor: Annotated[str | Absent | None, key("", "name; null: none is seen")] = ABSENT
    governor: Annotated[str | Absent | None, key("", "how the clock is chosen; null: not told")] = ABSENT
    no_turbo: Annotated[Any | Absent, key("", "whether turbo is off; null: not told")] = ABSENT
    compiler: Annotated[str | Absent | None, key("", "name and version")] = ABSENT
    libc: Annotated[str | Absent | None, key("", "name and version")] = ABSENT
    python: Annotated[str | Absent | None, key("", "version")] = ABSENT
    libraries: Annotated[dict[str, str | None] | Absent, key("", "Python package → version")] = ABSENT
    git: Annotated[Git | Absent | None, key("", "the sources")] = ABSENT
    load_average: Annotated[list[float] | Absent | None, key("processes", "over 1, 5 and 15 minutes")] = (
        ABSENT
    )
    steal_ticks: Annotated[
        int | Absent | None, key("1/100 s", "time the hypervisor took from all CPUs since boot")
    ] = ABSENT
    end: Annotated[End | Absent | None, key("", "of a sweep: the machine at its end")] = ABSENT


class Configuration(Record, kw_only=True):
    """A program, a scene, a size and a number of threads, timed together in every round."""

    config: Annotated[str | Absent, key("", "hash of what was asked for, as in frames.jsonl")] = ABSENT
    spec: Annotated[str | Absent, key("", "phase, or phase@phase whose compiler flags built it")] = ABSENT
    phase: Annotated[str, key("", "the source tree")]
    flags_from: Annotated[str | Absent, key("", "the phase whose compiler flags built it")] = ABSENT
    scene: Annotated[str, key("", "its name")]
    scene_hash: Annotated[str | Absent, key("", "of its content, as in frames.jsonl")] = ABSENT
    width: Annotated[int | Absent, key("pixels", "of the picture")] = ABSENT
    height: Annotated[int | Absent, key("pixels", "of the picture")] = ABSENT
    threads: Annotated[int | Absent, key("threads", "asked for")] = ABSENT
    estimate_s: Annotated[float | Absent, key("s", "expected duration of a launch")] = ABSENT
    once: Annotated[bool | Absent, key("", "one cold frame a launch: it takes longer than `long`")] = ABSENT


class Variant(Record, kw_only=True):
    """A phase's sources built for another number of lanes."""

    flags: Annotated[str, key("", "of the compiler, after the phase's")]
    lanes: Annotated[int | Absent, key("lanes", "rays at once")] = ABSENT
    isa: Annotated[list[str] | Absent, key("", "what it needs beyond the phase's")] = ABSENT


class PhaseJson(Record, kw_only=True):
    """A phase.json (`class Phase` in scripts/study/core/registry.py)."""

    name: Annotated[str | Absent, key("", "of the phase")] = ABSENT
    title: Annotated[str | Absent | None, key("", "in a few words")] = ABSENT
    family: Annotated[str | Absent | None, key("", "ladder, systems or truth")] = ABSENT
    order: Annotated[float | Absent | None, key("", "place in its family")] = ABSENT
    parent: Annotated[str | Absent | None, key("", "what it changes")] = ABSENT
    idea: Annotated[str | Absent | None, key("", "in a sentence")] = ABSENT
    paper: Annotated[str | Absent | None, key("", "the paper's name for it")] = ABSENT
    isa: Annotated[list[str] | Absent | None, key("", "instruction sets that it needs")] = ABSENT
    precision: Annotated[str | Absent | None, key("", "float or double")] = ABSENT
    lanes: Annotated[int | Absent | None, key("lanes", "rays at once, at the most")] = ABSENT
    threads: Annotated[bool | Absent | None, key("", "whether it takes several")] = ABSENT
    algorithm: Annotated[str | Absent | None, key("", "its name")] = ABSENT
    cflags: Annotated[str | Absent | None, key("", "of the compiler")] = ABSENT
    variants: Annotated[list[Variant] | Absent | None, key("", "builds by lanes, widest first")] = ABSENT


class Plan(File, kw_only=True):
    """What a sweep set out to measure."""

    made_by: ClassVar[str] = "sweep"
    schema: Annotated[Literal[1] | Absent, key("", "version of the form")] = ABSENT
    seed: Annotated[int | Absent | None, key("", "of the order and of the padding")] = ABSENT
    cpu: Annotated[int | Absent | None, key("", "CPU that processes of one thread are pinned to")] = ABSENT
    launches: Annotated[int | Absent | None, key("launches", "of each configuration")] = ABSENT
    reps: Annotated[int | Absent | None, key("frames", "timed in a launch")] = ABSENT
    warmup: Annotated[int | Absent | None, key("frames", "before them, in no statistic")] = ABSENT
    long: Annotated[
        float | Absent | None, key("s", "a longer frame is timed alone, without warm-up; null: none is")
    ] = ABSENT
    budget_s: Annotated[float | Absent | None, key("s", "after which no round begins; null: no limit")] = (
        ABSENT
    )
    hit_distance: Annotated[float | Absent | None, key("scene units", "null: each scene's own")] = ABSENT
    max_steps: Annotated[int | Absent | None, key("evaluations", "null: each scene's own")] = ABSENT
    began: Annotated[str | Absent | None, key("UTC", "ISO 8601")] = ABSENT
    finished: Annotated[str | Absent | None, key("UTC", "ISO 8601; null: not yet")] = ABSENT
    phases: Annotated[
        dict[str, PhaseJson] | list[PhaseJson] | Absent | None,
        key("", "phase → its phase.json as it was"),
    ] = ABSENT
    binaries: Annotated[dict[str, str] | Absent, key("", "program → SHA-256")] = ABSENT
    configurations: Annotated[list[Configuration] | Absent | None, key("", "what is timed")] = ABSENT
    skipped: Annotated[list[dict[str, Any]] | Absent, key("", "what cannot run here; `reason`")] = ABSENT
    failures: Annotated[list[dict[str, Any]] | Absent, key("", "what crashed: `status`, `message`")] = ABSENT
    not_reached: Annotated[list[Any] | Absent, key("", "configurations the budget left out")] = ABSENT


class Frame(File, kw_only=True):
    """One timed frame. Analysis drops a line that was cut off in mid-write; the frame is measured again."""

    made_by: ClassVar[str] = "sweep"
    schema: Annotated[Literal[1] | Absent, key("", "version of the form")] = ABSENT
    config: Annotated[str, key("", "hash of what was asked for: program, scene, size, threads, overrides")]
    launch: Annotated[int, key("", "number of the process launch within this configuration", ge=0)]
    round: Annotated[
        Annotated[int, msgspec.Meta(ge=0)] | Absent,
        key("", "round of the sweep: every configuration once, in random order; launches are paired by it"),
    ] = ABSENT
    frame: Annotated[
        int, key("", "number in its launch, from 0; warm-up from −K to −1; or the animation's frame")
    ]
    warmup: Annotated[bool, key("", "a frame that no statistic uses")]
    first: Annotated[bool | Absent, key("", "the first of its process, warm-up or not")] = ABSENT
    phase: Annotated[str, key("", "the source tree")]
    flags_from: Annotated[str, key("", "the phase whose compiler flags built it; as a rule the same")]
    scene: Annotated[str, key("", "its name")]
    scene_hash: Annotated[str, key("", "64-bit FNV-1a of the canonical JSON with overrides")]
    width: Annotated[int, key("pixels", "of the picture", ge=1)]
    height: Annotated[int, key("pixels", "of the picture", ge=1)]
    threads: Annotated[int, key("threads", "that drew it", ge=1)]
    isa: Annotated[str, key("", "instruction sets of the code that ran")]
    precision: Annotated[str, key("", "float or double")]
    lanes: Annotated[int | Absent, key("lanes", "rays at once, of the variant that ran")] = ABSENT
    flags: Annotated[str, key("", "of the compiler")]
    compiler: Annotated[str, key("", "name and version")]
    libc: Annotated[str, key("", "version")]
    hit_distance: Annotated[float | Absent, key("scene units", "as used")] = ABSENT
    max_steps: Annotated[int | Absent, key("evaluations", "step cap, as used")] = ABSENT
    overridden: Annotated[bool | Absent | None, key("", "the command line changed one of the two")] = ABSENT
    ns: Annotated[
        int, key("ns", "wall time of `phase_render` (CLOCK_MONOTONIC_RAW), with an update before it", ge=1)
    ]
    update_ns: Annotated[int | Absent, key("ns", "`phase_update`'s share; 0 where nothing moves")] = ABSENT
    scene_time: Annotated[float | Absent, key("s", "where an animation is: frame/60")] = ABSENT
    tsc_cycles: Annotated[int, key("TSC cycles", "the same time by fenced RDTSC")]
    tsc_hz: Annotated[float, key("Hz", "TSC rate, calibrated in this process; 0: STEPWISE_UNTIMED")]
    core_hz_before: Annotated[float, key("Hz", "core clock right before the frame")]
    core_hz_after: Annotated[float, key("Hz", "core clock right after it")]
    core_hz_load: Annotated[
        float | Absent,
        key("Hz", "core clock under vector FMAs of the phase's width, once a process; 0: scalar"),
    ] = ABSENT
    core_cycles: Annotated[
        float, key("core cycles", "ns · mean(core_hz_before, core_hz_after) / 1e9: an estimate")
    ]
    prepare_ns: Annotated[int, key("ns", "set-up (`phase_prepare`), once a process")]
    image: Annotated[str | Absent | None, key("", "picture that was written; null: none")] = ABSENT
    settings: Annotated[
        str | Absent | None, key("", "what a phase did that is told how to work (STEPWISE_RODS …); else null")
    ] = ABSENT
    display: Annotated[
        str | Absent | None, key("", "who presents frames as displayed: `phase` or `driver`; else null")
    ] = ABSENT
    kernel: Annotated[
        str | Absent | None, key("", "`generated`, or `general: ` and why; null: the phase generates no code")
    ] = ABSENT
    kernel_hash: Annotated[str | Absent | None, key("", "its name in the cache")] = ABSENT
    kernel_compiler: Annotated[str | Absent | None, key("", "what compiled it")] = ABSENT
    kernel_generate_ns: Annotated[int | Absent | None, key("ns", "of prepare_ns: writing the source")] = (
        ABSENT
    )
    kernel_compile_ns: Annotated[
        int | Absent | None, key("ns", "of prepare_ns: compiling it, even if that failed; 0: in the cache")
    ] = ABSENT
    kernel_load_ns: Annotated[int | Absent | None, key("ns", "of prepare_ns: checking and loading it")] = (
        ABSENT
    )
    present_ns: Annotated[int, key("ns", "gamma and 8 bits of this frame, not in ns")]
    timer_overhead_cycles: Annotated[
        int | Absent, key("TSC cycles", "smallest difference of an empty pair of readings")
    ] = ABSENT
    steal_ticks: Annotated[
        int | Absent, key("1/100 s", "taken by the hypervisor from all CPUs meanwhile")
    ] = ABSENT
    ctx_voluntary: Annotated[int | Absent, key("switches", "voluntary, during the frame")] = ABSENT
    ctx_involuntary: Annotated[int | Absent, key("switches", "involuntary, during the frame")] = ABSENT
    faults_minor: Annotated[int | Absent, key("faults", "minor page faults during the frame")] = ABSENT
    faults_major: Annotated[int | Absent, key("faults", "major page faults during the frame")] = ABSENT
    max_rss_kib: Annotated[int | Absent, key("KiB", "peak resident memory of the process so far")] = ABSENT
    cpu: Annotated[int | Absent | None, key("", "CPU it was pinned to; −1: not pinned")] = ABSENT
    joules: Annotated[
        float | Absent | None,
        key(
            "J per frame",
            "at a process's last frame: energy of all packages (RAPL) from the end of its warm-up, or from "
            "its start if it had none, divided by its timed frames",
        ),
    ] = ABSENT
    env_bytes: Annotated[int | Absent, key("bytes", "padding of this launch's environment (layout bias)")] = (
        ABSENT
    )
    time: Annotated[str | Absent, key("UTC", "when the line was written; ISO 8601")] = ABSENT


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
    """What a quick study cut of each experiment. Without an entry the experiment is whole."""

    made_by: ClassVar[str] = "study"
    schema: Annotated[Literal[1] | Absent, key("", "version of the form")] = ABSENT
    cut: Annotated[dict[str, str], key("", "experiment → a sentence: what the run has of it")]


RUN_TOML = "run.toml"
STUDY = "study.json"
SCHEMAS = {"context.json": Context, "plan.json": Plan, "frames.jsonl": Frame}
