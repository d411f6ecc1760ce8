"""Configurations of two runs side by side: ratios with intervals, and whether the later one is slower."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from study.core import show
from study.core.registry import BASE
from study.counting.schema import Counts
from study.measuring.two_runs import Side, other_machine, other_work
from study.numbers import analysis, modes, programs, significance, stats
from study.numbers.significance import LEVEL, corrected, longer
from study.numbers.stats import ENOUGH, Interval

TIMES = ("time", "cycles", "baseline")
INSTRUCTIONS, BLOCKS = "instructions", "blocks"
MOVED = 0.005  # a quantity that changed by less is not what moved, however narrow its interval
FASTER, SLOWER, SAME, FEW = "faster", "slower", "the same within noise", "unknown (too few launches)"
NONE, ONCE = "no verdict", "slower once, not confirmed"
TWO_MODES, UNMEASURED = f"{NONE} (two modes)", f"{NONE} (not measured)"
Samples = tuple[np.ndarray, np.ndarray]  # of the base and of the run
Key = tuple[str, int, int, int, str]  # scene, width, height, threads, spec


@dataclass(frozen=True)
class Row:
    """A configuration of both runs: times, and the ratios of the base over the run; None: not measured.
    `instructions`: that of the exact counts. `p_slower`, `p_faster`: against the opposite, one-sided.
    `again`: the ratio of times when both programs were launched by turns."""

    scene: str
    width: int
    height: int
    threads: int
    spec: str
    size: str
    run: str
    base_ms: Interval
    ms: Interval
    time: Interval | None
    cycles: Interval | None
    clock: Interval | None
    baseline: Interval | None
    instructions: float | None
    moved: str
    p_slower: float | None
    p_faster: float | None
    verdict: str
    again: Interval | None = None

    @property
    def key(self) -> Key:
        return self.scene, self.width, self.height, self.threads, self.spec

    @property
    def name(self) -> str:
        return " ".join(filter(None, (self.spec, self.scene, self.size)))

    @property
    def p(self) -> float | None:
        """Probability of chance, in the direction in which it seems to have changed."""
        return None if self.p_slower is None or self.p_faster is None else min(self.p_slower, self.p_faster)

    @property
    def more_work(self) -> float:
        """Share of instructions that the run has more than the base; 0 where they were not counted."""
        return round(1 / self.instructions - 1, 9) if self.instructions else 0.0

    def why(self, by: str) -> str:
        """The figures that a verdict stands on, in words."""
        time = {"time": self.time, "cycles": self.cycles}.get(by, self.baseline or self.time)
        said = [
            f"{name} {found.text('.4g')}" for name, found in (("ratio", time), ("again", self.again)) if found
        ]
        said += [f"instructions {100 * self.more_work:+.3g} %"] if self.instructions else []
        return ", ".join(said)


def _values(side: Side) -> dict[Key, pd.DataFrame]:
    """Configuration → its launches: ns, core_cycles, core_hz (NaN where the run has none)."""
    return {
        key: programs.calm(cell.values)
        for key, cell in analysis.by_key(analysis.cells_of(side.frames)).items()
    }


def ratio(base: pd.Series, other: pd.Series) -> Interval | None:
    """Base over other; None where one of them was not measured."""
    if not (base.notna().all() and other.notna().all()):
        return None
    return stats.ratio_interval(base.to_numpy(float), other.to_numpy(float), rounds=False)  # none in common


def _beside_baseline(key: Key, *runs: Mapping[Key, pd.DataFrame]) -> Key | None:
    """Baseline's configuration of the same picture; None for baseline, and without it in one of the runs."""
    base = (*key[:-1], BASE)
    return base if key[-1] != BASE and all(base in run for run in runs) else None


def over_baseline(key: Key, base: Mapping, other: Mapping) -> Interval | None:
    """The phase's speed-up over baseline in `other` by that in `base`; None for baseline and without it.

    Both speed-ups are of one interleaved run each: what slows a whole run is in neither.
    """
    if (first := _beside_baseline(key, base, other)) is None:
        return None
    return stats.change_interval(*(tuple(one[name].ns for name in (first, key)) for one in (base, other)))


def _samples(by: str, key: Key, base: Mapping, other: Mapping) -> Samples | None:
    """What the verdict of a configuration is of, a value a launch; None: not measured. By baseline, and where
    it can be by instructions too, the time over baseline's of the same round."""
    first = _beside_baseline(key, base, other)
    if by in ("baseline", INSTRUCTIONS) and first:
        made = [significance.by_round(one[key].ns, one[first].ns) for one in (base, other)]
        return made[0], made[1]
    if by == "baseline":
        return None
    a, b = (one[key]["core_cycles" if by == "cycles" else "ns"].to_numpy(float) for one in (base, other))
    return (a, b) if np.isfinite(a).all() and np.isfinite(b).all() else None


