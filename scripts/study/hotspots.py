"""Functions by the time that they take in a frame: Tables 2 and 4 of the paper.

Two builds are sampled: `calls`, the same source without inlining, where every function of the source is one
of the program, as the paper had them; and `shipped`, the code that is timed, where inlined instructions are
told by the function they are from (DWARF 5, section 3.3.8). Only the timed frames count: see `in_frame`.
"""

from __future__ import annotations

import dataclasses
import math
import re
import statistics
import subprocess
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from elftools.common.exceptions import ELFError
from elftools.elf.elffile import ELFFile

from study import paper, perf, run, show, store
from study.build import build
from study.cli import StudyError
from study.decode import Disassembler
from study.registry import ROOT, Scene, Spec
from study.show import Column

TARGETS = {"calls": "render-calls", "shipped": "render-lines"}  # lines: the shipped code, told by line
OBJECTS = {"calls": "calls/phase.o", "shipped": "lines/phase.o"}
SHOWN = 10  # functions of a table, as many as the paper has
WRAPPER = 32  # bytes: a leaf of one or two instructions, such as a name for an intrinsic
REST = "other functions"
# A phase's own source, or an ablation's (build/NAME+TITLE/source), as addr2line writes it.
_PHASE_FILE = re.compile(r"(^|/)(phases/[^/]+|source)/[^/]+\.[ch]:")

Row = dict[str, Any]


# --- the program


@dataclass(frozen=True)
class Program:
    """An ELF file's functions (start, size, name) by address, those of the phase apart, and its segments."""

    path: Path
    functions: list[tuple[int, int, str]]
    of_phase: frozenset[int]  # starts
    segments: list[tuple[int, int, int]]  # offset in the file, address, bytes

    def address(self, offset: int) -> int | None:
        """The address (of the linker) at an offset in the file."""
        return next((a + offset - o for o, a, n in self.segments if o <= offset < o + n), None)

    def function(self, address: int) -> tuple[int, int, str] | None:
        low, high = 0, len(self.functions)
        while low < high:
            middle = (low + high) // 2
            low, high = (middle + 1, high) if self.functions[middle][0] <= address else (low, middle)
        found = self.functions[low - 1] if low else None
        return found if found and address < found[0] + found[1] else None


def _symbols(path: Path) -> tuple[list[tuple[int, int, str, str]], list[tuple[int, int, int]]]:
    """(start, size, name, file it is local to) of the functions, and the segments. StudyError without any."""
    try:
        with path.open("rb") as file:
            elf = ELFFile(file)
            segments = [
                (s["p_offset"], s["p_vaddr"], s["p_filesz"])
                for s in elf.iter_segments()
                if s["p_type"] == "PT_LOAD"
            ]
            table, found, source = elf.get_section_by_name(".symtab"), [], ""
            for symbol in table.iter_symbols() if table else ():
                kind, bind = symbol["st_info"]["type"], symbol["st_info"]["bind"]
                if kind == "STT_FILE":
                    source = symbol.name
                elif kind == "STT_FUNC" and symbol["st_shndx"] != "SHN_UNDEF":
                    local = source if bind == "STB_LOCAL" else ""
                    found.append((symbol["st_value"], symbol["st_size"], symbol.name, local))
    except OSError as error:
        raise StudyError(f"{path}: {error.strerror}") from None
    except ELFError as error:
        raise StudyError(f"{path}: no ELF file ({error})") from None
    if not found:
        raise StudyError(f"{path}: has no symbols (stripped?); remove it and build it again with make")
    return found, segments


def program(path: Path, phase_object: Path) -> Program:
    """Functions of `path`; those that are in `phase_object` too, by name and source file, are the phase's."""
    symbols, segments = _symbols(path)
    phase = {(name, local) for _, _, name, local in _symbols(phase_object)[0]}
    functions = sorted({(start, size, name) for start, size, name, _ in symbols if size})
    return Program(path, functions, frozenset(s[0] for s in symbols if (s[2], s[3]) in phase), segments)


