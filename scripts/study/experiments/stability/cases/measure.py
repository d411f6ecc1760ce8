"""Runs hard cases on phases: the rows of stability.json."""

import dataclasses
import math
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed

from study.core import progress, registry
from study.experiments import running
from study.experiments.stability.cases import Case, Crashed, Hung, Phase, Refused
from study.experiments.stability.schema import Row, Skipped

FAMILY = "ladder"  # of the phases that run unless others are named
RIGHT, WRONG, NOT_FINITE, REFUSED = "right", "wrong", "not finite", "refused"
CRASHED, HUNG, BROKEN = "crashed", "hung", "broken"
BREAKS = (NOT_FINITE, CRASHED, HUNG, BROKEN)  # what no phase may do; BROKEN is the case's own fault
RAISED = {Refused: REFUSED, Hung: HUNG, Crashed: CRASHED}


@dataclasses.dataclass(frozen=True)
class Point:
    """One phase at one strength of one case. `error` is NaN unless the case gave a number."""

    strength: float
    state: str
    error: float = math.nan
    non_finite: int = 0
    note: str = ""


def measure_point(phase: Phase, case: Case, strength: float) -> Point:
    """Run the case; whatever happens becomes a state. `phase` must be a new one (it counts)."""
    try:
        outcome = case.run(phase, strength)
    except (Refused, Hung, Crashed) as why:
        return Point(strength, RAISED[type(why)], note=str(why), non_finite=phase.non_finite)
    except Exception as why:  # the case's, so that one broken case does not hide the others
        return Point(strength, BROKEN, note=f"{type(why).__name__}: {why}")
    error, bad = float(outcome.error), phase.non_finite + outcome.non_finite
    state = NOT_FINITE if bad else WRONG if case.failed(error) else RIGHT
    return Point(strength, state, error, bad, outcome.note)


def row(name: str, case: Case, points: Sequence[Point]) -> Row:
    """A row from the points of one phase in the order of the case's strengths."""
    bad = [p.strength for p in points if p.state not in (RIGHT, REFUSED)]
    return Row(
        case=case.name,
        number=case.number,
        phase=name,
        strengths=tuple(p.strength for p in points),
        errors=[p.error if math.isfinite(p.error) else None for p in points],
        states=[p.state for p in points],
        notes=[p.note for p in points],
        first_failure=bad[0] if bad else None,
        non_finite=sum(p.non_finite for p in points),
        hung=any(p.state == HUNG for p in points),
        crashed=any(p.state == CRASHED for p in points),
        refused=all(p.state == REFUSED for p in points),
        unit=case.about.unit,
        limit=case.about.fails_above,
    )


def able(names: Iterable[str] | None) -> tuple[list[str], list[Skipped]]:
    """The phases that can run here, and those that cannot with the reason. None: the ladder's."""
    family = [p.name for p in registry.phases().values() if p.family == FAMILY]
    specs, lacking = running.programs(names or family)
    return [*map(str, specs)], [Skipped(phase=str(spec), reason=why) for spec, why in lacking.items()]


def sweep(
    names: Sequence[str], chosen: Sequence[Case], few: bool = False, jobs: int = 1, **options: object
) -> list[Row]:
    """Rows for every case (in order) and phase. `options` go to Phase (time_limit, make, folder)."""
    tasks = [(c, n, s) for c in chosen for n in names for s in (c.few() if few else c.strengths)]
    points: dict[tuple[int, str], list[Point]] = {}
    with ThreadPoolExecutor(jobs) as pool:
        running = [pool.submit(measure_point, Phase(n, **options), c, s) for c, n, s in tasks]
        try:
            for _ in progress.each(as_completed(running), "hard cases", len(tasks)):
                pass
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
    for (case, name, _), future in zip(tasks, running, strict=True):
        points.setdefault((case.number, name), []).append(future.result())
    return [row(name, case, points[case.number, name]) for case in chosen for name in names]


def breaks(rows: Iterable[Row]) -> list[str]:
    """A line for everything that no phase may do (and for every case that cannot run)."""
    found = []
    for r in rows:
        for strength, state, note in zip(r.strengths, r.states, r.notes, strict=True):
            if state in BREAKS:
                what = f"{r.phase}, case {r.number} {r.case} at {strength:g}: {state}"
                found.append(what + (f" ({note})" if note else ""))
    return found
