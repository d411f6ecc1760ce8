"""The throttle of rod marching: rods first, then packets (phase rods_simd), by the fastest settings that keep
a stated error. W. Edwards, "Rod Marching" (article, 6 July 2012).
"""

import itertools
from collections.abc import Callable, Sequence

import numpy as np
from msgspec.structs import asdict, replace

from study.core.registry import Scene
from study.experiments.flight.schema import Choice, Large, Setting
from study.measuring import hits, launches
from study.measuring.launches import Size
from study.measuring.schema import HitErrors, Timed
from study.pictures import images
from study.truth import truth

PHASE = "rods_simd"
SETTINGS = "STEPWISE_RODS"  # of a driver: the phase's settings.h
SIZES, SMALLEST = (8, 16, 32, 64), (2, 4, 8)
ROD_STEPS = (4, 8, 16, 32, 0)  # 0: the scene's cap
FINISH = (4, 8, 16, 32, 64, 128, 0)
PLAIN = "march=pixels"  # packets without rods
GRANTED_DB = 0.1  # a tenth of the third digit of a PSNR, by which rounding moves it
FINALISTS = 4


def settings(
    sizes: Sequence[int] = SIZES,
    least: Sequence[int] = SMALLEST,
    steps: Sequence[int] = ROD_STEPS,
    finish: Sequence[int] = FINISH,
) -> list[str]:
    """What may be chosen, with rods, in the words of STEPWISE_RODS; all of it by default."""
    return [
        f"march=rods size={size} least={small} steps={rod} finish={pixel}"
        for size, small, rod, pixel in itertools.product(sizes, least, steps, finish)
        if small <= size
    ]


def timer(phase: str, words: str, scene: Scene, size: Size, reps: int) -> Callable[[int], float]:
    """A function for launches.interleaved: milliseconds of a frame."""
    return lambda pad: launches.milliseconds(phase, scene, size, reps, pad, {SETTINGS: words})


def enough(found: HitErrors, psnr_db: float, wrong_ppm: float) -> bool:
    """Whether a picture is within the stated error."""
    if found.non_finite or found.wrong_ppm is None:
        return False
    return (found.psnr_db is None or found.psnr_db >= psnr_db) and found.wrong_ppm <= wrong_ppm


def larger(scene: Scene, n: int, words: str, count: int, seed: int) -> Large:
    """The chosen setting and packets alone at another size, in interleaved launches; how far the two pictures
    are apart. Raises StudyError."""
    size = scene.size(n)
    times = launches.interleaved({w: timer(PHASE, w, scene, size, 2) for w in (PLAIN, words)}, count, seed)
    bare, made = (hits.picture(PHASE, scene, size, {SETTINGS: w}) for w in (PLAIN, words))
    a, b = (images.clamped(images.rgb(p)).astype(float) for p in (bare, made))
    return Large(
        width=size[0],
        n=n,
        plain=launches.timed(times[PLAIN]),
        chosen=launches.timed(times[words]),
        psnr_db=hits.decibels(float(np.mean((a - b) ** 2))),
        other_ppm=float((bare["id"] != made["id"]).mean() * 1e6),
        non_finite=images.non_finite(bare) + images.non_finite(made),
        **asdict(launches.gain(times[PLAIN], times[words])),
    )


def choose(
    scene: Scene,
    n: int,
    psnr_db: float,
    wrong_ppm: float,
    count: int,
    seed: int,
    wanted: Sequence[str],
    large: int | None = None,
) -> Choice:
    """The fastest of the settings whose picture is within the error: a first look at each, then the best of
    those within it timed again, interleaved. The fastest of them is the choice. It and packets alone are
    timed anew, for the time by which it was chosen is the least of several. `large`: the height of another
    size for both. Where packets alone are further off than the error asked for, theirs is what is allowed.
    Raises StudyError."""
    size = scene.size(n)
    exact = truth.picture(scene, size)

    def errors(words: str) -> HitErrors:
        return hits.errors(exact, hits.picture(PHASE, scene, size, {SETTINGS: words}))

    def times_of(names: Sequence[str], turn: int) -> dict[str, list[float]]:
        return launches.interleaved({w: timer(PHASE, w, scene, size, 3) for w in names}, count, seed + turn)

    plain = errors(PLAIN)
    if plain.psnr_db is not None:
        psnr_db = min(psnr_db, plain.psnr_db - GRANTED_DB)
    wrong_ppm = max(wrong_ppm, plain.wrong_ppm or 0)
    tried = []
    for words in (PLAIN, *wanted):
        found = plain if words == PLAIN else errors(words)
        within = enough(found, psnr_db, wrong_ppm)
        first = timer(PHASE, words, scene, size, 3)(0) if within else None
        tried.append(Setting(settings=words, within=within, first_ms=first, **asdict(found)))
    able = sorted((one for one in tried[1:] if one.within), key=lambda one: one.first_ms or 0)
    finals: dict[str, Timed] = {}
    if able:
        times = times_of([one.settings for one in able[:FINALISTS]], 0)
        finals = {words: launches.timed(found) for words, found in times.items()}
    chosen = min(finals, key=lambda words: finals[words].ms or 0, default=None)
    anew = times_of([PLAIN, chosen] if chosen else [PLAIN], 1)
    rows = {
        words: replace(next(one for one in tried if one.settings == words), **asdict(launches.timed(times)))
        for words, times in anew.items()
    }
    return Choice(
        scene=scene.name,
        width=size[0],
        n=n,
        psnr_db=psnr_db,
        wrong_ppm=wrong_ppm,
        tried=len(tried),
        within=len(able),
        chosen=rows[chosen] if chosen else None,
        plain=rows[PLAIN],
        finalists=finals,
        large=larger(scene, large, chosen, count, seed) if chosen and large else None,
        **(asdict(launches.gain(anew[PLAIN], anew[chosen])) if chosen else {}),
    )
