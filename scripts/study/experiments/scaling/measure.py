"""How cost grows: which points of a series fit its time, their times, evaluations, errors and memory.

Each series has seconds of its own. Its points are taken by their worth: the newest rungs before the others,
of each the points that a fit or a goal needs before the rest, the rest from the cheapest on. Each is rendered
once as a picture (which is also its first time), the next x of that program is foreseen from it, and what
would not fit is left out and said. Then all that were taken are timed in one interleaved run.
"""

from __future__ import annotations

import contextlib
import heapq
import math
import signal
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from study.core import cli, registry, run
from study.core.registry import Spec
from study.core.run import DriverError
from study.experiments.scaling.errors import Judge, seen
from study.experiments.scaling.schema import Scaling
from study.experiments.scaling.series import EARLY, Picture, Point, Row, Series, guessed
from study.numbers import stats
from study.pictures import images

FILE = "scaling.json"
SHORT, LONG = 0.02, 0.25  # s: below, several frames a launch; above, caches settle within a frame
REPEATED = 5
DRAWN_FRAMES = 3  # at least, of a launch with a scene of its own: their median is one's cost
FAST = 3  # so many of the ladder's last rungs come before all others
LATE = FAST + 2  # turn of what comes last
EARLY_SHARE = 0.6  # of the time: what one kind of points may take before the next kind has had its turn
OVERHEAD = 0.1  # s of a launch beside its frames: the process, and the calibration of clocks
TRUTH_SHARE = 0.2  # of a series' seconds for truth's pictures
BEYOND_MEMORY = "beyond a point that memory did not suffice for"
MOST_JUDGED = 2_100_000  # pixels of a picture that is kept with its planes; larger ones are only timed


@dataclass
class First:
    """What a point's first frame told: seconds, and its picture where that was kept."""

    seconds: float
    above_frame_mib: float
    picture: Path | None


@dataclass
class Plan:
    """Points taken with their first frames, in the order taken, and what was left out or refused."""

    taken: dict[Point, First] = field(default_factory=dict)
    left_out: list[Row] = field(default_factory=list)
    spent: float = 0.0  # s, the timing that is still to come included


def frames_of(seconds: float) -> tuple[int, int]:
    """Warm-up and timed frames of a launch, by the time of one frame in s."""
    return (0, 1) if seconds > LONG else (1, 1) if seconds > SHORT else (1, REPEATED)


def frames_in(series: Series, seconds: float) -> tuple[int, int]:
    """The same of a series. Of a scene that is launched once a mean would take a disturbed frame whole."""
    warmup, reps = frames_of(seconds)
    return warmup, max(reps, DRAWN_FRAMES) if series.drawn else reps


def cost(seconds: float, launches: int, series: Series) -> float:
    """Seconds of all launches of a point."""
    return launches * (sum(frames_in(series, seconds)) * seconds + OVERHEAD)


def newest(specs: Sequence[Spec]) -> list[Spec]:
    """Those among the ladder's last FAST rungs, the last first."""
    ladder = list(registry.ladder())[-FAST:]
    return sorted((s for s in specs if str(s) in ladder), key=lambda s: -ladder.index(str(s)))