def _work(*sides: Side) -> dict[tuple[str, str], float]:
    """Scene and program → instructions of the first run's timed region over those of the second, as `blocks`
    counted both: of the largest size in common."""
    files = [Counts.load_if_there(side.run.path / "counts.json") for side in sides]
    first, second = (
        {
            (one.size, one.scene_hash, one.scene, one.spec): one.total.instructions
            for one in (file.measured if file else [])
            if one.backend == BLOCKS and one.variant == "shipped"
        }
        for file in files
    )
    common = sorted(first.keys() & second.keys(), key=lambda key: key[0])
    return {key[2:]: first[key] / second[key] for key in common}


def moved(cycles: Interval | None, clock: Interval | None) -> str:
    """Which of the two changed: its interval excludes 1, and by MOVED or more."""
    both = (("cycles", cycles), ("clock", clock))
    return " and ".join(
        name for name, found in both if found and found.excludes_one and abs(found.value - 1) >= MOVED
    )


def _apart(base: np.ndarray, other: np.ndarray, least: float) -> bool:
    """Whether all launches of the one run took longer than all of the other, by more than `least`."""
    return other.min() > base.max() * (1 + least) or base.min() > other.max() * (1 + least)


def rows(base: Side, other: Side, by: str, least: float, machine_may_differ: bool) -> list[Row]:
    """Configurations of both, with a verdict where there is none to be had; p-values are each by itself.
    Other work has no ratio. Launches in two modes have no verdict on their medians, which tell of chance."""
    ours, theirs, work = _values(base), _values(other), _work(base, other)
    no_scene = other_work(base, other)
    another = not machine_may_differ and other_machine(base, other) is not None
    found = []
    for key in ours.keys() & theirs.keys():
        a, b = ours[key], theirs[key]
        same = key[0] not in no_scene
        ratios = {
            "time": ratio(a.ns, b.ns),
            "cycles": ratio(a.core_cycles, b.core_cycles),
            "clock": ratio(b.core_hz, a.core_hz),
            "baseline": over_baseline(key, ours, theirs),
            "instructions": work.get((key[0], key[4])) if key[3] == 1 else None,
        }
        if not same:
            ratios = dict.fromkeys(ratios)
        samples, verdict = _samples(by, key, ours, theirs), ""
        p_values: tuple[float, float] | tuple[None, None] = (None, None)
        if another or not same:
            verdict = f"{NONE} (other {'machine' if same else 'scene'})"
        elif samples is None:
            verdict = UNMEASURED
        elif min(map(len, samples)) < ENOUGH:
            verdict = FEW
        elif any(map(modes.modes, samples)) and not _apart(*samples, least):
            verdict = TWO_MODES
        else:
            p_values = (longer(*samples, least), longer(*samples[::-1], least))
        times = [stats.median_interval(one.ns / 1e6) for one in (a, b)]
        about = (show.size(*key[1:3]), other.letter, *times)
        changed = moved(ratios["cycles"], ratios["clock"])
        found.append(Row(*key, *about, *ratios.values(), changed, *p_values, verdict))
    return found


def judged(found: Sequence[Row], by: str, least_work: float, least: float = 0.0) -> list[Row]:
    """The rows with their verdicts, their p-values corrected together. By instructions the count comes first:
    more work is slower unless time says faster, and less is faster unless time says slower."""
    family = [row for row in found if not row.verdict]
    p_values = [corrected([getattr(row, name) for row in family]) for name in ("p_slower", "p_faster")]
    tested = iter(zip(*p_values, strict=True))
    same, made = f"{SAME} or {100 * least:.3g} %" if least else SAME, []
    for row in found:
        if not row.verdict:
            p, q = next(tested)
            verdict = SLOWER if p <= LEVEL else FASTER if q <= LEVEL else same
            row = replace(row, p_slower=p, p_faster=q, verdict=verdict)
        if by == INSTRUCTIONS and row.verdict in (same, FEW, TWO_MODES, SLOWER, FASTER):
            if row.more_work >= least_work and row.verdict != FASTER:
                row = replace(row, verdict=SLOWER)
            elif row.more_work <= -least_work and row.verdict != SLOWER:
                row = replace(row, verdict=FASTER)
        made.append(row)
    return made


def confirmed(found: Sequence[Row], times: Mapping[Key, Samples], least: float) -> list[Row]:
    """The rows with what a second measurement says (ns a launch, base and run by turns): of one that was
    slower and is not again, ONCE."""
    p_values = dict(zip(times, corrected([longer(*each, least) for each in times.values()]), strict=True))
    made = []
    for row in found:
        if row.key in times and row.verdict == SLOWER:
            verdict = SLOWER if p_values[row.key] <= LEVEL else ONCE
            row = replace(row, verdict=verdict, again=stats.ratio_interval(*times[row.key]))
        made.append(row)
    return made
