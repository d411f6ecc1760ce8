"""Frame rates: how many finished pictures a second, with what spread, and how far from the double picture.

A frame is the picture as displayed (render --display): phase_render on every core, and on as many the
presenting (gamma, 8 bits) of a phase that does not do it in its tiles; what the driver calibrates between two
frames is in neither. Newest phases first, while the seconds last.
"""

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from study.core import registry, run, scene_json, store
from study.core.cli import StudyError
from study.core.registry import Scene, Spec
from study.core.run import DriverError
from study.experiments.frames.schema import LeftOut, Row
from study.measuring import hits, launches, views
from study.numbers import schema, stats
from study.numbers.schema import PictureErrors
from study.numbers.stats import Interval
from study.pictures import images

HEIGHTS = {"scene0": 1080, "mandelbulb": 720}
OWN, HALF = "the scene's own", "half a pixel"  # hit distances
# Coarse hit distances that secondary rays start off the surface. A march that is within the hit distance at
# its first step ends there, lit: so is all of a floor that faces the light by less than 1/AWAY. With 3, as at
# first, most of the Mandelbulb's (n = 90, to truth: phases that march it 11.2 dB; with 10 50.3 dB).
AWAY = 10
MOST_FRAMES, LEAST_FRAMES, LAUNCH_SECONDS = 20, 3, 1.0  # timed ones of a launch; s that they may take
OVERHEAD, A_FRAME = 0.05, 0.02  # s beside a launch's frames and beside each: clocks are calibrated
ENOUGH = 100  # frames for a 99th percentile
PHASE = "phase"  # whose work presenting is; else the driver's


@dataclass(frozen=True)
class Case:
    """A scene at a size, by its own hit distance or another (scene units)."""

    scene: str
    height: int
    hit: str
    hit_distance: float
    path: Path

    def __str__(self) -> str:
        return f"{self.scene}, {self.hit}"


@dataclass(frozen=True)
class Settings:
    launches: int
    threads: int
    seed: int
    seconds: float
    scratch: Path


def half_pixel(scene: Scene, height: int) -> float:
    """Half of what a pixel in the middle covers as far away as the shapes are in the mean, in scene units."""
    camera = scene_json.read(scene.data).camera
    away = float(np.linalg.norm(views.pivot(scene.data) - np.array(camera.position)))
    return math.tan(math.radians(camera.vertical_fov_degrees) / 2) / height * away


def coarser(data: dict[str, Any], hit_distance: float) -> dict[str, Any]:
    """The scene with that hit distance, and secondary rays that start AWAY of them off the surface."""
    offset = max(scene_json.read(data).march.surface_offset, AWAY * hit_distance)
    return data | {"march": data.get("march", {}) | {"hit_distance": hit_distance, "surface_offset": offset}}


def cases(names: Sequence[str], folder: Path, height: int | None = None) -> list[Case]:
    """Both hit distances of each scene; `folder`: for the files. Raises StudyError for one without a size."""
    made = []
    for name in dict.fromkeys(names):
        scene = registry.find_scene(name)
        n = height or HEIGHTS.get(name)
        if n is None:
            raise StudyError(f"{name} has no size in frames a second, as {', '.join(HEIGHTS)} have: give -n")
        made.append(Case(name, n, OWN, scene_json.read(scene.data).march.hit_distance, scene.path))
        half = half_pixel(scene, n)
        path = folder / f"{name}-half-pixel-{n}.json"
        store.write_json(path, coarser(scene.data, half))
        made.append(Case(name, n, HALF, half, path))
    return made


def threaded(names: Sequence[str] | None) -> list[Spec]:
    """Phases with threads, or those named. Raises StudyError."""
    if names is None:
        return [Spec.parse(name) for name, phase in registry.ladder().items() if phase.threads]
    found = [Spec.parse(name) for name in dict.fromkeys(names)]
    for spec in found:
        if registry.find_phase(spec.phase).family == registry.TRUTH:
            raise StudyError(f"{spec}: is truth itself; name phases that are to be timed")
    return found


