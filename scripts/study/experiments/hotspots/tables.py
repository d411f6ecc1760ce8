"""Functions by the time that they take in a frame: Tables 2 and 4 of the paper, from bounds.profiles."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import msgspec

from study.bounds.profiles import wilson
from study.bounds.schema import Beside, Hotspots, Profiled
from study.core import machine, show
from study.core.show import Column, cell
from study.counting.schema import Function
from study.numbers import paper

SHOWN = 10  # functions of a table, as many as the paper has
REST, LIBM = "other functions", " (libm)"


@dataclass(frozen=True)
class Row:
    """A function; of each build its time, share in per cent with its interval, and samples. `paper_share` is
    of the paper's ten rows' time."""

    scene: str
    phase: str
    width: int
    height: int
    function: str
    shipped_seconds: float | None = None
    shipped_percent: float | None = None
    shipped_percent_low: float | None = None
    shipped_percent_high: float | None = None
    shipped_samples: int | None = None
    calls_seconds: float | None = None
    calls_percent: float | None = None
    calls_percent_low: float | None = None
    calls_percent_high: float | None = None
    calls_samples: int | None = None
    per_cycle: float | None = None
    lanes_active: float | None = None
    paper_seconds: float | None = None
    paper_share: float | None = None
    paper_usage: float | None = None
    paper_source: str | None = None


def per_cycle(profile: Profiled, instructions: Mapping[str, int]) -> dict[str, float | None]:
    """Instructions per core cycle by function: counted instructions of a frame over sampled cycles. Under 30
    samples the quotient says nothing and is left out.
    """
    return {
        one.function: instructions[one.function] / (one.weight / profile.weight * profile.core_cycles)
        for one in profile.functions
        if one.function in instructions and one.samples >= 30
    }


def lanes_active(by_function: Mapping[str, Function], lanes: int) -> dict[str, float | None]:
    """Useful over executed operations by function, of the counting build; undeclared: of lanes."""
    found: dict[str, float | None] = {}
    for name, one in by_function.items():
        useful, executed = (one.useful, one.machine) if one.machine else (one.lanes, one.calls * lanes)
        if executed:
            found[name] = useful / executed
    return found


def theirs(phase: str) -> dict[str, dict[str, Any]]:
    """The paper's cells of a phase's rows, by function, as it is called here."""
    table = paper.read("hotspots")
    rows = list(table[table.phase == phase].itertuples())
    total = sum(row.cpu_time_s for row in rows)
    return {
        row.function.lstrip("_"): {
            "paper_seconds": row.cpu_time_s,
            "paper_share": row.cpu_time_s / total,
            "paper_usage": row.usage_percent / 100,
            "paper_source": row.source,
        }
        for row in rows
    }


# Golden Cove and its kin take in six operations a cycle: Intel, 64 and IA-32 Architectures Optimization
# Reference Manual; so do Zen 2 to Zen 4: AMD, Software Optimization Guides for families 17h and 19h. A fused
# pair is one operation: what is a little above six is left out with the rest.
_SIX_WIDE = {"Alder Lake", "Raptor Lake", "Meteor Lake", *machine.AMX, machine.SOME_AMX}
_SIX_WIDE |= {"Zen 2", "Zen 3", "Zen 4"}
WIDEST = 8  # AMD, Software Optimization Guide for the Zen5 Microarchitecture; no x86 core here is wider


def core_width(microarchitecture: str | None) -> int:
    """Operations per cycle of a core by study.core.machine's name for it; the widest for any other."""
    return 6 if microarchitecture in _SIX_WIDE else WIDEST


def table_rows(record: Hotspots, shown: int = SHOWN, widest: int = WIDEST) -> list[Row]:
    """Rows of Tables 2 and 4 from a run's hotspots.json: per phase the `shown` functions of the most time,
    those of the paper, and the rest, so that each column sums to the frame. Quotients of instructions over
    core cycles above `widest` are left out: no core does that, the samples are another function's.
    """
    rows = []
    for which in dict.fromkeys(one.picture for one in record.profiles):
        by = {one.variant: one for one in record.profiles if one.picture == which}
        first = by.get("shipped") or by["calls"]
        stated = theirs(first.phase) if first.scene == "scene0" else {}
        order = sorted(first.functions, key=lambda one: -one.weight)
        names = [one.function for one in order[:shown]]
        left = {one.function.removesuffix(LIBM): one.function for one in order[shown:] if one.weight}
        names += [left[name] for name in stated if name in left]
        beside = record.beside.get("|".join(map(str, which)), Beside(per_cycle={}, lanes_active={}))
        for name in names:
            quotient = beside.per_cycle.get(name)
            more = stated.get(name.removesuffix(LIBM), {}) | {"lanes_active": beside.lanes_active.get(name)}
            if quotient is not None and quotient <= widest:
                more |= {"per_cycle": quotient}
            rows.append(replace(_cells(which, name, by, [name]), **more))
        rest = {one.function for profile in by.values() for one in profile.functions} - set(names)
        rows.append(_cells(which, f"{REST} ({len(rest)})", by, rest))
        shown_names = {name.removesuffix(LIBM) for name in names}
        rows += [Row(*which, name, **one) for name, one in stated.items() if name not in shown_names]
    return rows