def canonical(name: str, library: bool = False) -> str:
    """A symbol as the source has it: without versions, clones and, in libm, the choice of instruction set."""
    name = re.sub(r"@.*|\.(constprop|isra|part|cold|lto_priv|localalias)(\.\d+)*", "", name)
    if library:
        name = re.sub(r"_(fma4?|avx2?|avx512\w*|sse2|sse41|sse4_1|c)$", "", name)
        name = re.sub(r"^_+(ieee754_)?", "", name)
    return name


def wrappers(built: Program) -> set[str]:
    """Functions that are only a name for an instruction or two, where each is a function: they call nothing,
    or one such function. Inlined ones count to whoever uses them: a line of a table for them would say as
    much as one for `+`.
    """
    code, disassembler = built.path.read_bytes(), Disassembler()
    copies: dict[str, list[tuple[int, list[str]]]] = {}  # of each source file: bytes, and what is called
    for start, size, name in built.functions:
        offset = next((o + start - a for o, a, n in built.segments if a <= start < a + n), None)
        if start not in built.of_phase or offset is None:
            continue
        jumps = (one.target for one in disassembler.decode(code[offset : offset + size], start) if one.target)
        called = [found[2] if (found := built.function(to)) else "" for to in jumps]
        copies.setdefault(canonical(name), []).append((size, [canonical(other) for other in called]))
    leaves = {
        name for name, some in copies.items() if all(size <= WRAPPER and not calls for size, calls in some)
    }
    around = {
        name
        for name, some in copies.items()
        if all(size <= 2 * WRAPPER and len(calls) == 1 and calls[0] in leaves for size, calls in some)
    }
    return {name for name in leaves | around if not name.startswith("phase_")}


def inlined(binary: Path, addresses: Sequence[int]) -> dict[int, list[str]]:
    """Per address the phase's functions whose code it is, innermost first; none where addr2line fails."""
    chains: dict[int, list[str]] = {}
    if not addresses:
        return chains
    text = "\n".join(f"{address:#x}" for address in addresses)
    try:
        command = ["addr2line", "-a", "-f", "-i", "-e", str(binary)]
        done = subprocess.run(command, input=text, capture_output=True, text=True)
    except OSError:
        return chains
    return parse_addr2line(done.stdout) if done.returncode == 0 else chains


def parse_addr2line(text: str) -> dict[int, list[str]]:
    """Output of `addr2line -a -f -i`: an address, then pairs of function and place. Headers of the compiler
    are left out. Raises StudyError for other text.
    """
    chains: dict[int, list[str]] = {}
    chain: list[str] | None = None
    lines = iter(enumerate(text.splitlines(), 1))
    for number, line in lines:
        if line.startswith("0x"):
            try:
                chain = chains.setdefault(int(line, 16), [])
            except ValueError:
                raise StudyError(f"addr2line:{number}: no address: {line[:60]!r}") from None
            continue
        place = next(lines, None)
        if chain is None or place is None:
            raise StudyError(f"addr2line:{number}: cut off or of another form: {line[:60]!r}")
        if _PHASE_FILE.search(place[1]):
            chain.append(canonical(line))
    return chains


# --- what was sampled


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
        function = built.function(address) if address is not None else None
        if function is None:  # a stub that calls a library
            return Place("library", canonical(sample.name, True))
        kind = "phase" if function[0] in built.of_phase else "other"
        return Place(kind, canonical(function[2]), address)
    dso = Path(sample.dso)
    if re.match(r"libm[.-]", dso.name):
        return Place("libm", canonical(sample.name, True) if sample.name != "[unknown]" else "libm")
    if re.match(r"libc[.-]", dso.name):
        return Place("library", canonical(sample.name, True) if sample.name != "[unknown]" else "libc")
    return Place("other", sample.name if sample.name != "[unknown]" else dso.name)


def in_frame(kinds: Sequence[str]) -> list[bool]:
    """Which samples of a thread, in the order of time, are of a timed frame. The phase's own functions are;
    libm is if the driver's code is not on both sides of it; other libraries only between two of the phase.
    (Between frames the driver calibrates its clocks for some milliseconds, in its own code.)
    """
    certain = [kind == "phase" if kind in ("phase", "other") else None for kind in kinds]
    before, after = [], []
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


