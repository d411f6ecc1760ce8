"""How cost grows: which points of a series fit its time, their times, evaluations, errors and memory.

Each series has seconds of its own. Its points are taken from the cheapest on, over all programs, three of
each program first, as fewer make no fit: each is rendered once as a picture (which is also its first time),
the next x of that program is foreseen from it, and what would not fit is left out and said. Then all that
were taken are timed in one interleaved run.
"""

from __future__ import annotations

import contextlib
import heapq
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from study import cli, images, registry, run, stats, store
from study.registry import Spec
from study.run import DriverError
from study.scaling_errors import Judge, seen
from study.scaling_series import Picture, Point, Row, Series, foreseen

FILE = "scaling.json"
SHORT, LONG = 0.02, 0.25  # s: below, several frames a launch; above, caches settle within a frame
REPEATED = 5
EARLY, EARLY_SHARE = 3, 0.6  # points that every program should have, and the share of the time they may take
OVERHEAD = 0.06  # s of a launch beside its frames: clocks are calibrated
TRUTH_SHARE = 0.2  # of a series' seconds for truth's pictures
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


def cost(seconds: float, launches: int) -> float:
    """Seconds of all launches of a point."""
    return launches * (sum(frames_of(seconds)) * seconds + OVERHEAD)


def choose(
    series: Series,
    specs: Sequence[Spec],
    seconds: float,
    launches: int,
    first: Callable[[Point], First],
    refused: type[Exception] = DriverError,
) -> Plan:
    """Takes points from the cheapest on, while `seconds` last. `first` renders one, or raises `refused`."""
    plan = Plan()
    known: dict[Spec, list[tuple[float, float]]] = {spec: [] for spec in specs}
    # Equal guesses go by the order of the programs; 0 s: nothing is known before a program's first point.
    queue = [(False, 0.0, 0, number) for number in range(len(specs))]

    def leave(point: Point, reason: str, guess: float | None = None) -> None:
        plan.left_out.append(
            {
                "series": series.name,
                "x": point.x,
                "phase": str(point.spec),
                "reason": reason,
                "foreseen_s": guess,
            }
        )

    while queue:
        late, guess, step, number = heapq.heappop(queue)
        spec = specs[number]
        point = Point(series.name, series.xs[step], spec)
        needed = guess + cost(guess, launches) + OVERHEAD
        if not late and plan.spent + needed > EARLY_SHARE * seconds:
            heapq.heappush(queue, (True, guess, step, number))
            continue
        if plan.spent + needed > seconds:
            what = (
                f"all its launches would take about {needed:.3g} s, of {seconds:.3g} s for the whole series"
            )
            leave(point, what, guess)
            for x in series.xs[step + 1 :]:
                further = foreseen(None, known[spec][-1], x, series.grows) if known[spec] else None
                leave(Point(series.name, x, spec), "beyond a point that took too long", further)
            continue
        begun = time.monotonic()
        try:
            found = first(point)
        except refused as error:
            leave(point, getattr(error, "message", None) or str(error))
            continue
        plan.taken[point] = found
        plan.spent += time.monotonic() - begun + cost(found.seconds, launches)
        trail = known[spec]
        trail.append((point.x, found.seconds))
        if step + 1 < len(series.xs):
            before = trail[-2] if len(trail) > 1 else None
            ahead = foreseen(before, trail[-1], series.xs[step + 1], series.grows)
            heapq.heappush(queue, (step + 1 >= EARLY, ahead, step + 1, number))
    return plan


def render(point: Point, picture: Picture, folder: Path, cpu: int) -> First:
    """The point's first frame, with its planes unless it is too large for that. Raises DriverError."""
    keep = picture.width * picture.height <= MOST_JUDGED
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
    points: dict[Point, First], pictures: dict[int, Picture], settings: Settings
) -> dict[Point, list[float]]:
    """Nanoseconds of a frame (median of a launch's timed ones) per launch, every point once a round."""

    def once(point: Point, padding: int) -> float:
        picture = pictures[point.x]
        warmup, reps = frames_of(points[point].seconds)
        options = {**picture.options, "warmup": warmup, "reps": reps}
        options |= {"cpu": settings.cpu, "env_bytes": padding}
        made = run.frames(point.spec, picture.path, picture.height, picture.width, **options)
        with contextlib.closing(made):
            return float(np.median([frame["ns"] for frame in made if not frame["warmup"]]))

    name = next(iter(points)).series
    return run.interleaved(list(points), settings.launches, settings.seed, settings.cpu, once, f"time {name}")


@dataclass
class Settings:
    """What all series share. `scratch`: for pictures; `keep`: the run's folder, for thumbnails."""

    launches: int
    seed: int
    cpu: int
    scratch: Path
    keep: Path


@dataclass
class Found:
    """Of one series: its rows, what was left out, thumbnails of generated scenes, seconds it took."""

    rows: list[Row]
    left_out: list[Row]
    thumbnails: list[Row]
    seconds: float


def study(series: Series, specs: Sequence[Spec], seconds: float, settings: Settings) -> Found:
    """Measures one series in about `seconds`."""
    begun = time.monotonic()
    wanted = [s for s in specs if not series.threads_only or registry.find_phase(s.phase).threads]
    pictures: dict[int, Picture] = {}

    def first(point: Point) -> First:
        if point.x not in pictures:
            pictures[point.x] = series.picture(point.x)
        return render(point, pictures[point.x], settings.scratch, settings.cpu)

    plan = choose(series, wanted, seconds * (1 - TRUTH_SHARE), settings.launches, first)
    if not plan.taken:
        return Found([], plan.left_out, [], time.monotonic() - begun)
    judge = Judge(series, pictures, seconds * TRUTH_SHARE)
    found: dict[Point, Row] = {}
    thumbnails = []
    for x in sorted({point.x for point in plan.taken}):
        made = {p: one.picture for p, one in plan.taken.items() if p.x == x and one.picture}
        made = dict(sorted(made.items(), key=lambda item: wanted.index(item[0].spec)))
        for point, row in (judge.errors(x, made) if made else {}).items():
            found[point] = seen(made[point]) | row
        if made and series.generated:
            thumbnails.append(thumbnail(series, x, next(iter(made.values())), pictures[x], settings.keep))
    times = measure(plan.taken, pictures, settings)
    rows = [
        row_of(point, pictures[point.x], plan.taken[point], times[point]) | found.get(point, {})
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
    return store.read_rows(path, "scaling.py", {"series", "ns"})


def say_left_out(left_out: Sequence[Row]) -> None:
    """One line per series and program: from which x on, and why."""
    first: dict[tuple[str, str], Row] = {}
    for row in left_out:
        first.setdefault((row["series"], row["phase"]), row)
    for (series, phase), row in first.items():
        cli.say(f"left out {phase} in {series} from {row['x']} on: {row['reason']}")