def choose(
    series: Series,
    specs: Sequence[Spec],
    seconds: float,
    launches: int,
    first: Callable[[Point], First],
    refused: type[Exception] = DriverError,
) -> Plan:
    """Takes points by their worth (the module's head), while `seconds` last. `first` renders one, or raises
    `refused`: that point alone is left out (where memory was short: and the program's larger ones, unasked),
    and what the refusal took is spent."""
    plan, order, fast = Plan(), series.order, newest(specs)
    first_ones = len(series.first) or EARLY
    known: dict[Spec, list[tuple[float, float]]] = {spec: [] for spec in specs}
    ready: dict[Spec, list[int]] = {spec: list(order) for spec in specs}  # places in `order` still to come

    def kind(spec: Spec, step: int) -> int:
        """Of a point: the newest rungs' first ones one rung after the other, the rest of theirs; then the
        others' first ones, and theirs."""
        early = step < first_ones
        if spec in fast:
            return fast.index(spec) if early else FAST
        return FAST + 1 if early else LATE

    def push(number: int, step: int, later: bool = False) -> None:
        spec = specs[number]
        if step < len(order):
            guess = guessed(known[spec], order[step], series.grows)
            heapq.heappush(queue, (LATE if later else kind(spec, step), guess, step, number))

    def leave(point: Point, reason: str, guess: float | None = None) -> None:
        about = {"series": series.name, "x": point.x, "phase": str(point.spec)}
        plan.left_out.append(about | {"reason": reason, "foreseen_s": guess})

    def leave_beyond(point: Point, step: int, reason: str) -> None:
        """The program's larger points that are still to come: they are not asked."""
        spec = point.spec
        for x in [x for x in ready[spec] if x > point.x and x in order[step + 1 :]]:
            ready[spec].remove(x)
            further = guessed(known[spec], x, series.grows) if known[spec] else None
            leave(Point(series.name, x, spec), reason, further)

    # Equal guesses go by the order of the programs; 0 s: nothing is known before a program's first point.
    queue: list[tuple[int, float, int, int]] = []
    for number in range(len(specs)):
        push(number, 0)
    while queue:
        turn, guess, step, number = heapq.heappop(queue)
        spec = specs[number]
        point = Point(series.name, order[step], spec)
        if point.x not in ready[spec]:  # beyond one that took too long, or had no memory
            push(number, step + 1)
            continue
        firsts = launches if series.drawn else 1  # how many scenes `first` makes and renders
        needed = firsts * (guess + OVERHEAD) + cost(guess, launches, series)
        # Of the time, the newest rungs' further points leave a share for the others' first ones, as those do
        # for whatever comes last.
        if FAST <= turn < LATE and plan.spent + needed > EARLY_SHARE * seconds:
            push(number, step, later=True)
            continue
        if plan.spent + needed > seconds:
            leave(point, too_long(needed, seconds), guess)
            leave_beyond(point, step, "beyond a point that took too long")
            push(number, step + 1)
            continue
        begun = time.monotonic()
        try:
            found = first(point)
        except refused as error:
            leave(point, why(error))
            if short_of_memory(error):
                leave_beyond(point, step, BEYOND_MEMORY)
            push(number, step + 1)  # what comes later in the order may be smaller
            continue
        finally:
            plan.spent += time.monotonic() - begun
        known[spec].append((point.x, found.seconds))
        launching = cost(found.seconds, launches, series)
        if plan.spent + launching > seconds and plan.taken:
            leave(point, too_long(launching, seconds), found.seconds)
        else:
            plan.spent += launching
            plan.taken[point] = found
        push(number, step + 1)
    return plan


def short_of_memory(error: Exception) -> bool:
    """Whether the driver said so, or ended as the kernel ends what it has no memory for."""
    return getattr(error, "status", None) in (run.NO_MEMORY, -signal.SIGKILL)


def why(error: Exception) -> str:
    """What a table says of a driver that did not render."""
    said = getattr(error, "message", None) or str(error)
    killed = getattr(error, "status", None) == -signal.SIGKILL
    return said + " (as the kernel does where memory is short)" * killed


def too_long(needed: float, seconds: float) -> str:
    return f"all its launches would take about {needed:.3g} s, of {seconds:.3g} s for the whole series"


def render(point: Point, picture: Picture, folder: Path, cpu: int, kept: bool = True) -> First:
    """The point's first frame, with its planes unless it is too large for that. Raises DriverError."""
    keep = kept and picture.width * picture.height <= MOST_JUDGED
    out = folder / f"{point.series}-{point.x}-{point.spec}.exr" if keep else None
    size = picture.height, picture.width
    made = run.render(point.spec, picture.path, *size, cpu=cpu, aov=keep, out=out, **picture.options)
    frame = made["frames"][0]
    planes = 9 if keep else 3  # R G B, and with --aov Z, id, N.x N.y N.z, evals
    return First(frame["ns"] * 1e-9, above_frame(frame["max_rss_kib"], picture, planes), out)


def above_frame(max_rss_kib: float, picture: Picture, planes: int = 3) -> float:
    """MiB of the process at its peak beyond the frame's float planes; NaN where the system does not tell."""
    if max_rss_kib <= 0:
        return math.nan
    return max_rss_kib / 1024 - picture.width * picture.height * planes * 4 / 2**20


def measure(
    series: Series, points: dict[Point, First], pictures: dict[int, Picture], settings: Settings
) -> dict[Point, list[float]]:
    """Nanoseconds of a frame (median of a launch's timed ones) per launch, every point once a round."""
    launched = dict.fromkeys(points, 0)

    def once(point: Point, padding: int) -> float:
        picture = series.picture(point.x, launched[point]) if series.drawn else pictures[point.x]
        launched[point] += 1
        warmup, reps = frames_in(series, points[point].seconds)
        options = {**picture.options, "warmup": warmup, "reps": reps}
        options |= {"cpu": settings.cpu, "env_bytes": padding}
        made = run.frames(point.spec, picture.path, picture.height, picture.width, **options)
        with contextlib.closing(made):
            return float(np.median([frame["ns"] for frame in made if not frame["warmup"]]))

    about = f"time {series.name}"
    return run.interleaved(list(points), settings.launches, settings.seed, settings.cpu, once, about)


