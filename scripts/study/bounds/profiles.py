"""Samples of a program's timed frames, by function.

Two builds are sampled: `calls`, the same source without inlining, where every function of the source is one
of the program, as the paper had them; and `shipped`, the code that is timed, where inlined instructions are
told by the function they are from. Only the timed frames count: see `in_frame`.
"""

import math
import statistics
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import msgspec

from study.bounds.schema import Profiled, Share
from study.core import run
from study.core.build import build
from study.core.cli import StudyError
from study.core.registry import ROOT, Scene, Spec
from study.counting import elf, perf
from study.counting.elf import Program, canonical, inlined, wrappers
from study.counting.schema import named

TARGETS = {"calls": "render-calls", "shipped": "render-lines"}  # lines: the shipped code, told by line
OBJECTS = {"calls": "calls/phase.o", "shipped": "lines/phase.o"}


class Frame(msgspec.Struct):
    ns: float
    core_cycles: float
    warmup: bool = False


class Driven(msgspec.Struct):
    """The picture and its frames, of what the driver prints."""

    phase: str
    flags_from: str
    scene: str
    width: int
    height: int
    frames: list[Frame]
    kernel: str | None = None


@dataclass
class Place:
    """Where a sample is: `kind` is phase, libm, library or other; `address` only in the program itself."""

    kind: str
    name: str
    address: int | None = None


def locate(recording: perf.Recording, sample: perf.Sample, built: Program) -> Place:
    where = recording.place(sample)
    if where and Path(where[0]).name == built.path.name:
        address = built.address(where[1])
        function = built.function_at(address) if address is not None else None
        if function is None:  # a stub that calls a library
            return Place("library", canonical(sample.name, True))
        kind = "phase" if function.start in built.of_phase else "other"
        return Place(kind, canonical(function.name), address)
    dso, known = Path(sample.dso).name, sample.name != "[unknown]"
    for kind, library in (("libm", "libm"), ("library", "libc")):
        if dso.startswith((f"{library}.", f"{library}-")):
            return Place(kind, canonical(sample.name, True) if known else library)
    return Place("other", sample.name if known else dso)


def in_frame(kinds: Sequence[str]) -> list[bool]:
    """Which samples of a thread, in the order of time, are of a timed frame. The phase's own functions are;
    libm is if the driver's code is not on both sides of it; other libraries only between two of the phase.
    (Between frames the driver calibrates its clocks for some milliseconds, in its own code.)
    """
    certain = [kind == "phase" if kind in ("phase", "other") else None for kind in kinds]
    before: list[bool] = []
    after: list[bool] = []
    for known, seen in ((certain, before), (certain[::-1], after)):
        last = False
        for one in known:
            last = last if one is None else one
            seen.append(last)
    both = zip(kinds, certain, before, after[::-1], strict=True)
    return [one if one is not None else (b or a) if kind == "libm" else (b and a) for kind, one, b, a in both]


def wilson(part: float, of: float) -> tuple[float, float]:
    """95 % interval of a share (E. B. Wilson, J. Am. Stat. Assoc. 22 (1927)); of nothing: (nan, nan)."""
    if of <= 0:
        return math.nan, math.nan
    z, p = 1.959964, part / of
    middle = (p + z * z / (2 * of)) / (1 + z * z / of)
    half = z * math.sqrt(p * (1 - p) / of + z * z / (4 * of * of)) / (1 + z * z / of)
    return max(middle - half, 0.0), min(middle + half, 1.0)


@dataclass(frozen=True)
class Sampled:
    """Samples of one build's timed frames; `addresses`: weight per address of the phase's own code.

    Times and cycles are what the samples stand for, per frame: those in which the process ran, however long
    it waited for the CPU, with what sampling costs (some 5 %).
    """

    profile: Profiled
    addresses: dict[int, int]


