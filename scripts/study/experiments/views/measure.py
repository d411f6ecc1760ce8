"""Every rung against its parent on every view of every scene: which rungs fit the time, errors, times.

From the newest rung down, as long as the seconds last, first the views that constants may be tuned on, then
all others: small pictures of each view, which are held against truth (or what stands for it) and tell what a
launch will take; then all launches, interleaved. A frame's time needs no clocks' rates, so none are measured:
they would take a hundred times as long as a frame.
"""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from study.core import cli, progress, registry, run
from study.core.cli import StudyError
from study.core.registry import Spec
from study.core.run import DriverError
from study.experiments.views.schema import Views
from study.measuring.views import View
from study.numbers import stats
from study.numbers.analysis import GENERATED
from study.pictures import images
from study.truth import judging, truth

FILE = "views.json"
BASE = "baseline"  # the reference where truth would take too long
FACTOR = judging.FACTOR  # of the averaged pictures of fractals: their single samples are chaotic
LONG = 0.25  # s: caches settle within such a frame
LEAST, MOST_REPS = 0.02, 200  # s of a launch's timed frames at least, and how many that may become
OVERHEAD = 0.03  # s of a launch beside its frames
TRUTH_SHARE, TRUTH_PER_PIXEL = 0.3, 5e-4  # of the seconds; s, what a view's truth is taken for beforehand
Row = dict[str, Any]
Point = tuple[Spec, View]


@dataclass
class Settings:
    """`n`: height of the timed pictures, `error_n`: of those held against truth; `scratch`: a folder."""

    n: int
    error_n: int
    launches: int
    reps: int
    seed: int
    cpu: int
    seconds: float
    jobs: int
    scratch: Path


@dataclass
class Plan:
    """Rungs taken (with their parents' names), a first frame's seconds per pixel by point, what was not."""

    rungs: list[tuple[Spec, Spec]] = field(default_factory=list)
    pace: dict[Point, float] = field(default_factory=dict)
    left_out: list[Row] = field(default_factory=list)
    failures: list[Row] = field(default_factory=list)

    @property
    def specs(self) -> list[Spec]:
        return list(dict.fromkeys(spec for rung, parent in self.rungs for spec in (parent, rung)))


def parents(names: Sequence[str]) -> list[tuple[Spec, Spec]]:
    """(rung, parent) of each name whose parent is timed. Raises StudyError for a name that is no phase."""
    found = []
    for name in dict.fromkeys(names):
        spec = Spec.parse(name)
        parent = registry.find_phase(spec.phase).parent
        if parent in registry.ladder() and registry.find_phase(spec.phase).family != registry.TRUTH:
            found.append((spec, Spec.parse(parent)))
    return found


def frames_of(seconds: float, reps: int) -> tuple[int, int]:
    """Warm-up and timed frames of a launch, by the time of one frame in s: `reps` and LEAST s at least."""
    if seconds > LONG:
        return 0, 1
    return 1, max(reps, min(MOST_REPS, math.ceil(LEAST / seconds)))


def cost(pace: float, pixels: int, settings: Settings) -> float:
    """Seconds of all launches of a point whose frames take `pace` s a pixel."""
    frames = sum(frames_of(pace * pixels, settings.reps))
    return settings.launches * (frames * pace * pixels + OVERHEAD)


def choose(
    rungs: Sequence[tuple[Spec, Spec]],
    views: Sequence[View],
    settings: Settings,
    first: Callable[[Spec, View], float],
    clock: Callable[[], float] = time.monotonic,
) -> Plan:
    """Takes rungs from the last on while the seconds last, the last one always: on the tuned views, then
    those rungs on all others.

    `first` renders the small picture and returns seconds a pixel. A rung's refusal (DriverError with the
    status for it) leaves out that view, a crash is a failure.
    """
    plan, begun, ahead = Plan(), clock(), 0.0
    able = []
    for rung, parent in rungs:
        lacking = [" ".join(found) for s in (rung, parent) if (found := registry.missing_isa(s))]
        if lacking:
            plan.left_out.append({"phase": str(rung), "reason": f"this CPU lacks {lacking[0]}"})
        else:
            able.append((rung, parent))
    tuned = [view for view in views if view.tuned]
    others = [view for view in views if not view.tuned]
    for some, about in ((tuned, {}), (others, {"scene": "other", "view": "views"} if tuned else {})):
        if not some:
            continue
        known: set[Spec] = set()
        for number, (rung, parent) in enumerate(reversed(able)):
            pace: dict[Point, float] = {}
            needed = sum(
                _tried(spec, some, settings, first, plan, pace)
                for spec in (rung, parent)
                if spec not in known
            )
            if number and clock() - begun + ahead + needed > settings.seconds:
                reason = (
                    f"{clock() - begun + ahead + needed:.0f} s would be needed with it, "
                    f"{settings.seconds:.0f} s there are"
                )
                able, without = able[len(able) - number :], able[: len(able) - number]
                plan.left_out += [{"phase": str(other), **about, "reason": reason} for other, _ in without]
                break
            ahead += needed
            known |= {rung, parent}
            plan.pace |= pace
            if (rung, parent) not in plan.rungs:
                plan.rungs.insert(0, (rung, parent))
    return plan


