"""What is read from the rows of scaling.json: fits beside the law of the paper, memory, and two goals."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from study.core import generated_scenes as scaling_scenes
from study.core import registry, run
from study.core.registry import Spec
from study.core.run import DriverError
from study.experiments.scaling.measure import above_frame, why
from study.experiments.scaling.series import CROWD_HEIGHT, Picture, Row, Series
from study.numbers import power_laws as scaling_fit
from study.numbers import stats
from study.numbers.stats import Interval

FEW, MANY, MOST_TIMES = 16, 4096, 4.0  # shapes, and what the many may cost at most
MOST_MIB = 64.0  # above the frame
SIZE_4K, SCENES_4K = (3840, 2160), ("scene0", "mandelbulb", "scattered")
CROWD = "crowd"  # the series at the goal's own size
NEAR = 0.05  # exponents that close are the same
MET, MISSED, OPEN, UNSURE = "met", "missed", "not measured", "cannot be told apart here"


def fits(rows: Sequence[Row], known: Iterable[Series]) -> list[Row]:
    """Per series and program with at least two points: the laws of time and of evaluations."""
    made = []
    for series in known:
        if not series.kept:
            continue  # the goal's two points: their ratio is in the table of goals
        mine = [row for row in rows if row["series"] == series.name]
        for phase in dict.fromkeys(row["phase"] for row in mine):
            points = [row for row in mine if row["phase"] == phase]
            if len(points) < 2:
                continue
            xs = [row["x"] for row in points]
            counted = [row for row in points if row.get("evals_per_ray")]
            counts = [[row["evals_per_ray"]] for row in counted]
            evals = (
                scaling_fit.fit([r["x"] for r in counted], counts, exact=True) if len(counts) > 1 else None
            )
            law = scaling_fit.fit(xs, [row["ns"] for row in points])
            made.append(
                {
                    **{"series": series.name, "title": series.title, "phase": phase, "paper": series.paper},
                    **{"time": vars(law) | {k: vars(getattr(law, k)) for k in ("exponent", "first", "last")}},
                    "evals": evals and vars(evals) | {"exponent": vars(evals.exponent)},
                    "verdict": verdict(law, series.paper),
                }
            )
    return made


def verdict(law: scaling_fit.Fit, paper: float | None) -> str:
    """What the measured law is beside the paper's exponent, an upper bound."""
    if law.holds is None:
        return "two points: any law goes through them"
    if not law.holds:
        return "no power law: off at " + ", ".join(f"{x:,g}" for x in law.off)
    if paper is None:
        return "a power law"
    found = law.exponent
    if not (math.isfinite(found.low) and math.isfinite(found.high)):
        return "too few launches"
    if abs(found.value - paper) <= NEAR or found.low <= paper <= found.high:
        return "as the paper's law"
    return (
        "grows slower than the paper's bound" if found.value < paper else "grows faster than the paper's law"
    )


def judged(found: Interval, most: float) -> str:
    """Whether a figure with an interval is at most `most`; NaN is never."""
    if not math.isfinite(found.value):
        return OPEN
    if not found.sufficient:
        return "too few launches"
    return MET if found.high <= most else MISSED if found.low > most else UNSURE


def goals(rows: Sequence[Row], memory: Sequence[Row], phases: Sequence[str]) -> list[Row]:
    """4,096 scattered shapes against 16 at equal coverage, and memory at 4K, per program."""
    made = []
    for phase in phases:
        own = [r for r in rows if r["phase"] == phase]
        mine = {r["x"]: r for r in own if r["series"] == CROWD}
        if not {FEW, MANY} <= mine.keys():  # not at the goal's own size
            mine = {r["x"]: r for r in own if r["series"] == "shapes-scattered"}
        most = max(mine, default=0)
        few, many = mine.get(FEW), mine.get(most if most > FEW else MANY)
        ratio = over(many, few) if few and many else None
        full = most == MANY and many and many["n"] == CROWD_HEIGHT
        here = [r["above_frame_mib"] for r in memory if r["phase"] == phase]
        made.append(
            {
                "phase": phase,
                "n": many["n"] if ratio else None,
                "shapes": most if ratio else None,
                "ratio": ratio,
                "scenes": [row.get("scenes", 1) for row in (few, many)] if ratio else None,
                **(by_scenes(many, few) if ratio else {}),
                "coverage": [covered(own, x) for x in (FEW, most)] if ratio else None,
                "shapes_goal": judged(ratio, MOST_TIMES) if ratio and full else OPEN,
                "above_frame_mib": max(here, default=None),
                "memory_goal": memory_goal(memory, phase),
            }
        )
    return made


def over(many: Row, few: Row) -> Interval:
    """Time over time: of one scene each by their medians, since what disturbs a launch is no part of it; of a
    scene for every launch by their means, since what a scene costs is."""
    if "scenes" in many and "scenes" in few:
        return stats.mean_ratio_interval(many["ns"], few["ns"])
    return stats.ratio_interval(many["ns"], few["ns"])


