"""Rods against rays: phase rods. Rod marching: W. Edwards, article of 6 July 2012."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence

import msgspec

from study.core.registry import Scene, find_scene
from study.experiments.rods.schema import Article, Row, Trade, Way
from study.measuring import hits, launches
from study.measuring.launches import Size
from study.measuring.schema import HitErrors, Timed
from study.pictures.images import Picture
from study.truth import truth

SETTINGS = "STEPWISE_RODS"  # of a driver: the phases' settings.h
SCENE = "two_spheres"  # the article's: "a couple of spheres", 800×800, at most 20 steps
ARTICLE = Article(
    size=800,
    max_steps=20,
    down=16,
    pixels_ms=150,
    rods_ms=10,
    evaluations=100,
    cpu="Core2 Duo T9400 @ 2.53GHz, one core",
)
DOWN = (4, 8, 16, 32, 64)  # starting rods from top to bottom
CAPS = (10, 14, 20, 28, 40)  # steps
LEAST = (1, 2, 4, 8)  # pixels on a side of the smallest rod
PIXELS, RODS = "march=pixels", "march=rods"


def picture(words: str, scene: Scene, size: Size, max_steps: int | None = None) -> Picture:
    return hits.picture("rods", scene, size, {SETTINGS: words}, max_steps=max_steps)


def timer(
    words: str, scene: Scene, size: Size, reps: int, max_steps: int | None = None
) -> Callable[[int], float]:
    """A function for launches.interleaved: milliseconds of the march alone."""
    told = {SETTINGS: f"{words} picture=map"}
    return lambda pad: launches.milliseconds("rods", scene, size, reps, pad, told, max_steps=max_steps)


def way(times: Sequence[float], errors: HitErrors) -> Way:
    return Way(**msgspec.structs.asdict(launches.timed(times)), **msgspec.structs.asdict(errors))


def beside(scene: Scene, n: int, count: int, seed: int, reps: int = 7) -> Row:
    """Rods and per-pixel marching on a scene, `count` launches each: times, evaluations, errors."""
    size = scene.size(n)
    times = launches.interleaved(
        {words: timer(words, scene, size, reps) for words in (PIXELS, RODS)}, count, seed
    )
    exact = truth.picture(scene, size)
    pixels, rods = (
        way(times[words], hits.errors(exact, picture(words, scene, size))) for words in (PIXELS, RODS)
    )
    return Row(
        scene=scene.name,
        width=size[0],
        n=n,
        pixels=pixels,
        rods=rods,
        fewer=(pixels.evaluations or 0) / (rods.evaluations or 1),
        **msgspec.structs.asdict(launches.gain(times[PIXELS], times[RODS])),
    )


def trade(n: int, count: int, seed: int) -> tuple[list[Trade], Timed]:
    """The article's open question: starting rods × step cap, its step, the smallest rod → time, error; and
    the gain over the march per pixel, whose time of the same interleaved launches stands behind the rows.
    """
    scene = find_scene(SCENE)
    size = scene.size(n)
    exact = truth.picture(scene, size)
    wanted = [(down, cap, 1, "whole") for down, cap in itertools.product(DOWN, CAPS)]
    wanted += [(ARTICLE.down, ARTICLE.max_steps, least, "whole") for least in LEAST[1:]]
    wanted += [(ARTICLE.down, cap, 1, "safe") for cap in CAPS]
    said = {one: f"down={one[0]} least={one[2]} step={one[3]}" for one in wanted}
    cases = {str(one): timer(words, scene, size, 5, one[1]) for one, words in said.items()}
    cases[PIXELS] = timer(PIXELS, scene, size, 5)  # by the scene's own cap
    times = launches.interleaved(cases, count, seed)
    rows = []
    for one, words in said.items():
        down, cap, least, step = one
        # Fewer steps than the scene's own are another scene's, but truth knows no cap.
        found = hits.errors(exact, picture(words, scene, size, cap))
        made = msgspec.structs.asdict(way(times[str(one)], found))
        gain = msgspec.structs.asdict(launches.gain(times[PIXELS], times[str(one)]))
        rows.append(Trade(down=down, max_steps=cap, least=least, step=step, **made, **gain))
    return rows, launches.timed(times[PIXELS])
