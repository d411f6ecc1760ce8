"""Every phase against its parent on every view of every scene: which fit the time, errors, times.

From the newest phase down, as long as the seconds last: small pictures of each view, which are held against
truth (or what stands for it) and tell what a launch will take; then all launches, interleaved.
"""

import math
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

from study.core import cli, progress, registry, run
from study.core.cli import StudyError
from study.core.registry import Spec
from study.core.run import DriverError
from study.experiments.views.gains import BASE
from study.experiments.views.schema import LeftOut, Row
from study.measuring import hits
from study.measuring.hits import Errors
from study.measuring.launches import milliseconds, render
from study.measuring.views import View
from study.numbers import stats
from study.numbers.analysis import GENERATED
from study.numbers.schema import Interval
from study.pictures import images
from study.truth import truth

LONG = 0.25  # s: caches settle within such a frame
LEAST, MOST_REPS = 0.02, 200  # s of a launch's timed frames at least, and how many that may become
OVERHEAD = 0.03  # s of a launch beside its frames
TRUTH_SHARE, TRUTH_PER_PIXEL = 0.3, 5e-4  # of the seconds; s, what a view's truth is taken for beforehand
Point = tuple[Spec, View]
Pair = tuple[Spec, Spec]  # a phase and its parent


@dataclass
class Settings:
    """`n`: height of the timed pictures, `error_n`: of those held against truth; `scratch`: a folder."""

    n: int
    error_n: int
    launches: int
    seed: int
    cpu: int
    seconds: float
    jobs: int
    scratch: Path


@dataclass
class Plan:
    """Phases taken with their parents, a first frame's seconds per pixel by point, and what was not taken."""

    pairs: list[Pair] = field(default_factory=list)
    pace: dict[Point, float] = field(default_factory=dict)
    left_out: list[LeftOut] = field(default_factory=list)
    failures: list[LeftOut] = field(default_factory=list)

    @property
    def specs(self) -> list[Spec]:
        return list(dict.fromkeys(spec for phase, parent in self.pairs for spec in (parent, phase)))


def parents(names: Iterable[str]) -> list[Pair]:
    """Each phase with its parent, where that is timed. Raises StudyError for a name that is no phase."""
    found = []
    for spec in map(Spec.parse, dict.fromkeys(names)):
        phase = registry.find_phase(spec.phase)
        if phase.parent in registry.ladder() and phase.family != registry.TRUTH:
            found.append((spec, Spec.parse(phase.parent)))
    return found


def frames_of(seconds: float) -> tuple[int, int]:
    """Warm-up and timed frames of a launch, by the time of one frame in s: LEAST s at least."""
    return (0, 1) if seconds > LONG else (1, min(MOST_REPS, math.ceil(LEAST / seconds)))


def cost(pace: float, view: View, settings: Settings) -> float:
    """Seconds of all launches of a point whose frames take `pace` s a pixel."""
    seconds = pace * math.prod(view.size(settings.n))
    return settings.launches * (sum(frames_of(seconds)) * seconds + OVERHEAD)


def choose(
    pairs: Sequence[Pair], views: Sequence[View], settings: Settings, first: Callable[[Spec, View], float]
) -> Plan:
    """Takes phases from the last on while the seconds last, the last one always. `first` renders the small
    picture and returns seconds a pixel. A phase's refusal (DriverError with the status for it) leaves out
    that view, a crash is a failure."""
    plan, begun, ahead = Plan(), time.monotonic(), 0.0
    known: set[Spec] = set()
    for number, pair in enumerate(reversed(pairs)):
        if lacking := [" ".join(found) for spec in pair if (found := registry.missing_isa(spec))]:
            plan.left_out.append(LeftOut(phase=str(pair[0]), reason=f"this CPU lacks {lacking[0]}"))
            continue
        pace: dict[Point, float] = {}
        for spec in (spec for spec in pair if spec not in known):
            pace |= _tried(spec, views, settings.jobs, first, plan)
        ahead += sum(cost(one, view, settings) for (_, view), one in pace.items())
        needed = time.monotonic() - begun + ahead
        if plan.pairs and needed > settings.seconds:
            reason = f"{needed:.0f} s would be needed with it, {settings.seconds:.0f} s there are"
            without = pairs[: len(pairs) - number]
            plan.left_out += [LeftOut(phase=str(phase), reason=reason) for phase, _ in without]
            break
        known |= set(pair)
        plan.pace |= pace
        plan.pairs.insert(0, pair)
    return plan


def _tried(
    spec: Spec, views: Sequence[View], jobs: int, first: Callable[[Spec, View], float], plan: Plan
) -> dict[Point, float]:
    def one(view: View) -> float | DriverError:
        try:
            return first(spec, view)
        except DriverError as error:
            return error

    found = {}
    with ThreadPoolExecutor(jobs) as pool:
        for view, pace in zip(views, pool.map(one, views), strict=True):
            if isinstance(pace, DriverError):
                skipped = pace.status in (run.NO_ISA, run.UNSUPPORTED)
                kept = plan.left_out if skipped else plan.failures
                kept.append(LeftOut(phase=str(spec), scene=view.base, view=view.name, reason=pace.message))
            else:
                found[spec, view] = pace
    return found


