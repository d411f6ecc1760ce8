"""The table of a run of programs that are no phases: times, ratios, verdicts; and hyperfine's JSON of it."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from study.core import show
from study.core.run_schema import Plan, Program
from study.core.store import Run
from study.numbers import modes, noise, sequential, stats
from study.numbers.analysis import Cell
from study.numbers.modes import Modes
from study.numbers.stats import Interval

FASTER, SLOWER, FEW = "faster", "slower", "unknown (too few launches)"
UNSURE, TWO_MODES = "not told apart", "no verdict (two modes)"
ENOUGH = 10  # launches; with fewer that nothing interrupted, all count
DISTINCT = 5  # times; fewer are those of a coarse clock
COLUMNS = [("program", "program"), ("case", "case"), ("launches", "launches"), ("ms", "ms [95 %]")]
COLUMNS += [("cpu_ms", "CPU ms"), ("mib", "peak MiB")]
COLUMNS += [("instructions", "instructions"), ("joules", "J"), ("ratio", "first / this [95 %]")]
COLUMNS += [("verdict", "this is")]


@dataclass(frozen=True)
class Row:
    """A program in one case; medians over launches. `ratio`: the median over rounds of `base`'s time over
    this one's: over 1, this one is faster. None: it is the base itself, or the machine has no such counter.
    `modes`: two modes of its times, ms; `step`: coarse(); `drift`: relative, first to last. Launches that
    other processes interrupted are in no figure of these, and `left_out` is their number. `disturbed`: of the
    ratio's rounds (without a ratio: of the launches) those that were interrupted and count all the same.
    `sure`: the ratio with the interval that the verdict is by: those of all ratios hold at once in 95 %."""

    program: str
    case: str
    launches: int
    ms: Interval
    cpu_ms: float | None  # user and system: of short programs the kernel guesses which it was
    mib: float | None
    instructions: float | None
    joules: float | None
    base: str | None
    ratio: Interval | None
    sure: Interval | None
    verdict: str
    modes: Modes | None
    step: float | None
    drift: float | None
    left_out: int
    disturbed: int

    @property
    def name(self) -> str:
        return f"{self.program} {self.case}".strip()


def calm(launches: pd.DataFrame) -> pd.DataFrame:
    """The launches that no other process interrupted; all where those are too few."""
    quiet = ~noise.interrupted(launches)
    return launches[quiet] if quiet.sum() >= ENOUGH else launches


def ratios(base: pd.DataFrame, other: pd.DataFrame) -> pd.DataFrame:
    """Each round in which nothing interrupted the two, or all rounds where those are too few: `ratio`,
    base over other, and whether it was `disturbed`.

    A neighbour that takes turns with a program on its CPU makes a time a count of the scheduler's slices.
    """
    rounds = pd.DataFrame({"ratio": sequential.ratios(base.ns, other.ns)})
    mine, its = (noise.interrupted(one).reindex(rounds.index) for one in (base, other))
    rounds["disturbed"] = mine | its
    quiet = rounds[~rounds.disturbed]
    return quiet if len(quiet) >= ENOUGH else rounds


def bases(programs: Sequence[Program]) -> list[int | None]:
    """The place of the program that each is held against: the first of its case; where each case
    has one program, the first of all. None: itself."""
    cases = [one.case for one in programs]
    found = [cases.index(case) if cases.count(case) > 1 else 0 for case in cases]
    return [base if base != place else None for place, base in enumerate(found)]


def cover(programs: Sequence[Program]) -> float:
    """Coverage of the interval that decides each verdict."""
    return stats.together(sum(base is not None for base in bases(programs)))


def coarse(times: pd.Series, precision: float | None) -> float | None:
    """The step, relative, of times that repeat in steps too wide for `precision`; 0: all are equal."""
    found = np.unique(times)
    if len(times) < DISTINCT or len(found) == len(times):
        return None
    step = float(np.diff(found).min(initial=found[-1] - found[0]) / np.median(times))
    return step if len(found) < DISTINCT or step > (precision or modes.LEAST) else None


def verdict(found: Interval, sure: Interval, of: pd.Series, precision: float | None, step: float = 0) -> str:
    """`precision`: a difference that is surely smaller is none; one within a `step` is not known."""
    if not sure.sufficient:
        return FEW
    two = modes.modes(of)
    if two and two.split(found):
        return TWO_MODES
    if sure.excludes_one and abs(found.value - 1) > 1.01 * step:
        return FASTER if sure.low > 1 else SLOWER
    near = precision and step <= precision and 1 - precision <= found.low <= found.high <= 1 + precision
    return f"the same within {100 * precision:.3g} %" if precision and near else UNSURE


def rows(cells: Sequence[Cell], plan: Plan) -> list[Row]:
    """Rows in the order of the plan. Times of another tool were not launched in turns: they have no ratio."""
    known = {(one.spec, one.scene): one for one in cells}
    stopped, wide, made = plan.precision is not None, cover(plan.programs), []
    for program, base in zip(plan.programs, bases(plan.programs), strict=True):
        cell = known.get((program.name, program.case))
        if cell is None:
            continue
        first = plan.programs[base] if base is not None and not plan.read_from else None
        other = known.get((first.name, first.case)) if first else None
        launches, ratio, sure, said = calm(cell.values), None, None, ""
        ms, disturbed = launches.ns / 1e6, int(noise.interrupted(launches).sum())
        two, step = modes.modes(ms), coarse(launches.ns, plan.precision)
        if other is not None:
            rounds = ratios(other.values, cell.values)
            disturbed = int(rounds.disturbed.sum())
            ratio = sequential.median_interval(rounds.ratio, stopped)
            sure = sequential.median_interval(rounds.ratio, stopped, wide)
            steps = max(step or 0, coarse(calm(other.values).ns, plan.precision) or 0)
            said = verdict(ratio, sure, rounds.ratio, None if disturbed else plan.precision, steps)
        made.append(
            Row(
                program=program.name,
                case=program.case,
                launches=len(ms),
                ms=sequential.median_interval(ms, stopped),
                cpu_ms=_cpu_ms(launches),
                mib=_median(launches, "max_rss_kib", 1024),
                instructions=_median(launches, "instructions"),
                joules=_median(launches, "joules"),
                base=f"{first.name} {first.case}".strip() if first else None,
                ratio=ratio,
                sure=sure,
                verdict=said,
                modes=two,
                step=step,
                drift=modes.drift(two.within(ms) if two else ms),
                left_out=len(cell.values) - len(ms),
                disturbed=disturbed,
            )
        )
    return made


def _cpu_ms(launches: pd.DataFrame) -> float | None:
    if not {"user_ns", "system_ns"} <= {*launches}:
        return None
    values = (launches.user_ns + launches.system_ns).dropna()
    return float(values.median()) / 1e6 if len(values) else None


def slower(found: Sequence[Row], least: float) -> list[str]:
    """A line for each program that surely takes longer than its base by more than `least`, or whose launches
    are too few to tell. Of the same programs one or more is named in 2.5 % of runs at most."""
    lines = []
    for row in found:
        if row.verdict == FEW:
            lines.append(f"{row.name}: {FEW}")
        elif row.ratio and row.sure and row.verdict == SLOWER and row.sure.high * (1 + least) < 1:
            lines.append(f"{SLOWER}: {row.name} (ratio {row.ratio.text('.4g')})")
    return lines


def _median(launches: pd.DataFrame, name: str, unit: float = 1) -> float | None:
    values = launches[name].dropna() if name in launches else ()
    return float(np.median(values)) / unit if len(values) else None


def precise(launches: Sequence[pd.DataFrame], programs: Sequence[Program], precision: float) -> bool:
    """Whether every ratio is known to ± `precision` and can have a verdict, or the median of the only program
    is known. `launches`: of each program, by round."""
    pairs = zip(bases(programs), launches, strict=True)
    series = [ratios(launches[base], mine).ratio for base, mine in pairs if base is not None]
    found = [sequential.median_interval(one) for one in series or [calm(mine).ns for mine in launches]]
    enough = all(sequential.rank(len(one), cover(programs)) for one in series)
    return enough and all(sequential.within(one, precision) for one in found)


def remarks(found: Sequence[Row]) -> list[str]:
    """A sentence each for two modes, a drift, and what has no verdict."""
    said = []
    for row in found:
        if row.modes:
            text = f"{row.name}: two modes of time, {row.modes.text(unit=' ms')}"
            if row.modes.split(row.ms) and row.ms.sufficient:
                text += "; its median time lies between them and says little"
                text += ", that of its ratios does not" * (row.verdict not in ("", FEW, TWO_MODES))
            said.append(text)
        if row.step is not None:
            step = f"in steps of {100 * row.step:.2g} %" if row.step else "all equal"
            said.append(f"{row.name}: its times are {step}: no smaller change is known")
        if row.drift:
            way = "slower" if row.drift > 0 else "faster"
            text = f"the last quarter {100 * abs(row.drift):.1f} % {way} than the first"
            said.append(f"{row.name}: its launches drifted, {text}")
        if row.left_out:
            about = f"{row.left_out} of {row.launches + row.left_out} launches were interrupted"
            said.append(f"{row.name}: {about} by other processes and are left out")
        if row.disturbed:
            of = f"{row.ratio.launches} rounds" if row.ratio else f"{row.launches} launches"
            text = f"{row.name}: other processes interrupted {row.disturbed} of its {of}"
            said.append(f"{text}; fewer than {ENOUGH} are calm, so all count")
        if row.verdict == TWO_MODES:
            said.append(f"{row.name}: its ratio to {row.base} has two modes: there is no verdict on a median")
    return said


def hyperfine(run: Run) -> dict[str, Any]:
    """A run as `hyperfine --export-json` writes one: seconds, every timed launch, programs in order."""
    frames, results = run.frames(), []
    order = {(one.name, one.case): place for place, one in enumerate(run.plan.programs)}
    every = [some for _, some in frames[~frames.warmup.astype(bool)].groupby("config", sort=False)]
    for some in sorted(every, key=lambda some: order.get((some.spec.iloc[0], some.scene.iloc[0]), 0)):
        one = some.iloc[0]
        parts = re.split(r" (?=[^ =]+=)", str(one.scene))  # values may have spaces
        given = dict(part.split("=", 1) for part in parts if "=" in part)
        picture = show.size(one.width, one.height) and f"{one.scene} {show.size(one.width, one.height)}"
        launches = some.groupby("launch")
        times = (launches.ns.median() / 1e9).tolist()

        def mean(name: str, launches: Any = launches) -> float | None:
            return float(launches[name].first().mean() / 1e9) if name in launches.obj else None

        made = {
            "command": f"{one.spec} {picture}".strip(),
            "mean": float(np.mean(times)),
            "median": float(np.median(times)),
        }
        made["stddev"] = float(np.std(times, ddof=1)) if len(times) > 1 else None
        made |= {"user": mean("user_ns"), "system": mean("system_ns"), "min": min(times), "max": max(times)}
        made["times"] = times
        if "max_rss_kib" in some:
            made["memory_usage_byte"] = (launches.max_rss_kib.first() * 1024).astype(int).tolist()
        codes = launches.exit_status.first().tolist() if "exit_status" in some else [0] * len(times)
        made["exit_codes"] = [int(code) if code >= 0 else 128 - int(code) for code in codes]  # of a signal
        results.append(made | ({"parameters": given} if given else {}))
    return {"results": results}