def _cells(
    which: tuple[str, str, int, int], title: str, by: Mapping[str, Profiled], names: Collection[str]
) -> Row:
    row = Row(*which, title)
    for variant, one in by.items():
        share, samples = one.share_of(names), one.samples_of(names)
        low, high = wilson(share * one.samples, one.samples)
        values = (share * one.cpu_ns / 1e9, 100 * share, 100 * low, 100 * high, samples)
        fields = ("seconds", "percent", "percent_low", "percent_high", "samples")
        cells = {f"{variant}_{name}": value for name, value in zip(fields, values, strict=True)}
        row = replace(row, **cells)
    return row


def _share(variant: str) -> Callable[[Row], str]:
    """`12.3 [11.0, 13.7]`; nothing where the build has no such function."""

    def text(row: Row) -> str:
        value, low, high = (cell(row, f"{variant}_percent{end}") for end in ("", "_low", "_high"))
        if value is None or not cell(row, f"{variant}_samples"):
            return show.NOTHING
        return f"{value:.1f} [{low:.1f},\u00a0{high:.1f}]"

    return text


def _build(group: str, variant: str) -> list[Column]:
    return [
        Column(group, "s a frame", lambda r: show.number(cell(r, f"{variant}_seconds") or None, 3)),
        Column(group, "% of the frame [95\u00a0%]", _share(variant)),
    ]


def _paper_percent(row: Row) -> str:
    return show.number(None if row.paper_share is None else 100 * row.paper_share)


PER_CYCLE = "instructions/core cycle, counted/sampled"
COLUMNS = [
    Column("", "scene", show.word("scene")),
    Column("", "phase", show.word("phase")),
    Column("", "size", lambda r: f"{r.width}×{r.height}"),
    Column("", "function", show.word("function")),
    *_build("shipped build", "shipped"),
    *_build("without inlining", "calls"),
    Column("without inlining", PER_CYCLE, show.plain("per_cycle", 2)),
    Column("", "lanes at useful work", lambda r: show.percent(r.lanes_active)),
    Column("the paper", "s", show.plain("paper_seconds")),
    Column("the paper", "% of its ten rows", _paper_percent),
    Column("the paper", "microarchitecture usage", lambda r: show.percent(r.paper_usage)),
]


ABOUT = (
    "“Without inlining”: every function a function, as the paper's were, at the price of the calls.\n"
    "A sample is at the instruction that was about to retire: waiting for a result shows where it is used. "
    "More instructions per cycle than the core takes in are not shown."
)


def notes(record: Hotspots) -> list[str]:
    """What was sampled, and what was left out, one line per build."""
    lines = []
    for one in record.profiles:
        out, build = sum(one.left_out.values()), "without inlining" if one.variant == "calls" else "shipped"
        general = ", its general code, no kernel generated for the scene" if one.kernel else ""
        lines.append(
            f"{one.scene} {one.spec}, {build}{general}: {one.samples} samples ({one.event}) of {one.frames} "
            f"frames of {one.cpu_ns / 1e6:.4g} ms (in {one.frame_ns / 1e6:.4g} ms); {out} "
            f"({100 * out / (one.samples + out):.1f} %) left out as not of a frame"
        )
    return lines


def merge(old: Hotspots, new: Hotspots) -> Hotspots:
    """Both records; what was measured again replaces the older one."""
    profiles = {(*one.picture, one.variant): one for one in [*old.profiles, *new.profiles]}
    bounds = {(one.scene, one.spec, one.width, one.height): one for one in [*old.bounds, *new.bounds]}
    both = {"profiles": [*profiles.values()], "bounds": [*bounds.values()]}
    return msgspec.structs.replace(old, beside=old.beside | new.beside, **both)


def top(rows: Sequence[Row], phase: str, most: int) -> tuple[str, list[Row]]:
    """The build that is shown of a phase (as it is shipped, where that was sampled) and its functions of most
    time, on the first scene that it was sampled on."""
    mine = [row for row in rows if row.phase == phase and not row.function.startswith(REST)]
    mine = [row for row in mine if row.scene == mine[0].scene]
    build = "shipped" if any(row.shipped_percent for row in mine) else "calls"
    found = sorted(mine, key=lambda row: -(cell(row, f"{build}_percent") or 0.0))
    return build, [row for row in found if cell(row, f"{build}_percent")][:most]
