"""How cost grows: which points of a series fit its time, their times, evaluations and errors.

Each series has seconds of its own. Its points are taken by their worth: the newest phases before the others,
of each the points that a fit needs before the rest. Each is rendered once as a picture, which is also its
first time; the next x of that program is foreseen from it. What would not fit is left out and said. Then all
that were taken are timed in one interleaved run.
"""

import math
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from study.core import registry, run
from study.core.registry import Spec
from study.core.run import DriverError
from study.experiments.scaling.schema import Crowd, Fit, LeftOut, Row
from study.experiments.scaling.series import Picture, Point, Series, foreseen
from study.measuring import hits
from study.measuring.hits import Errors
from study.measuring.launches import milliseconds, render
from study.numbers import power_laws, stats
from study.numbers.power_laws import Law
from study.numbers.schema import Interval
from study.pictures import images
from study.truth import truth

SHORT, LONG = 0.02, 0.25  # s: below, several frames a launch; above, caches settle within a frame
REPEATED = 5
DRAWN_FRAMES = 3  # at least, of a launch with a scene of its own: their median is one's cost
FAST = 3  # so many of the ladder's last phases come before all others
EARLY_SHARE = 0.6  # of the time: the others' first points, before the newest phases' further ones
OVERHEAD = 0.05  # s of a launch beside its frames
TRUTH_SHARE = 0.2  # of a series' seconds for truth's pictures
FEW, MANY = 16, 4096  # shapes
CROWD, SCATTERED = "crowd", "shapes-scattered"  # the series that have them
NEAR = 0.05  # exponents that close are the same
MOST_JUDGED = 2_100_000  # pixels of a picture that is kept with its planes; larger ones are only timed


@dataclass
class First:
    seconds: float
    picture: Path | None = None


@dataclass
class Plan:
    """Points taken with their first frames, in the order taken, and what was left out or refused. `spent`:
    seconds, the timing that is still to come included."""

    taken: dict[Point, First] = field(default_factory=dict)
    left_out: list[LeftOut] = field(default_factory=list)
    spent: float = 0.0

    def leave(self, point: Point, reason: str, foreseen_s: float | None = None) -> None:
        series, x, phase = point.series, point.x, str(point.spec)
        self.left_out.append(LeftOut(series=series, x=x, phase=phase, reason=reason, foreseen_s=foreseen_s))


@dataclass
class Settings:
    """What all series share. `scratch`: for pictures; `truth_left`: seconds that earlier series left."""

    launches: int
    seed: int
    cpu: int
    scratch: Path
    truth_left: float = 0.0


def frames_of(series: Series, seconds: float) -> tuple[int, int]:
    """Warm-up and timed frames of a launch, by the time of one frame in s. Of a scene that is launched once
    a mean would take a disturbed frame whole."""
    warmup, reps = (0, 1) if seconds > LONG else (1, 1) if seconds > SHORT else (1, REPEATED)
    return warmup, max(reps, DRAWN_FRAMES) if series.drawn else reps


def cost(seconds: float, launches: int, series: Series) -> float:
    return launches * (sum(frames_of(series, seconds)) * seconds + OVERHEAD)


def newest(specs: Iterable[Spec]) -> list[Spec]:
    """Those among the ladder's last FAST phases, the last first."""
    ladder = list(registry.ladder())[-FAST:]
    return sorted((s for s in specs if str(s) in ladder), key=lambda s: -ladder.index(str(s)))