def by_scenes(many: Row, few: Row) -> dict[str, Any]:
    """Of a scene for every launch: the means that the ratio is of, and beside it that of the medians."""
    if not ("scenes" in many and "scenes" in few):
        return {}
    means = [float(np.mean(row["ns"])) * 1e-6 for row in (few, many)]
    return {"mean_ms": means, "by_medians": stats.ratio_interval(many["ns"], few["ns"], rounds=False)}


def covered(rows: Sequence[Row], shapes: int) -> float | None:
    """Share of pixels hit of that many scattered shapes, from whichever picture was kept."""
    some = (r.get("coverage") for r in rows if r["scene"].startswith(f"scattered-{shapes}-"))
    return next((share for share in some if share is not None), None)


def memory_goal(memory: Iterable[Row], phase: str) -> str:
    """The verdict on the program's rows, a file's too, where NaN is null; older files judged fewer scenes."""
    here = {(r["scene"], r["threads"]): r["above_frame_mib"] for r in memory if r["phase"] == phase}
    return under({key: math.nan if mib is None else mib for key, mib in here.items()})


def under(here: dict[tuple[str, int], float]) -> str:
    """Whether every (scene, threads) is under MOST_MIB; which scenes were not measured is said."""
    if not here or not all(map(math.isfinite, here.values())):
        return OPEN
    if not all(mib < MOST_MIB for mib in here.values()):
        return MISSED
    missing = [scene for scene in SCENES_4K if scene not in {scene for scene, _ in here}]
    return MET + (f", {' and '.join(missing)} not measured" if missing else "")


def memory(
    specs: Sequence[Spec], rows: Sequence[Row], seconds: float, seed: int, folder: Path
) -> tuple[list[Row], list[Row]]:
    """Peak memory above the frame at 3840×2160, cheapest first, and what was left out.

    Of scene0, the Mandelbulb and 4,096 scattered shapes, on one thread and on all; the seconds are foreseen
    from `rows`.
    """
    pixels = SIZE_4K[0] * SIZE_4K[1]
    wanted, left_out = [], []
    for spec in specs:
        for scene, pace in paces(rows, str(spec)).items():
            counts = {1, len(run.USABLE)} if registry.find_phase(spec.phase).threads else {1}
            for threads in sorted(counts):
                about = {"series": "memory", "x": threads, "phase": str(spec), "scene": scene}
                if pace is None:
                    reason = f"{scene} was not timed, so what 4K would take is not known"
                    left_out.append(about | {"reason": reason, "foreseen_s": None})
                else:
                    wanted.append((pace * pixels * 1e-9 / threads, spec, about))
    made = []
    for foreseen, spec, about in sorted(wanted, key=lambda one: one[0]):
        if foreseen > seconds:
            reason = f"a frame would take about {foreseen:.3g} s, {max(seconds, 0):.3g} s are left"
            left_out.append(about | {"reason": reason, "foreseen_s": foreseen})
            continue
        seconds -= foreseen
        try:
            made.append(about | at_4k(spec, about, seed, folder))
        except DriverError as error:
            left_out.append(about | {"reason": why(error), "foreseen_s": foreseen})
    return made, left_out


def paces(rows: Sequence[Row], phase: str) -> dict[str, float | None]:
    """ns per pixel on one thread of SCENES_4K, None where not measured; the largest picture counts."""

    def pace(some: list[Row]) -> float | None:
        best = max(some, key=lambda row: row["n"], default=None)
        return best and best["ns_per_pixel"].value

    own = [r for r in rows if r["phase"] == phase and r["threads"] == 1 and r["max_steps"] is None]
    return {
        **{name: pace([r for r in own if r["scene"] == name]) for name in ("scene0", "mandelbulb")},
        "scattered": pace([r for r in own if r["series"] in (CROWD, "shapes-scattered") and r["x"] == MANY]),
    }


def at_4k(spec: Spec, about: Row, seed: int, folder: Path) -> dict[str, Any]:
    """One frame: peak resident memory right after it, and what of it is above the 12 bytes a pixel."""
    if about["scene"] == "scattered":
        scene = scaling_scenes.of_shapes("scattered", MANY, seed, folder)
    else:
        scene = registry.find_scene(about["scene"])
    width, height = SIZE_4K
    made = run.render(spec, scene.path, height, width, cpu=run.FASTEST, threads=about["x"])
    peak = made["frames"][0]["max_rss_kib"]
    picture = Picture(scene.name, scene.path, height, width)
    return {
        **{"shapes": len(scene.data["shapes"]), "threads": about["x"], "width": width, "n": height},
        **{"seconds": made["frames"][0]["ns"] * 1e-9, "peak_rss_mib": peak / 1024},
        "above_frame_mib": above_frame(peak, picture),
    }