def _tried(
    spec: Spec,
    views: Iterable[View],
    settings: Settings,
    first: Callable[[Spec, View], float],
    plan: Plan,
    known: dict[Point, float],
) -> float:
    """Small pictures of every view, their pace into `known`; the seconds that their launches will take."""
    seconds = 0.0

    def one(view: View) -> float | DriverError:
        try:
            return first(spec, view)
        except DriverError as error:
            return error

    some = list(views)
    with ThreadPoolExecutor(settings.jobs) as pool:
        for view, pace in zip(some, pool.map(one, some), strict=True):
            if isinstance(pace, DriverError):
                what = {"phase": str(spec), "scene": view.base, "view": view.name, "reason": pace.message}
                skipped = pace.status in (run.NO_ISA, run.UNSUPPORTED)
                (plan.left_out if skipped else plan.failures).append(what)
                continue
            known[spec, view] = pace
            width, height = view.size(settings.n)
            seconds += cost(pace, width * height, settings)
    return seconds


def measure(points: Mapping[Point, float], settings: Settings) -> dict[Point, list[float]]:
    """Nanoseconds of a frame (median of a launch's timed ones) per launch, every point once a round."""

    def once(point: Point, padding: int) -> float:
        spec, view = point
        width, height = view.size(settings.n)
        warmup, reps = frames_of(points[point] * width * height, settings.reps)
        how = {"cpu": settings.cpu, "env_bytes": padding, "warmup": warmup, "reps": reps}
        how["timed"] = False
        with contextlib.closing(run.frames(spec, view.scene.path, height, width, **how)) as made:
            return float(np.median([frame["ns"] for frame in made if not frame["warmup"]]))

    return run.interleaved(list(points), settings.launches, settings.seed, settings.cpu, once, "time views")


class Errors:
    """Small pictures, and their errors: to truth while its seconds last (fractals: never), then to the
    baseline; a fractal's 4 × 4 averaged, as one sample of it is chaotic."""

    def __init__(self, settings: Settings) -> None:
        self.settings = settings
        self.references: dict[View, tuple[str, images.Picture]] = {}
        self.general: dict[Point, str] = {}  # why there is no kernel, of phases that generate some

    def size(self, view: View) -> tuple[int, int]:
        return view.size(self.settings.error_n * (FACTOR if view.scene.fractal else 1))

    def path(self, spec: Spec, view: View) -> Path:
        return self.settings.scratch / f"{view.scene.name}-{spec}.exr"

    def first(self, spec: Spec, view: View) -> float:
        """Renders the picture: seconds a pixel. Raises DriverError."""
        width, height = self.size(view)
        how = {"aov": True, "out": self.path(spec, view)}
        made = run.render(spec, view.scene.path, height, width, **how)
        if made["kernel"] not in (None, GENERATED):
            self.general[spec, view] = made["kernel"]
        return made["frames"][0]["ns"] * 1e-9 / (width * height)

    def find_references(self, views: Sequence[View], seconds: float) -> None:
        """Truth's picture of every view as far as the seconds go, the tuned first; else the baseline's."""
        begun, others = time.monotonic(), []
        for view in progress.each(sorted(views, key=lambda v: not v.tuned), "references"):
            size = self.size(view)
            if not view.scene.fractal:
                left = seconds - (time.monotonic() - begun)
                if truth.path_of(view.scene, size).exists() or left > TRUTH_PER_PIXEL * size[0] * size[1]:
                    self.references[view] = "truth", truth.picture(view.scene, size)
                    continue
            others.append(view)
        base = Spec.parse(BASE)
        with ThreadPoolExecutor(self.settings.jobs) as pool:
            list(pool.map(lambda view: self.first(base, view), others))
        self.references |= {view: (BASE, images.read(self.path(base, view))) for view in others}

    def of(self, spec: Spec, view: View) -> Row:
        """reference, psnr_db, psnr_ideal_db, wrong_ppm, depth_agree_fraction, non_finite."""
        name, reference = self.references[view]
        if name == str(spec):
            return {"reference": None, "non_finite": 0}
        return {
            "reference": name,
            **against(reference, images.read(self.path(spec, view)), name == "truth", view.scene.fractal),
        }


