"""Runs hard cases on phases: the rows of stability.json (keys: results/keys/stability.json.md)."""

from __future__ import annotations

import dataclasses
import hashlib
import math
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed

from study.core import cli, progress, registry
from study.experiments.stability.cases import Case, Crashed, Hung, Outcome, Phase, Refused

FAMILY = "ladder"  # of the phases that run unless others are named
RIGHT, WRONG, NOT_FINITE, REFUSED, CRASHED, HUNG, BROKEN = (
    "right", "wrong", "not finite", "refused", "crashed", "hung", "broken",
)  # fmt: skip
BREAKS = (NOT_FINITE, CRASHED, HUNG, BROKEN)  # what no phase may do; BROKEN is the case's own fault


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
    except Refused as why:
        return Point(strength, REFUSED, note=str(why))
    except Hung as why:
        return Point(strength, HUNG, note=str(why), non_finite=phase.non_finite)
    except Crashed as why:
        return Point(strength, CRASHED, note=str(why), non_finite=phase.non_finite)
    except Exception as why:  # the case's, so that one broken case does not hide the others
        return Point(strength, BROKEN, note=f"{type(why).__name__}: {why}")
    if not isinstance(outcome, Outcome):
        return Point(strength, BROKEN, note=f"run() returned {outcome!r}, must be an Outcome")
    error, bad = float(outcome.error), phase.non_finite + outcome.non_finite
    state = NOT_FINITE if bad else WRONG if case.failed(error) else RIGHT
    return Point(strength, state, error, bad, outcome.note)


def row(name: str, case: Case, points: Sequence[Point]) -> dict:
    """One row of stability.json, from the points of one phase in the order of the case's strengths."""
    bad = [p.strength for p in points if p.state not in (RIGHT, REFUSED)]
    return {
        "case": case.name,
        "number": case.number,
        "phase": name,
        "strengths": [p.strength for p in points],
        "errors": [p.error for p in points],
        "states": [p.state for p in points],
        "notes": [p.note for p in points],
        "first_failure": bad[0] if bad else None,
        "non_finite": sum(p.non_finite for p in points),
        "hung": any(p.state == HUNG for p in points),
        "crashed": any(p.state == CRASHED for p in points),
        "refused": all(p.state == REFUSED for p in points),
        "unit": case.unit,
        "limit": case.fails_above,
    }


def able(names: Iterable[str] | None) -> tuple[list[str], list[dict]]:
    """The phases that can run here, and those that cannot with the reason. None: the ladder's."""
    names = names or [p.name for p in registry.phases().values() if p.family == FAMILY]
    runs, skipped = [], []
    for name in dict.fromkeys(names):
        spec = registry.Spec.parse(name)
        if lacking := registry.missing_isa(spec):
            skipped.append({"phase": name, "reason": f"this CPU lacks {' '.join(lacking)}"})
        else:
            runs.append(name)
    return runs, skipped


def sweep(
    names: Sequence[str],
    chosen: Sequence[Case],
    few: bool = False,
    jobs: int = 1,
    **options: object,
) -> list[dict]:
    """Rows for every case (in order) and phase. `options` go to Phase (time_limit, make, folder)."""
    tasks = [(c, n, s) for c in chosen for n in names for s in (c.few() if few else c.strengths)]
    points: dict[tuple[int, str, float], Point] = {}
    with ThreadPoolExecutor(jobs) as pool:
        running = {pool.submit(measure_point, Phase(n, **options), c, s): (c, n, s) for c, n, s in tasks}
        try:
            for future in progress.each(as_completed(running), "hard cases", len(tasks)):
                case, name, strength = running[future]
                points[case.number, name, strength] = future.result()
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
    strengths = {c.number: c.few() if few else c.strengths for c in chosen}
    return [
        row(name, case, [points[case.number, name, s] for s in strengths[case.number]])
        for case in chosen
        for name in names
    ]


def about(case: Case) -> dict:
    """A case without its function: what a page needs."""
    found = {f.name: getattr(case, f.name) for f in dataclasses.fields(case) if f.name != "run"}
    return {**found, "own": case.own}


def binary_sha256(name: str) -> str:
    """Of build/NAME/render, for the record."""
    return hashlib.sha256(Phase(name).program().read_bytes()).hexdigest()


def breaks(rows: Iterable[dict]) -> list[str]:
    """A line for everything that no phase may do (and for every case that cannot run)."""
    found = []
    for r in rows:
        for strength, state, note in zip(r["strengths"], r["states"], r["notes"], strict=True):
            if state in BREAKS:
                what = f"{r['phase']}, case {r['number']} {r['case']} at {strength:g}: {state}"
                found.append(what + (f" ({note})" if note else ""))
    return found


def check(rows: Iterable[dict]) -> int:
    """The exit status: a wrong picture is a result, a break is a failure."""
    return cli.FAILED if breaks(rows) else cli.OK