def measure(points: Mapping[Point, float], settings: Settings) -> dict[Point, list[float]]:
    """Milliseconds of a frame (median of a launch's timed ones) per launch, every point once a round."""

    def once(point: Point, padding: int) -> float:
        spec, view = point
        size = view.size(settings.n)
        warmup, reps = frames_of(points[point] * math.prod(size))
        return milliseconds(spec, view.scene, size, reps, padding, cpu=settings.cpu, warmup=warmup)

    return run.interleaved(list(points), settings.launches, settings.seed, settings.cpu, once, "time views")


class Pictures:
    """Small pictures, and their errors: to truth while its seconds last (fractals: never), then to the
    baseline; a fractal's 4 × 4 averaged, as one sample of it is chaotic."""

    def __init__(self, settings: Settings) -> None:
        self.settings = settings
        self.references: dict[View, tuple[str, images.Picture]] = {}
        self.general: dict[Point, str] = {}  # why there is no kernel, of phases that generate some

    def size(self, view: View) -> tuple[int, int]:
        return view.size(self.settings.error_n * (hits.FACTOR if view.scene.fractal else 1))

    def path(self, spec: Spec, view: View) -> Path:
        return self.settings.scratch / f"{view.scene.name}-{spec}.exr"

    def first(self, spec: Spec, view: View) -> float:
        """Renders the picture: seconds a pixel. Raises DriverError."""
        width, height = self.size(view)
        how = {"aov": True, "out": self.path(spec, view)}
        made = render(spec, view.scene.path, height, width, **how)
        if made.kernel not in (None, GENERATED):
            self.general[spec, view] = made.kernel
        return made.first_s / (width * height)

    def find_references(self, views: Sequence[View], seconds: float) -> None:
        """Truth's picture of every view as far as the seconds go, the tuned first; else the baseline's."""
        begun, others = time.monotonic(), []
        for view in progress.each(sorted(views, key=lambda v: not v.tuned), "references"):
            size = self.size(view)
            left = seconds - (time.monotonic() - begun)
            cheap = truth.path_of(view.scene, size).exists() or left > TRUTH_PER_PIXEL * math.prod(size)
            if not view.scene.fractal and cheap:
                self.references[view] = "truth", truth.picture(view.scene, size)
            else:
                others.append(view)
        base = Spec.parse(BASE)
        with ThreadPoolExecutor(self.settings.jobs) as pool:
            list(pool.map(lambda view: self.first(base, view), others))
        self.references |= {view: (BASE, images.read(self.path(base, view))) for view in others}

    def errors(self, spec: Spec, view: View) -> Errors:
        name, reference = self.references[view]
        if name == str(spec):
            return {"reference": None, "non_finite": 0}
        image = images.read(self.path(spec, view))
        if name == "truth":
            return {"reference": name} | hits.to_truth(reference, image)
        found = hits.fitting(Row, hits.to_picture(reference, image, view.scene.fractal))
        if not view.scene.fractal:
            found["depth_agree_fraction"] = None
        return {"reference": name} | found


def rows(
    plan: Plan, times: Mapping[Point, Sequence[float]], pictures: Pictures, settings: Settings
) -> list[Row]:
    """One per program and view; `ratio` to its parent where that was timed there too."""
    parent_of = dict(plan.pairs)
    made = []
    for spec in plan.specs:
        parent = parent_of.get(spec)
        for view in dict.fromkeys(view for own, view in times if own == spec):
            ms, base = times[spec, view], times.get((parent, view)) if parent else None
            width, height = view.size(settings.n)
            made.append(
                Row(
                    phase=str(spec),
                    parent=str(parent) if parent else None,
                    scene=view.base,
                    view=view.name,
                    change=view.change,
                    tuned=view.tuned,
                    width=width,
                    n=height,
                    ns=[one * 1e6 for one in ms],
                    general=pictures.general.get((spec, view)),
                    ms=Interval.of(stats.median_interval(ms)),
                    ratio=Interval.of(stats.ratio_interval(base, ms)) if base else None,
                    **pictures.errors(spec, view),
                )
            )
    return made


def study(pairs: Sequence[Pair], views: Sequence[View], settings: Settings) -> tuple[list[Row], Plan]:
    """Everything in about `settings.seconds`. Raises StudyError if nothing ran."""
    begun = time.monotonic()
    pictures = Pictures(settings)
    pictures.find_references(views, TRUTH_SHARE * settings.seconds)
    settings.seconds -= time.monotonic() - begun
    plan = choose(pairs, views, settings, pictures.first)
    if not plan.pace:
        reasons = [one.reason for one in (*plan.failures, *plan.left_out)]
        raise StudyError(f"nothing was measured: {(reasons or ['no phase'])[0]}", cli.CANNOT_RUN)
    cli.doing(f"{len(plan.pairs)} phases on {len(views)} views: {len(plan.pace)} points")
    return rows(plan, measure(plan.pace, settings), pictures, settings), plan
