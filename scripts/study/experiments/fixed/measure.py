"""Rays in integers (phases fixed, fixed_simd) against the same in floats (fixed_float).

The article: N. L. Corneliusen, "Integer Raytracing on Mellanox TILE-Gx" (5 June 2017).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

from msgspec.structs import asdict

from study.core import registry, run
from study.core.registry import Scene, find_scene
from study.experiments.fixed.schema import Clearing, Fraction, Moving, Picture, Row
from study.measuring import animations, hits, launches
from study.measuring.animations import QUARTER
from study.measuring.launches import Size, Told
from study.measuring.schema import Article
from study.numbers import stats
from study.pictures import images
from study.truth import truth

SETTINGS = "STEPWISE_FIXED"  # of a driver: the phases' settings.c
SCENE = "spheres40"
ARTICLE = Article(
    ms=14.29,
    cores=35,
    width=1920,
    height=1080,
    frames=900,
    spheres=40,
    bits=20,
    cpu="Mellanox TILE-Gx36, 35 of its 36 cores",
)
BITS = tuple(range(8, 29, 2))
SAFE = "clear=lists"
CLEARS = ("never", "corners", "safe", "lists")
FIFTEENTH = 15  # of the animation's frames are timed by the article's program, but for the slowest


class Case(NamedTuple):
    """What is timed."""

    phase: str
    words: str
    lanes: int | None = None

    @property
    def told(self) -> Told:
        """What its driver is told; `lanes` eight: on no more."""
        return {SETTINGS: self.words} | ({"STEPWISE_ISA_LIMIT": "avx2"} if self.lanes == 8 else {})

    def timer(self, scene: Scene, size: Size) -> Callable[[int], float]:
        """A function for launches.interleaved: milliseconds of a frame on one thread."""
        return lambda pad: launches.milliseconds(self.phase, scene, size, 5, pad, self.told)

    def picture(self, scene: Scene, size: Size) -> images.Picture:
        return hits.picture(self.phase, scene, size, self.told)


CASES = {  # in one interleaved run
    "article, 1 lane": Case("fixed", "roots=article clear=corners", 1),
    "1 lane": Case("fixed", f"roots=3 {SAFE}", 1),
    "8 lanes": Case("fixed_simd", f"roots=3 {SAFE}", 8),
    "16 lanes": Case("fixed_simd", f"roots=3 {SAFE}", 16),
    "16 lanes, 28 bits": Case("fixed_simd", f"bits=28 unit=auto roots=3 {SAFE}", 16),
    "float, 8 lanes": Case("fixed_float", SAFE, 8),
    "float, 16 lanes": Case("fixed_float", SAFE, 16),
}
PROGRAMS = {  # of the animation
    "article": Case("fixed", CASES["article, 1 lane"].words),
    "lanes": Case("fixed_simd", f"roots=3 {SAFE}"),
    "floats": Case("fixed_float", SAFE),
}


def able() -> dict[str, Case]:
    """CASES that this CPU runs in the lanes they are named by: with fewer they would be timed as another."""
    found = {}
    for name, case in CASES.items():
        about = registry.find_phase(case.phase)
        widest = registry.variant_here(about).lanes
        if registry.cpu_supports(about) and (case.lanes == widest or case.lanes == 8 < widest):
            found[name] = case
    return found


def widest(cases: Iterable[str], phase: str) -> str | None:
    """The case of the phase with most lanes, the first of several; None: it has none."""
    return max((c for c in cases if CASES[c].phase == phase), key=lambda c: CASES[c].lanes or 0, default=None)


def like(cases: Iterable[str], case: str) -> str | None:
    """The case of floats in as many lanes as an integer one; None: there is none, or it is one of floats."""
    floats = {CASES[c].lanes: c for c in cases if CASES[c].phase == "fixed_float"}
    return None if case in floats.values() else floats.get(CASES[case].lanes)


def timed(
    cases: Mapping[str, Case], scene: Scene, size: Size, count: int, seed: int
) -> dict[str, list[float]]:
    return launches.interleaved({k: case.timer(scene, size) for k, case in cases.items()}, count, seed)


def errors(case: Case, scene: Scene, size: Size) -> Picture:
    """How far its picture is from truth, and how many pixels a cleared block took wrongly."""
    made, exact = case.picture(scene, size), truth.picture(scene, size)
    lost = (exact["status"] >= truth.MARCHED) & (exact["id"] >= 0) & (made["cleared"] > 0)
    return Picture(
        cleared=float(made["cleared"].mean()),
        wrongly_cleared_ppm=float(lost.mean() * 1e6),
        **asdict(hits.errors(exact, made)),
    )


def whole(found: Picture, times: Sequence[float] | None) -> dict[str, Any]:
    """Errors and times."""
    return asdict(found) | (asdict(launches.timed(times)) if times else {})


def beside(n: int, count: int, seed: int) -> list[Row]:
    """CASES on SCENE: times of one interleaved run, errors, and each one's ratios to its bases."""
    scene = find_scene(SCENE)
    size, cases = scene.size(n), able()
    times = timed(cases, scene, size, count, seed)
    rows = []
    for name, case in cases.items():
        bases = {
            "gain": next(iter(cases)),
            "over_float": widest(cases, "fixed_float"),
            "over_like_float": like(cases, name),
        }
        ratios: dict[str, float] = {}
        for key, base in bases.items():
            if base and base != name:
                ratio = stats.ratio_interval(times[base], times[name])
                ratios |= {key: ratio.value, f"{key}_low": ratio.low, f"{key}_high": ratio.high}
        made = whole(errors(case, scene, size), times[name]) | ratios
        rows.append(Row(case=name, phase=case.phase, settings=case.words, width=size[0], n=n, **made))
    return rows