def profile(
    recording: perf.Recording,
    made: dict[str, Any],
    built: Program,
    variant: Literal["shipped", "calls"],
    owner: Callable[[Place], str] | None = None,
) -> Sampled:
    """Samples and the driver's JSON of the same process. `owner` names the function that a place in the
    phase's code belongs to, where it is not the symbol.
    """
    threads: dict[int, list[perf.Sample]] = {}
    for sample in sorted(recording.samples, key=lambda s: s.time):
        threads.setdefault(sample.tid, []).append(sample)
    samples: Counter[str] = Counter()
    weights: Counter[str] = Counter()
    left_out: Counter[str] = Counter()
    addresses: Counter[int] = Counter()
    located = {tid: [locate(recording, sample, built) for sample in some] for tid, some in threads.items()}
    libm = {place.name for places in located.values() for place in places if place.kind == "libm"}
    for tid, places in located.items():
        inside = in_frame([place.kind for place in places])
        for sample, place, timed in zip(threads[tid], places, inside, strict=True):
            if not timed:
                left_out[place.name] += 1
                continue
            known_libm = place.kind == "libm" or (place.kind == "library" and place.name in libm)
            name = f"{place.name} ({'libm' if known_libm else 'library'})"
            if place.kind == "phase":
                addresses[place.address or 0] += sample.period
                name = owner(place) if owner else place.name
            samples[name] += 1
            weights[name] += sample.period
    if not samples:
        raise StudyError(f"{built.path}: no sample in the timed frames; more frames (--samples) are required")
    driven = msgspec.convert(made, Driven)
    frames = [frame for frame in driven.frames if not frame.warmup]
    timed_ns = sum(frame.ns for frame in frames)
    hz = statistics.median(frame.core_cycles / (frame.ns / 1e9) for frame in frames)
    weight, taken = weights.total(), samples.total()
    event = recording.samples[0].event.split(":")[0]
    # perf's clock is in ns of running, the PMU's cycles are what they say.
    cycles = weight / len(frames) * (1.0 if event == "cycles" else hz / 1e9)
    cpu_ns = cycles / hz * 1e9
    functions = []
    for name, n in weights.most_common():
        low, high = wilson(n / weight * taken, taken)
        about = {
            "share": n / weight,
            "share_low": low,
            "share_high": high,
            "seconds": n / weight * cpu_ns / 1e9,
        }
        functions.append(Share(function=name, samples=samples[name], weight=n, **about))
    profiled = Profiled(
        **named(driven),
        kernel=driven.kernel,
        variant=variant,
        event=event,
        frames=len(frames),
        frame_ns=statistics.median(frame.ns for frame in frames),
        cpu_ns=cpu_ns,
        core_cycles=cycles,
        samples=taken,
        weight=weight,
        covered=taken / perf.FREQUENCY / (timed_ns / 1e9),
        functions=functions,
        left_out=dict(left_out.most_common()),
    )
    return Sampled(profiled, dict(addresses))


def _repetitions(spec: Spec, scene: Scene, height: int, width: int | None, target: str, samples: int) -> int:
    first = run.render(spec, scene.path, *reversed(scene.size(height, width)), target=target)
    seconds = msgspec.convert(first, Driven).frames[0].ns / 1e9
    return max(1, min(1000, math.ceil(samples / perf.FREQUENCY / seconds)))


def measure(
    spec: Spec,
    scene: Scene,
    height: int,
    width: int | None = None,
    variant: Literal["shipped", "calls"] = "calls",
    samples: int = 3000,
    cpu: int | None = None,
) -> Sampled:
    """Samples build/SPEC/render-calls or -lines until there are some `samples` of its timed frames."""
    target = TARGETS[variant]
    binary = build(spec, target)
    folder = ROOT / "build" / str(spec)
    built = elf.read(binary, folder / OBJECTS[variant])
    reps = _repetitions(spec, scene, height, width, target, samples)
    recording, made = perf.record(spec, scene, height, width, reps, target, cpu)
    owner = None
    if variant == "shipped":
        named = wrappers(elf.read(build(spec, TARGETS["calls"]), folder / OBJECTS["calls"]))
        owner = owners(recording, built, named)
    return profile(recording, made, built, variant, owner)


def owners(recording: perf.Recording, built: Program, folded: Iterable[str]) -> Callable[[Place], str]:
    """Names the source's function of an address: the innermost inlined one that is not in `folded`."""
    places = [locate(recording, sample, built) for sample in recording.samples]
    chains = inlined(built.path, sorted({p.address for p in places if p.kind == "phase" and p.address}))
    names = set(folded)

    def owner(place: Place) -> str:
        chain = chains.get(place.address or 0, [])
        return next((name for name in chain if name not in names), chain[-1] if chain else place.name)

    return owner