@dataclass
class Profile:
    """Samples of one build's timed frames.

    `functions`: name to samples and weight (events). `left_out`: what was not of a frame, by name.
    `frame_ns`: median wall time of the sampled frames. `cpu_ns`, `core_cycles`: what the samples stand for,
    per frame: time and cycles in which the process ran, however long it waited for the CPU. All of them
    with what sampling costs (some 5 %).
    `addresses`: weight per address of the phase's own code. `covered`: sampled time over timed time, 1 where
    all of it was seen.
    """

    phase: str
    flags_from: str
    variant: str
    scene: str
    width: int
    height: int
    event: str
    frames: int
    frame_ns: float
    cpu_ns: float
    core_cycles: float
    samples: int
    weight: int
    covered: float
    functions: dict[str, dict[str, int]]
    left_out: dict[str, int]
    addresses: dict[int, int] = field(default_factory=dict, repr=False)
    kernel: str | None = None  # of a phase that generates code for a scene: that it did not

    @property
    def spec(self) -> str:
        return str(Spec(self.phase, self.flags_from))

    def share(self, name: str) -> float:
        return self.functions[name]["weight"] / self.weight if name in self.functions else 0.0

    def to_json(self) -> Row:
        rows = []
        for name, found in sorted(self.functions.items(), key=lambda item: -item[1]["weight"]):
            share = self.share(name)
            low, high = wilson(share * self.samples, self.samples)
            rows.append(
                {
                    "function": name,
                    **found,
                    "share": share,
                    "share_low": low,
                    "share_high": high,
                    "seconds": share * self.cpu_ns / 1e9,
                }
            )
        data = {f.name: getattr(self, f.name) for f in dataclasses.fields(self) if f.name != "addresses"}
        return data | {"functions": rows}

    @classmethod
    def from_json(cls, data: Row) -> Profile:
        """Raises KeyError, TypeError or ValueError for another thing's JSON."""
        functions = {
            row["function"]: {"samples": row["samples"] + 0, "weight": row["weight"] + 0}
            for row in data["functions"]
        }
        made = cls(**{**data, "functions": functions})
        types = {"str": str, "int": int, "float": (int, float)}
        for one in dataclasses.fields(cls):
            value = getattr(made, one.name)
            if one.type in types and not isinstance(value, types[one.type]):
                raise TypeError(f"{one.name}: {value!r}")
        if made.variant not in TARGETS:
            raise ValueError(f"variant {made.variant!r}; there are {', '.join(TARGETS)}")
        for name in ("weight", "samples", "cpu_ns", "frames"):
            if not getattr(made, name) > 0:
                raise ValueError(f"{name}: {getattr(made, name)}, which is not positive")
        return made


