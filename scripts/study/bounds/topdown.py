"""What bounds the hot code: Table 3 of the paper, a top-down split by a model.

The model takes the regions of the shipped code that samples fall into (innermost loops, and what is in no
loop, per function: bounds.regions), and asks llvm-mca (bounds.mca) what their instructions need.

It sees a region as a straight line, every load a hit in L1, every branch known and every instruction there
in time: no front end, no branch misses, no cache, nothing of what a call does inside or of what the line's
branches would leave out. Retiring, core and memory are therefore of the cycles that the model knows.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence

from study.bounds import mca
from study.bounds.profiles import Sampled
from study.bounds.regions import LEAST, assembly, regions
from study.bounds.schema import Bound, Compared, Profiled, Region, Split
from study.core import machine
from study.core.cli import StudyError
from study.counting.elf import Program
from study.counting.schema import named


def _modelled_regions(
    sampled: Sampled, built: Program, cpu: mca.Model | None, say: Callable[[str], None]
) -> list[Region]:
    """The regions that hold time, by llvm-mca if there is one.

    What it refuses is said once, with the number of its regions and their share of the time.
    """
    made = []
    refused: dict[str, list[float]] = {}  # error → shares
    for region in regions(sampled, built):
        if region.share < LEAST:
            break
        text = assembly(region.lines)
        one = Region(
            region=region.name,
            function=region.function,
            loop=region.loop,
            share=region.share,
            instructions=sum(line.startswith("\t") for line in text.splitlines()),
            calls=sum(line.is_call for line in region.lines),
        )
        made.append(one)
        try:
            if cpu and one.instructions:
                one.mca = mca.run(text, cpu)
        except StudyError as error:
            refused.setdefault(str(error), []).append(region.share)
    for error, shares in refused.items():
        text = f"({len(shares)} of {len(made)} regions, {sum(shares):.0%} of the time)"
        say(f"{sampled.profile.spec}: {error} {text}")
    return made


def model(
    sampled: Sampled,
    built: Program,
    instructions: Mapping[str, int] | None = None,
    say: Callable[[str], None] = lambda line: None,
) -> Bound:
    """The modelled split of a shipped build's samples, and its hot regions.

    `instructions`: of one frame by function of the program, counted; without them no time is predicted.
    """
    profile, cpu = sampled.profile, mca.model()
    if cpu is None:
        say(mca.MISSING)
    rows = _modelled_regions(sampled, built, cpu, say)
    modelled = [one for one in rows if one.mca]
    _measure(profile, rows, instructions or {})
    return Bound(
        **named(profile),
        by="model",
        processor=machine.cpu().microarchitecture,
        model=cpu.name if cpu else None,
        remark=f"LLVM does not know this processor: modelled as {cpu.cpu}" if cpu and cpu.guessed else None,
        covered=sum(one.share for one in modelled),
        split=_split(modelled),
        cpu_ns=profile.cpu_ns,
        samples=profile.samples,
        compared=_prediction(profile, modelled, instructions or {}),
        regions=rows,
    )


def _split(modelled: Sequence[Region]) -> Split | None:
    if not (covered := sum(one.share for one in modelled)):
        return None

    def mean(name: str) -> float:
        return sum(one.share * getattr(one.mca.split, name) for one in modelled if one.mca) / covered

    return Split(**{name: mean(name) for name in ("retiring", "memory", "core", "ports", "dependencies")})


def _cycles(rows: Iterable[Region], count: int, bound: str) -> float:
    """Cycles of so many instructions of regions, where each has its share of the time."""
    rows = [one for one in rows if one.mca]
    rate = sum(one.share * one.instructions / getattr(one.mca, bound) for one in rows)
    return count * sum(one.share for one in rows) / rate


def _prediction(profile: Profiled, rows: Sequence[Region], counted: Mapping[str, int]) -> Compared | None:
    """Cycles of the modelled functions by the model and as measured; counted instructions are needed."""
    functions = [name for name in dict.fromkeys(one.function for one in rows) if counted.get(name)]
    if not functions:
        return None
    mine = {name: [one for one in rows if one.function == name] for name in functions}
    share = sum(one.share for several in mine.values() for one in several)
    return Compared(
        share=share,
        throughput=sum(_cycles(mine[name], counted[name], "throughput") for name in functions),
        latency=sum(_cycles(mine[name], counted[name], "latency") for name in functions),
        measured=share * profile.core_cycles,
    )


def _measure(profile: Profiled, rows: Sequence[Region], counted: Mapping[str, int]) -> None:
    """Gives each region the measured cycles of a pass: its function's cycles per counted instruction times
    its instructions. Right where the function's regions run at one rate; left out without counts.
    """
    for one in rows:
        if count := counted.get(one.function):
            mine = sum(other.share for other in rows if other.function == one.function)
            one.measured = mine * profile.core_cycles / count * one.instructions