def choose(
    series: Series, specs: Sequence[Spec], seconds: float, launches: int, first: Callable[[Point], First]
) -> Plan:
    """Takes points by their worth (the module's head), while `seconds` last. `first` renders one, or raises
    DriverError: that point is left out, and the program's larger ones."""
    plan, fast = Plan(), newest(specs)
    others = [spec for spec in reversed(specs) if spec not in fast]
    later = [x for x in series.xs if x not in series.early]
    known: dict[Spec, list[tuple[float, float]]] = {spec: [] for spec in specs}
    beyond: dict[Spec, tuple[float, str]] = {}  # x from which on a program is left out, and why

    def points(some: Iterable[Spec], xs: Iterable[int]) -> list[Point]:
        return [Point(series.name, x, spec) for x in xs for spec in some]

    def taken(point: Point, most: float) -> bool:
        """Whether it was taken or left out; False where it would need more than `most` seconds, which are
        not all."""
        spec = point.spec
        guess = foreseen(known[spec], point.x, series.grows)
        limit, reason = beyond.get(spec, (math.inf, ""))
        if point.x > limit:
            plan.leave(point, f"beyond a point that {reason}", guess or None)
            return True
        needed = (launches if series.drawn else 1) * (guess + OVERHEAD) + cost(guess, launches, series)
        if plan.spent + needed > most:
            if most == seconds:
                plan.leave(point, too_long(needed, seconds), guess)
                beyond[spec] = point.x, "took too long"
            return most == seconds
        begun = time.monotonic()
        try:
            found = first(point)
        except DriverError as error:
            plan.leave(point, error.message)
            beyond[spec] = point.x, "was refused"
            return True
        finally:
            plan.spent += time.monotonic() - begun
        known[spec].append((point.x, found.seconds))
        launching = cost(found.seconds, launches, series)
        if plan.spent + launching > seconds and plan.taken:
            plan.leave(point, too_long(launching, seconds), found.seconds)
        else:
            plan.spent += launching
            plan.taken[point] = found
        return True

    for spec in fast:
        for point in points([spec], series.early):
            taken(point, seconds)
    some = [*points(fast, later), *points(others, series.early)]
    postponed = [point for point in some if not taken(point, EARLY_SHARE * seconds)]
    for point in sorted([*postponed, *points(others, later)], key=lambda point: point.x):
        taken(point, seconds)
    return plan


def too_long(needed: float, seconds: float) -> str:
    left = max(seconds, 0)
    return f"all its launches would take about {needed:.3g} s, of {left:.3g} s for the whole series"