@dataclass
class Settings:
    """What all series share. `scratch`: for pictures; `keep`: the run's folder, for thumbnails."""

    launches: int
    seed: int
    cpu: int
    scratch: Path
    keep: Path
    truth_left: float = 0.0  # s


@dataclass
class Found:
    """Of one series: its rows, what was left out, thumbnails of generated scenes, seconds it took."""

    rows: list[Row]
    left_out: list[Row]
    thumbnails: list[Row]
    seconds: float


def study(series: Series, specs: Sequence[Spec], seconds: float, settings: Settings) -> Found:
    """Measures one series in about `seconds`. Truth's pictures may take their share of them, and what earlier
    series left of theirs; what one took too much, the next ones go without."""
    begun = time.monotonic()
    wanted = [s for s in specs if not series.threads_only or registry.find_phase(s.phase).threads]
    if series.fast_only:
        wanted = [s for s in wanted if s in newest(specs)]
    pictures: dict[int, Picture] = {}

    def first(point: Point) -> First:
        if point.x not in pictures:
            pictures[point.x] = series.picture(point.x)
        some = [pictures[point.x]]
        if series.drawn:  # made, and its kernel compiled, before anything is timed
            some += [series.picture(point.x, number) for number in range(1, settings.launches)]
        frames = [render(point, one, settings.scratch, settings.cpu, series.kept) for one in some]
        return replace(frames[0], seconds=float(np.mean([one.seconds for one in frames])))

    plan = choose(series, wanted, seconds * (1 - TRUTH_SHARE), settings.launches, first)
    if not plan.taken:
        return Found([], plan.left_out, [], time.monotonic() - begun)
    judge = Judge(series, pictures, settings.truth_left + seconds * TRUTH_SHARE)
    found: dict[Point, Row] = {}
    thumbnails = []
    for x in sorted({point.x for point in plan.taken}):
        made = {p: one.picture for p, one in plan.taken.items() if p.x == x and one.picture}
        made = dict(sorted(made.items(), key=lambda item: wanted.index(item[0].spec)))
        for point, row in (judge.errors(x, made) if made else {}).items():
            found[point] = seen(made[point], registry.find_phase(point.spec.phase).exact_hits) | row
        if made and series.generated:
            thumbnails.append(thumbnail(series, x, next(iter(made.values())), pictures[x], settings.keep))
    settings.truth_left = judge.left
    times = measure(series, plan.taken, pictures, settings)
    rows = [
        row_of(point, pictures[point.x], plan.taken[point], times[point])
        | ({"scenes": len(times[point])} if series.drawn else {})
        | found.get(point, {})
        for point in sorted(plan.taken, key=lambda p: (wanted.index(p.spec), p.x))
    ]
    return Found(rows, plan.left_out, spaced(thumbnails), time.monotonic() - begun)


def spaced(some: list[Row], most: int = 4) -> list[Row]:
    """At most that many of them, evenly, the first and the last among them."""
    places = {round(i * (len(some) - 1) / (most - 1)) for i in range(most)} if some else set()
    return [some[place] for place in sorted(places)]


def thumbnail(series: Series, x: int, kept: Path, picture: Picture, folder: Path) -> Row:
    """Writes the picture as PNG into the run's images, and says of which scene it is."""
    made = images.read(kept)
    name = f"images/scaling-{picture.scene}.png"
    images.write_png(folder / name, images.to_display(images.rgb(made)))
    hit = float(np.mean(made["id"] >= 0))
    return {"series": series.name, "x": x, "scene": picture.scene, "coverage": hit, "picture": name}


def row_of(point: Point, picture: Picture, first: First, ns: list[float]) -> Row:
    """Times are kept launch by launch, so that every fit can be made again from the file."""
    pixels = picture.width * picture.height
    return {
        **{"series": point.series, "x": point.x, "phase": str(point.spec), "scene": picture.scene},
        **{"n": picture.height, "width": picture.width, "threads": picture.threads},
        **{"max_steps": picture.max_steps, "ns": ns},
        "ms": stats.median_interval([one * 1e-6 for one in ns]),
        "ns_per_pixel": stats.median_interval([one / pixels for one in ns]),
        "above_frame_mib": first.above_frame_mib,
    }


def read(path: Path) -> dict[str, Any]:
    """A run's scaling.json; without that file no row. Raises StudyError for another thing's JSON."""
    if not path.exists():
        return {"rows": [], "left_out": [], "fits": [], "memory": [], "goals": []}
    return Scaling.read(path)


def say_left_out(left_out: Sequence[Row]) -> None:
    """One line per series and program: from which x on, and why."""
    first: dict[tuple[str, str], Row] = {}
    for row in left_out:
        first.setdefault((row["series"], row["phase"]), row)
    for (series, phase), row in first.items():
        cli.say(f"left out {phase} in {series} from {row['x']} on: {row['reason']}")
