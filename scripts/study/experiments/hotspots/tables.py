"""Functions by the time that they take in a frame: Tables 2 and 4 of the paper, from bounds.profiles."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from study.bounds.profiles import Profile, wilson
from study.core import machine, show
from study.core.show import Column
from study.experiments.hotspots.schema import Hotspots
from study.numbers import paper

SHOWN = 10  # functions of a table, as many as the paper has
REST = "other functions"

Row = dict[str, Any]


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
_SIX_WIDE += (*machine.AMX, machine.SOME_AMX, "Zen 2", "Zen 3", "Zen 4")
WIDEST = 8  # AMD, Software Optimization Guide for the Zen5 Microarchitecture; no x86 core here is wider


def core_width(microarchitecture: str | None) -> int:
    """Of a core by study.core.machine's name for it, in operations per cycle; the widest for any other."""
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


ABOUT = (
    "“Without inlining”: every function a function, as the paper's were, at the price of the calls.\n"
    "A sample is at the instruction that was about to retire: waiting for a result shows where it is used. "
    "More instructions per cycle than the core takes in are not shown."
)


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
    return Hotspots.read_if_there(path) or {"schema": 1, "profiles": [], "beside": {}, "bounds": []}


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