class Measuring:
    def __init__(self, series: Series, settings: Settings, seconds: float) -> None:
        self.series, self.settings = series, settings
        self.truth_left = settings.truth_left + TRUTH_SHARE * seconds
        self.pictures: dict[int, Picture] = {}
        self.trail: list[tuple[float, float]] = []  # x and seconds of truth's pictures

    def first(self, point: Point) -> First:
        """The first frame, of all scenes that it will be launched on. Raises DriverError."""
        if point.x not in self.pictures:
            self.pictures[point.x] = self.series.picture(point.x)
        some = [self.pictures[point.x]]
        if self.series.drawn:  # made, and its kernel compiled, before anything is timed
            some += [self.series.picture(point.x, k) for k in range(1, self.settings.launches)]
        made = [self.render(point, picture) for picture in some]
        made[0].seconds = float(np.mean([one.seconds for one in made]))
        return made[0]

    def render(self, point: Point, picture: Picture) -> First:
        """One frame, with its planes unless it is too large for that. Raises DriverError."""
        keep = self.series.kept and picture.width * picture.height <= MOST_JUDGED
        out = self.settings.scratch / f"{point.series}-{point.x}-{point.spec}.exr" if keep else None
        how = {"cpu": self.settings.cpu, "aov": keep, "out": out, **picture.options}
        made = render(point.spec, picture.scene.path, picture.height, picture.width, **how)
        return First(made.first_s, out)

    def times(self, points: Mapping[Point, First]) -> dict[Point, list[float]]:
        """Milliseconds of a frame (median of a launch's timed ones) per launch, every point once a round."""
        launched = dict.fromkeys(points, 0)

        def once(point: Point, padding: int) -> float:
            number, x = launched[point], point.x
            picture = self.series.picture(x, number) if self.series.drawn else self.pictures[x]
            launched[point] += 1
            warmup, reps = frames_of(self.series, points[point].seconds)
            how = {"cpu": self.settings.cpu, "warmup": warmup, **picture.options}
            size = picture.width, picture.height
            return milliseconds(point.spec, picture.scene, size, reps, padding, **how)

        about, how = f"time {self.series.name}", self.settings
        return run.interleaved(list(points), how.launches, how.seed, how.cpu, once, about)

    def truth(self, x: int) -> images.Picture | None:
        """Truth's picture, with the scene's own step cap; None where it would take too long."""
        picture = self.pictures[x]
        size = picture.width, picture.height
        if truth.path_of(picture.scene, size).exists():
            return truth.picture(picture.scene, size)
        if self.truth_left <= 0 or foreseen(self.trail, x, self.series.grows) > self.truth_left:
            return None
        begun = time.monotonic()
        found = truth.picture(picture.scene, size)
        took = time.monotonic() - begun
        self.truth_left -= took
        self.trail.append((x, took))
        return found

    def errors(self, x: int, made: Mapping[Point, Path]) -> dict[Point, Errors]:
        """Errors of the kept pictures of one x: to truth, else to what stands for it."""
        if self.pictures[x].scene.fractal:
            why_none = "a fractal's single samples are chaotic: make accuracy"
            return {point: {"reference": None, "why_none": why_none} for point in made}
        exact = self.truth(x)
        base = finest(made)
        found: dict[Point, Errors] = {}
        for point, path in made.items():
            image = images.read(path)
            if exact is not None:
                found[point] = {"reference": "truth"} | hits.to_truth(exact, image)
            elif point == base:
                found[point] = {"reference": None, "why_none": "is the reference here itself"}
            else:
                reference = images.read(made[base])
                found[point] = {"reference": str(base.spec)} | hits.to_picture(reference, image)
        return {point: hits.fitting(Row, row) | seen(made[point], point.spec) for point, row in found.items()}

    def row(self, point: Point, ms: Sequence[float], more: Errors) -> Row:
        """Times are kept launch by launch, so that every fit can be made again from the file."""
        picture = self.pictures[point.x]
        ns = [one * 1e6 for one in ms]
        pixels = picture.width * picture.height
        return Row(
            series=point.series,
            x=point.x,
            phase=str(point.spec),
            scene=picture.scene.name,
            n=picture.height,
            width=picture.width,
            threads=picture.threads,
            max_steps=picture.max_steps,
            ns=ns,
            ms=Interval.of(stats.median_interval(ms)),
            ns_per_pixel=Interval.of(stats.median_interval([one / pixels for one in ns])),
            scenes=len(ns) if self.series.drawn else None,
            **more,
        )


def finest(made: Iterable[Point]) -> Point:
    """What stands for truth: the first double-precision program on the ladder, else the first of all."""
    points = list(made)
    doubles = [p for p in points if registry.find_phase(p.spec.phase).precision == "double"]
    return (doubles or points)[0]


def seen(path: Path, spec: Spec) -> Errors:
    """What a kept picture says of itself. A phase that meets shapes by closed forms has a 1 in its plane of
    evaluations for every camera ray, marched or not: that is no count, and none is given."""
    made, closed = images.read(path), registry.find_phase(spec.phase).exact_hits
    return {
        "evals_per_ray": None if closed else float(np.mean(made["evals"], dtype=np.float64)),
        "coverage": float(np.mean(made["id"] >= 0)),
        "non_finite": images.non_finite(made),
    }


def study(
    series: Series, specs: Sequence[Spec], seconds: float, settings: Settings
) -> tuple[list[Row], list[LeftOut]]:
    """Measures one series in about `seconds`: rows, and what was left out. Truth's pictures may take their
    share of them, and what earlier series left of theirs."""
    wanted = newest(specs) if series.fast_only else list(specs)
    if series.varies == "threads":
        wanted = [spec for spec in wanted if registry.find_phase(spec.phase).threads]
    work = Measuring(series, settings, seconds)
    plan = choose(series, wanted, seconds * (1 - TRUTH_SHARE), settings.launches, work.first)
    if not plan.taken:
        return [], plan.left_out
    points = sorted(plan.taken, key=lambda point: (wanted.index(point.spec), point.x))
    told: dict[Point, Errors] = {}
    for x in sorted({point.x for point in points}):
        of_x = [(point, plan.taken[point].picture) for point in points if point.x == x]
        if made := {point: path for point, path in of_x if path}:
            told |= work.errors(x, made)
    settings.truth_left = work.truth_left
    times = work.times(plan.taken)
    rows = [work.row(point, times[point], told.get(point, {})) for point in points]
    return rows, plan.left_out