def sweep(n: int, count: int, seed: int, phase: str) -> list[Fraction]:
    """Bits of fraction × roots: error and time, or why they do not fit the scene."""
    scene = find_scene(SCENE)
    size = scene.size(n)
    wanted = [(roots, bits) for roots in ("article", "2", "3") for bits in BITS]
    cases = {one: Case(phase, f"bits={one[1]} unit=auto roots={one[0]} {SAFE}") for one in wanted}
    found: dict[str, Picture] = {}
    refused: dict[str, str] = {}
    for case in cases.values():
        try:
            found[case.words] = errors(case, scene, size)
        except run.DriverError as error:
            if error.status != run.UNSUPPORTED:
                raise
            refused[case.words] = error.message.rpartition(".json: ")[2]
    times = timed({c.words: c for c in cases.values() if c.words in found}, scene, size, count, seed)
    return [
        Fraction(
            bits=bits,
            roots=roots,
            settings=words,
            refused=refused.get(words),
            **whole(found.get(words, Picture()), times.get(words)),
        )
        for (roots, bits), (_, words, _) in cases.items()
    ]


def clearing(sizes: Sequence[int], count: int, seed: int, phase: str) -> list[Clearing]:
    """The corner test and those that miss nothing, by picture size: pixels wrongly cleared, and time."""
    scene, rows = find_scene(SCENE), []
    cases = {clear: Case(phase, f"roots=3 clear={clear}") for clear in CLEARS}
    for n in sizes:
        size = scene.size(n)
        times = timed(cases, scene, size, count, seed)
        for clear, case in cases.items():
            made = whole(errors(case, scene, size), times[clear])
            rows.append(Clearing(clear=clear, width=size[0], n=n, **made))
    return rows


def share(frames: int, article: bool, threads: int) -> int:
    """How many of the animation's `frames` are timed, from the first on: all in lanes on every core, a
    quarter on one thread; of the article's program, which would take minutes, fewer."""
    every = threads == animations.thread_counts()[-1]
    if article:
        return max(2, frames // (QUARTER if every else FIFTEENTH))
    return frames if every else max(2, frames // QUARTER)


def animated(frames: int, n: int) -> list[Moving]:
    """The article's program first, then ours in lanes and in floats. Raises StudyError."""
    rows, scene = [], registry.animated()[animations.MOVING]
    for name, case in PROGRAMS.items():
        if not registry.cpu_supports(registry.find_phase(case.phase)):
            continue
        error = animations.still_error(case.phase, scene, n, case.told)
        for threads in animations.thread_counts():
            many = share(frames, name == "article", threads)
            row = animations.animation(case.phase, many, n, threads, scene, case.told)
            rows.append(Moving(program=name, shadows=True, **asdict(row) | {"error": error}))
    return animations.with_common(rows)


def study(n: int, sizes: Sequence[int], frames: int, frame_n: int, count: int, seed: int) -> dict[str, Any]:
    """All of fixed.json but the context."""
    fast = "fixed_simd" if registry.cpu_supports(registry.find_phase("fixed_simd")) else "fixed"
    return {
        "article": ARTICLE,
        "rows": beside(n, count, seed),
        "sweep": sweep(n, count, seed, fast),
        "clearing": clearing(sizes, count, seed, fast),
        "animation": animated(frames, frame_n),
    }