def profile(
    recording: perf.Recording,
    made: Row,
    built: Program,
    variant: str,
    owner: Callable[[Place], str] | None = None,
) -> Profile:
    """Samples and the driver's JSON of the same process as a Profile. `owner` names the function that a
    place in the phase's code belongs to, where it is not the symbol.
    """
    threads: dict[int, list[perf.Sample]] = {}
    for sample in sorted(recording.samples, key=lambda s: s.time):
        threads.setdefault(sample.tid, []).append(sample)
    functions: dict[str, dict[str, int]] = {}
    left_out: Counter[str] = Counter()
    addresses: Counter[int] = Counter()
    located = {tid: [locate(recording, sample, built) for sample in some] for tid, some in threads.items()}
    libm = {place.name for places in located.values() for place in places if place.kind == "libm"}
    for tid, samples in threads.items():
        places = located[tid]
        for sample, place, inside in zip(samples, places, in_frame([p.kind for p in places]), strict=True):
            if not inside:
                left_out[place.name] += 1
                continue
            known_libm = place.kind == "libm" or (place.kind == "library" and place.name in libm)
            name = f"{place.name} ({'libm' if known_libm else 'library'})"
            if place.kind == "phase":
                addresses[place.address or 0] += sample.period
                name = owner(place) if owner else place.name
            found = functions.setdefault(name, {"samples": 0, "weight": 0})
            found["samples"] += 1
            found["weight"] += sample.period
    taken = sum(found["samples"] for found in functions.values())
    if not taken:
        raise StudyError(f"{built.path}: no sample in the timed frames; more frames (--samples) are required")
    frames = [frame for frame in made["frames"] if not frame["warmup"]]
    timed = sum(frame["ns"] for frame in frames)
    hz = statistics.median(frame["core_cycles"] / (frame["ns"] / 1e9) for frame in frames)
    weight = sum(found["weight"] for found in functions.values())
    event = recording.samples[0].event.split(":")[0]
    # perf's clock is in ns of running, the PMU's cycles are what they say.
    cycles = weight / len(frames) * (1.0 if event == "cycles" else hz / 1e9)
    return Profile(
        phase=made["phase"],
        flags_from=made["flags_from"],
        variant=variant,
        scene=made["scene"],
        width=made["width"],
        height=made["height"],
        event=event,
        frames=len(frames),
        frame_ns=statistics.median(frame["ns"] for frame in frames),
        cpu_ns=cycles / hz * 1e9,
        core_cycles=cycles,
        samples=taken,
        weight=weight,
        covered=taken / perf.FREQUENCY / (timed / 1e9),
        functions=functions,
        left_out=dict(left_out.most_common()),
        addresses=dict(addresses),
        kernel=made.get("kernel"),
    )


def _repetitions(spec: Spec, scene: Scene, height: int, width: int | None, target: str, samples: int) -> int:
    """Frames that make so many samples, by the time of one."""
    first = run.render(spec, scene.path, *reversed(scene.size(height, width)), target=target)
    return max(1, min(1000, math.ceil(samples / perf.FREQUENCY / (first["frames"][0]["ns"] / 1e9))))


def measure(
    spec: Spec,
    scene: Scene,
    height: int,
    width: int | None = None,
    variant: str = "calls",
    samples: int = 3000,
    cpu: int | None = None,
) -> Profile:
    """Samples build/SPEC/render-calls or -lines until there are some `samples` of its timed frames."""
    target = TARGETS[variant]
    binary = build(spec, target)
    folder = ROOT / "build" / str(spec)
    built = program(binary, folder / OBJECTS[variant])
    reps = _repetitions(spec, scene, height, width, target, samples)
    recording, made = perf.record(spec, scene, height, width, reps, target, cpu)
    owner = None
    if variant == "shipped":
        named = wrappers(program(build(spec, TARGETS["calls"]), folder / OBJECTS["calls"]))
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


# --- tables


def per_cycle(profile: Profile, instructions: dict[str, int]) -> dict[str, float]:
    """Instructions per core cycle by function: counted instructions of a frame over sampled cycles. Under 30
    samples the quotient says nothing and is left out.
    """
    found = {}
    for name, count in instructions.items():
        taken = profile.functions.get(name)
        if taken and taken["samples"] >= 30 and profile.core_cycles > 0:
            found[name] = count / (profile.share(name) * profile.core_cycles)
    return found


def lanes_active(by_function: Row) -> dict[str, float]:
    """Useful over executed operations by function, of the counting build's JSON."""
    return {
        name: found["useful"] / found["machine"]
        for name, found in by_function.items()
        if found.get("machine")
    }


def theirs(phase: str) -> dict[str, Row]:
    """The paper's rows of a phase by function, as it is called here; `share` is of its ten rows' time."""
    table = paper.read("hotspots")
    rows = table[table["phase"] == phase].to_dict("records")
    total = sum(row["cpu_time_s"] for row in rows)
    return {
        row["function"].lstrip("_"): {
            "paper_seconds": row["cpu_time_s"],
            "paper_share": row["cpu_time_s"] / total,
            "paper_usage": row["usage_percent"] / 100,
            "paper_source": row["source"],
        }
        for row in rows
    }