def against(reference: images.Picture, image: images.Picture, exact: bool, fractal: bool) -> Row:
    """Errors of a picture to truth's (`exact`) or another's. PSNR in dB of linear colours; NaN: none."""
    bad = images.non_finite(image)
    if exact:
        found = judging.metrics(reference, image)
        wrong = sum(found[f"{name}_ppm"] for name in ("false_hits", "false_misses", "wrong_shape"))
        kept = {name: found[name] for name in ("psnr_db", "rmse", "psnr_ideal_db", "rmse_ideal")}
        return kept | {"wrong_ppm": wrong, "depth_agree_fraction": None, "non_finite": bad}
    geometry = images.geometry(reference, image)
    pair = [
        images.box_average(images.rgb(p), FACTOR) if fractal else images.rgb(p) for p in (reference, image)
    ]
    colours = images.colour_errors(*pair, with_flip=False)
    return {
        **{name: colours[name] for name in ("psnr_db", "rmse")},
        "wrong_ppm": geometry["mask_mismatch_ppm"] + geometry["id_mismatch_ppm"],
        "depth_agree_fraction": geometry["depth_agree_fraction"] if fractal else None,
        "non_finite": bad,
    }


def rows(plan: Plan, times: Mapping[Point, list[float]], errors: Errors, settings: Settings) -> list[Row]:
    """One per program and view; `ratio` to its parent where that was timed there too."""
    parent_of = {rung: parent for rung, parent in plan.rungs}
    made = []
    for spec in plan.specs:
        for view in dict.fromkeys(view for _, view in times):
            if (spec, view) not in times:
                continue
            width, height = view.size(settings.n)
            ns, base = times[spec, view], times.get((parent_of.get(spec, spec), view))
            parent = parent_of.get(spec)
            made.append(
                {
                    **{"phase": str(spec), "parent": parent and str(parent), "scene": view.base},
                    **{"view": view.name, "change": view.change, "tuned": view.tuned},
                    **{"width": width, "n": height, "ns": ns},
                    "general": errors.general.get((spec, view)),
                    "ms": stats.median_interval([one * 1e-6 for one in ns]),
                    "ratio": stats.ratio_interval(base, ns) if parent and base else None,
                    **errors.of(spec, view),
                }
            )
    return made


def study(rungs: Sequence[tuple[Spec, Spec]], views: Sequence[View], settings: Settings) -> Row:
    """Everything in about `settings.seconds`: rows, left_out, failures. Raises StudyError if nothing ran."""
    begun = time.monotonic()
    errors = Errors(settings)
    errors.find_references(views, TRUTH_SHARE * settings.seconds)
    left = Settings(**{**vars(settings), "seconds": settings.seconds - (time.monotonic() - begun)})
    plan = choose(rungs, views, left, errors.first)
    points = {point: pace for point, pace in plan.pace.items() if point[0] in plan.specs}
    if not points:
        reason = (plan.failures + plan.left_out)[0]["reason"] if plan.failures + plan.left_out else "no rung"
        raise StudyError(f"nothing was measured: {reason}", cli.CANNOT_RUN)
    cli.say(f"{len(plan.rungs)} rungs on {len(views)} views: {len(points)} points")
    times = measure(points, settings)
    return {
        "rows": rows(plan, times, errors, settings),
        "left_out": plan.left_out,
        "failures": plan.failures,
    }


def read(path: Path) -> Row:
    """A run's views.json; without that file no row. Raises StudyError for another thing's JSON."""
    if not path.exists():
        return {"rows": [], "left_out": [], "failures": []}
    return Views.read(path)