# --- what is read from the rows: fits beside the law of the paper, many shapes beside few


def law(points: Sequence[tuple[float, Sequence[float]]], exact: bool = False) -> Law:
    xs, samples = zip(*points, strict=True)
    return power_laws.fit(xs, samples, exact=exact)


def fits(rows: Sequence[Row], known: Iterable[Series]) -> list[Fit]:
    """Per series and program with at least two points: the laws of time and of evaluations."""
    made = []
    for series in known:
        if not series.kept:
            continue  # two points: their ratio is in a table of its own
        mine = [row for row in rows if row.series == series.name]
        for phase in dict.fromkeys(row.phase for row in mine):
            points = [row for row in mine if row.phase == phase]
            counted = [(row.x, [row.evals_per_ray]) for row in points if row.evals_per_ray]
            if len(points) < 2:
                continue
            time = law([(row.x, row.ns) for row in points])
            made.append(
                Fit(
                    series=series.name,
                    title=series.title,
                    phase=phase,
                    paper=series.paper,
                    time=time,
                    evals=law(counted, exact=True) if len(counted) > 1 else None,
                    verdict=verdict(time, series.paper),
                )
            )
    return made


def verdict(found: Law, paper: float | None) -> str:
    """What the measured law is beside the paper's exponent, an upper bound."""
    value, low, high = found.exponent.value or 0, found.exponent.low, found.exponent.high
    if found.holds is None:
        return "two points: any law goes through them"
    if not found.holds:
        return "no power law: off at " + ", ".join(f"{x:,g}" for x in found.off)
    if paper is None:
        return "a power law"
    if low is None or high is None:
        return "too few launches"
    if abs(value - paper) <= NEAR or low <= paper <= high:
        return "as the paper's law"
    return "grows slower than the paper's bound" if value < paper else "grows faster than the paper's law"


def crowds(rows: Sequence[Row], phases: Sequence[str]) -> list[Crowd]:
    """4,096 scattered shapes against 16 at equal coverage, per program."""
    made = []
    for phase in phases:
        own = [row for row in rows if row.phase == phase]
        mine = {row.x: row for row in own if row.series == CROWD}
        if not {FEW, MANY} <= mine.keys():
            mine = {row.x: row for row in own if row.series == SCATTERED}
        most = max(mine, default=0)
        few, many = mine.get(FEW), mine.get(most if most > FEW else MANY)
        if few is None or many is None:
            continue
        crowd = Crowd(phase=phase, n=many.n, shapes=int(most), ratio=over(many, few))
        crowd.scenes = [one.scenes or 1 for one in (few, many)]
        crowd.coverage = [covered(own, x) for x in (FEW, most)]
        if few.scenes and many.scenes:
            crowd.mean_ms = [float(np.mean(one.ns)) * 1e-6 for one in (few, many)]
            crowd.by_medians = Interval.of(stats.ratio_interval(many.ns, few.ns, rounds=False))
        made.append(crowd)
    return made


def over(many: Row, few: Row) -> Interval:
    """Time over time: of one scene each by their medians, since what disturbs a launch is no part of it; of a
    scene for every launch by their means, since what a scene costs is."""
    ratio = stats.mean_ratio_interval if many.scenes and few.scenes else stats.ratio_interval
    return Interval.of(ratio(many.ns, few.ns))


def covered(rows: Sequence[Row], shapes: float) -> float | None:
    """Share of pixels hit of that many scattered shapes, from whichever picture was kept."""
    some = (row.coverage for row in rows if row.scene.startswith(f"scattered-{shapes:.0f}-"))
    return next((share for share in some if share is not None), None)