def reps_of(seconds: float) -> int:
    """Timed frames of a launch, by the time of one in s."""
    return max(LEAST_FRAMES, min(MOST_FRAMES, int(LAUNCH_SECONDS / seconds)))


def cost(seconds: float, launches: int) -> float:
    return launches * ((reps_of(seconds) + 1) * (seconds + A_FRAME) + OVERHEAD)


def choose(
    specs: Sequence[Spec],
    wanted: Sequence[Case],
    settings: Settings,
    first: Callable[[Spec, Case], float],
    clock: Callable[[], float] = time.monotonic,
) -> tuple[dict[tuple[Spec, Case], float], list[LeftOut]]:
    """A first frame's seconds of all (phase, case) that fit the time, the newest phases first; the rest."""
    taken: dict[tuple[Spec, Case], float] = {}
    left_out: list[LeftOut] = []
    begun, ahead = clock(), 0.0
    for spec in reversed(specs):
        if lacking := registry.missing_isa(spec):
            left_out.append(LeftOut(phase=str(spec), reason=f"this CPU lacks {' '.join(lacking)}"))
            continue
        for case in wanted:
            leave = partial(LeftOut, phase=str(spec), scene=case.scene, hit=case.hit)
            if taken and clock() - begun + ahead > settings.seconds:
                left_out.append(leave(reason=f"the {settings.seconds:.0f} s there are were planned for"))
                continue
            try:
                seconds = first(spec, case)
            except DriverError as error:
                left_out.append(leave(reason=error.message))
                continue
            needed = clock() - begun + ahead + cost(seconds, settings.launches)
            if taken and needed > settings.seconds:
                reason = f"{needed:.0f} s would be needed with it, {settings.seconds:.0f} s there are"
                left_out.append(leave(reason=reason))
                continue
            taken[spec, case] = seconds
            ahead += cost(seconds, settings.launches)
    return taken, left_out


def _threads(spec: Spec, settings: Settings) -> int:
    return settings.threads if registry.find_phase(spec.phase).threads else 1


def _size(case: Case) -> tuple[Path, int, int]:
    return case.path, case.height, registry.find_scene(case.scene).size(case.height)[0]


class Pictures:
    """Errors of the very pictures that are timed, to the fastest double-precision phase: the baseline would
    take a minute at this size. By the same parameters, and by the scene's own."""

    def __init__(self, settings: Settings, wanted: Sequence[Case]) -> None:
        self.settings = settings
        doubles = [Spec.parse(name) for name, one in registry.ladder().items() if one.precision == "double"]
        if not (able := [spec for spec in doubles if registry.cpu_supports(spec)]):
            raise StudyError("no double-precision phase can run on this CPU, to hold pictures against", 3)
        self.reference = able[-1]
        self.own = {case.scene: case for case in wanted if case.hit == OWN}
        self.known: dict[Case, images.Picture] = {}

    def _path(self, spec: Spec, case: Case, ending: str = "exr") -> Path:
        return self.settings.scratch / f"{spec}-{case.path.stem}.{ending}"

    def first(self, spec: Spec, case: Case) -> float:
        """The picture, and seconds of its first frame with its presenting. Raises DriverError."""
        how = {"threads": _threads(spec, self.settings), "aov": True, "out": self._path(spec, case)}
        (frame,) = launches.render(spec, *_size(case), timed=True, **how).frames
        return (frame.ns + frame.present_ns) * 1e-9

    def displayed(self, spec: Spec, case: Case) -> dict[str, Any]:
        """Who presents, and how many of the bytes displayed are not of the picture that the errors are of."""
        out = self._path(spec, case, "ppm")
        how = {"threads": _threads(spec, self.settings), "display": True, "out": out}
        made = launches.render(spec, *_size(case), timed=True, **how)
        wanted = images.to_display(images.rgb(images.read(self._path(spec, case))))
        other = int((images.read_ppm(out) != wanted).sum())
        return {"presented_by": made.display, "displayed_otherwise": other}

    def _reference(self, case: Case) -> images.Picture:
        if case not in self.known:
            out = self.settings.scratch / f"reference-{case.path.stem}.exr"
            run.render(self.reference, *_size(case), aov=True, out=out)
            self.known[case] = images.read(out)
        return self.known[case]

    def errors(self, spec: Spec, case: Case) -> dict[str, Any]:
        """A Row's errors by the same parameters, and `to_own`, by the scene's, where they are others."""
        made, own = images.read(self._path(spec, case)), self.own[case.scene]
        return {
            "reference": str(self.reference),
            **self.displayed(spec, case),
            **self._to(case, made),
            "to_own": None if own == case else PictureErrors(**self._to(own, made)),
        }

    def _to(self, case: Case, made: images.Picture) -> dict[str, Any]:
        fractal = registry.find_scene(case.scene).fractal
        return hits.to_picture(self._reference(case), made, fractal)