# Golden Cove and its kin take in six operations a cycle: Intel, 64 and IA-32 Architectures Optimization
# Reference Manual; so do Zen 2 to Zen 4: AMD, Software Optimization Guides for families 17h and 19h. A fused
# pair is one operation: what is a little above six is left out with the rest.
_SIX_WIDE = ("Alder Lake", "Raptor Lake", "Meteor Lake")
_SIX_WIDE += ("Sapphire Rapids", "Emerald Rapids", "Granite Rapids", "Zen 2", "Zen 3", "Zen 4")
WIDEST = 8  # AMD, Software Optimization Guide for the Zen5 Microarchitecture; no x86 core here is wider


def core_width(microarchitecture: str | None) -> int:
    """Of a core by study.machine's name for it, in operations per cycle; the widest for any other."""
    return 6 if microarchitecture in _SIX_WIDE else WIDEST


def table_rows(record: Row, shown: int = SHOWN, widest: int = WIDEST) -> list[Row]:
    """Rows of Tables 2 and 4 from a run's hotspots.json: per phase the `shown` functions of the most time,
    those of the paper, and the rest, so that each column sums to the frame. Quotients of instructions over
    core cycles above `widest` are left out: no core does that, the samples are another function's.
    """
    profiles = [Profile.from_json(one) for one in record["profiles"]]
    rows = []
    for one in dict.fromkeys((p.scene, p.spec, p.width, p.height) for p in profiles):
        by = {p.variant: p for p in profiles if (p.scene, p.spec, p.width, p.height) == one}
        first = by.get("shipped") or by["calls"]
        stated = theirs(first.phase) if first.scene == "scene0" else {}
        names = sorted(first.functions, key=lambda name: -first.share(name))[:shown]
        plain = {re.sub(r" \(libm\)$", "", name): name for name in first.functions}
        names += [
            plain[name]
            for name in stated
            if name in plain and plain[name] not in names and first.share(plain[name])
        ]
        extra = record.get("beside", {}).get("|".join(map(str, one)), {})
        about = {"scene": one[0], "phase": one[1], "width": one[2], "height": one[3]}
        for name in names:
            rows.append(
                about
                | {"function": name}
                | _cells(by, [name])
                | {"per_cycle": _possible(extra.get("per_cycle", {}).get(name), widest)}
                | {"lanes_active": extra.get("lanes_active", {}).get(name)}
                | stated.get(re.sub(r" \(libm\)$", "", name), {})
            )
        rest = {name for p in by.values() for name in p.functions} - set(names)
        rows.append(about | {"function": f"{REST} ({len(rest)})"} | _cells(by, sorted(rest)))
        shown_names = {re.sub(r" \(libm\)$", "", name) for name in names}
        rows += [
            about | {"function": name} | cells for name, cells in stated.items() if name not in shown_names
        ]
    return rows


def _possible(per_cycle: float | None, widest: int) -> float | None:
    return per_cycle if per_cycle is not None and per_cycle <= widest else None


def _cells(by: dict[str, Profile], names: Sequence[str]) -> Row:
    """Time, share in per cent with its interval, and samples of functions together, per build."""
    cells: Row = {}
    for variant, one in by.items():
        share = sum(one.share(name) for name in names)
        low, high = wilson(share * one.samples, one.samples)
        cells |= {
            f"{variant}_seconds": share * one.cpu_ns / 1e9,
            f"{variant}_percent": 100 * share,
            f"{variant}_percent_low": 100 * low,
            f"{variant}_percent_high": 100 * high,
            f"{variant}_samples": sum(one.functions[n]["samples"] for n in names if n in one.functions),
        }
    return cells


def _share(variant: str) -> Callable[[Row], str]:
    """`12.3 [11.0, 13.7]`; nothing where the build has no such function."""

    def text(row: Row) -> str:
        if row.get(f"{variant}_percent") is None or not row.get(f"{variant}_samples"):
            return show.NOTHING
        value, low, high = (row[f"{variant}_percent{end}"] for end in ("", "_low", "_high"))
        return f"{value:.1f} [{low:.1f},\u00a0{high:.1f}]"

    return text


def _seconds(variant: str) -> Callable[[Row], str]:
    name = f"{variant}_seconds"
    return lambda row: show.number(row.get(name) or None, 3)