def measure(
    taken: dict[tuple[Spec, Case], float], settings: Settings
) -> dict[tuple[Spec, Case], list[tuple[list[float], list[float]]]]:
    """Per launch ns of each timed frame: rendering, presenting."""

    def once(point: tuple[Spec, Case], padding: int) -> Any:
        spec, case = point
        how = {"cpu": run.FASTEST, "threads": _threads(spec, settings), "env_bytes": padding}
        how |= {"warmup": 1, "display": True, "reps": reps_of(taken[point])}
        timed = launches.render(spec, *_size(case), timed=True, **how).timed
        return [frame.ns for frame in timed], [frame.present_ns for frame in timed]

    found = run.interleaved(list(taken), settings.launches, settings.seed, run.FASTEST, once, "time frames")
    return found  # type: ignore[return-value]


def rate(total: Sequence[Sequence[float]]) -> Interval:
    """Frames a second from ns per frame, launch by launch: one over the median, its interval turned round."""
    ns = stats.median_interval([float(np.median(launch)) for launch in total])
    return Interval(1e9 / ns.value, 1e9 / ns.high, 1e9 / ns.low, ns.launches, ns.sufficient)


def row(spec: Spec, case: Case, launches: list, errors: dict[str, Any], settings: Settings) -> Row:
    """One phase on one case. `ms`: of every timed frame with its presenting, launch by launch."""
    total = [np.add(*launch) for launch in launches]
    every = np.concatenate(total) * 1e-6
    _, height, width = _size(case)
    return Row(
        phase=str(spec),
        scene=case.scene,
        width=width,
        n=height,
        hit=case.hit,
        hit_distance=case.hit_distance,
        threads=_threads(spec, settings),
        ms=[(one * 1e-6).tolist() for one in total],
        frames_per_s=schema.Interval(**vars(rate(total))),
        frames=len(every),
        median_ms=float(np.median(every)),
        worst_ms=float(every.max()),
        p99_ms=float(np.percentile(every, 99)) if len(every) >= ENOUGH else None,
        present_ms=float(np.median(np.concatenate([one[1] for one in launches]))) * 1e-6,
        **errors,
    )


def study(specs: Sequence[Spec], wanted: Sequence[Case], settings: Settings) -> dict[str, Any]:
    """rows, left_out. Raises StudyError if nothing could run."""
    pictures = Pictures(settings, wanted)
    taken, left_out = choose(specs, wanted, settings, pictures.first)
    if not taken:
        raise StudyError(f"nothing was measured: {left_out[0].reason if left_out else 'no phase'}", 3)
    errors = {point: pictures.errors(*point) for point in taken}
    times = measure(taken, settings)
    order = {spec: place for place, spec in enumerate(specs)}
    points = sorted(taken, key=lambda point: (wanted.index(point[1]), order[point[0]]))
    rows = [row(*point, times[point], errors[point], settings) for point in points]
    return {"rows": rows, "left_out": left_out, "away": AWAY}