COLUMNS = [
    Column("", "scene", show.word("scene")),
    Column("", "phase", show.word("phase")),
    Column("", "size", lambda r: f"{r['width']}×{r['height']}"),
    Column("", "function", show.word("function")),
    Column("shipped build", "s a frame", _seconds("shipped")),
    Column("shipped build", "% of the frame [95\u00a0%]", _share("shipped")),
    Column("without inlining", "s a frame", _seconds("calls")),
    Column("without inlining", "% of the frame [95\u00a0%]", _share("calls")),
    Column("without inlining", "instructions/core cycle, counted/sampled", show.plain("per_cycle", 2)),
    Column("", "lanes at useful work", lambda r: show.percent(r.get("lanes_active"))),
    Column("the paper", "s", show.plain("paper_seconds")),
    Column("the paper", "% of its ten rows", lambda r: show.number(_hundred(r.get("paper_share")))),
    Column("the paper", "microarchitecture usage", lambda r: show.percent(r.get("paper_usage"))),
]


ABOUT = """CPU time of one frame while it is sampled. “Shipped build”: the code that is timed, inlined code
counted to the function of the source that it is from. “Without inlining”: every function a function, as
the paper's were, at the price of the calls: where that frame takes much longer than the shipped one's, its
shares are those of another program. Shares sum to the frame. A sample is at the instruction that was about
to retire: waiting for a result shows where it is used, so that a small function can seem to run more
instructions per cycle than it does, and the next one fewer; what would be more than the core takes in (6 a
cycle of Intel's Golden Cove and its kin and of AMD's Zen 2 to Zen 4, else 8, as Zen 5) is not shown. The
paper's seconds are of another machine and size, its share is of the ten functions that it lists, and its
usage is VTune's.
"""


def _hundred(share: float | None) -> float | None:
    return None if share is None else 100 * share


def notes(record: Row) -> list[str]:
    """What was sampled, and what was left out, one line per build."""
    lines = []
    for data in record["profiles"]:
        p = Profile.from_json(data)
        out = sum(p.left_out.values())
        most = ", ".join(list(p.left_out)[:3])
        lines.append(
            f"{p.scene} {p.spec}, {'without inlining' if p.variant == 'calls' else 'shipped'}"
            + (", its general code, no kernel generated for the scene: " if p.kernel else ": ")
            + f"{p.samples} samples ({p.event}) of {p.frames} frames of {p.cpu_ns / 1e6:.4g} ms"
            + (f" (in {p.frame_ns / 1e6:.4g} ms: the CPU was shared); " if p.covered < 0.9 else "; ")
            + f"{out} ({100 * out / (p.samples + out):.1f} %) left out as not of a frame"
            + (f" ({most}{' …' if len(p.left_out) > 3 else ''})" if out else "")
        )
    return lines


def read(path: Path) -> Row:
    """A run's hotspots.json, or an empty record. Raises StudyError for another thing's JSON."""
    if not path.exists():
        return {"schema": 1, "profiles": [], "beside": {}, "bounds": []}
    record = store.read_json(path)
    try:
        for one in record["profiles"]:
            Profile.from_json(one)
        for name, kind in (("profiles", list), ("bounds", list), ("beside", dict)):
            if not isinstance(record.get(name, kind()), kind):
                raise TypeError(f"{name}: {record[name]!r}")
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise StudyError(
            f"{path}: no hotspots ({error}); remove it and make them with scripts/hotspots.py --run"
        ) from None
    return record


def merge(old: Row, new: Row) -> Row:
    """Both records; what was measured again replaces the older one."""

    def together(name: str, keys: Sequence[str]) -> list[Row]:
        several = [*old.get(name, []), *new.get(name, [])]
        return [*{tuple(one.get(key) for key in keys): one for one in several}.values()]

    which = ("phase", "flags_from", "scene", "width", "height")
    return {
        "schema": 1,
        "profiles": together("profiles", (*which, "variant")),
        "beside": {**old.get("beside", {}), **new.get("beside", {})},
        "bounds": together("bounds", which),
    }
