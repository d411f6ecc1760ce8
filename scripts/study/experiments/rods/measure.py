"""Rods against rays (phase rods), and the settings of the hybrid (phase rods_simd): what rods.json and
throttle.json say. Rod marching: the article of 6 July 2012; results/keys/ has the keys.
"""

from __future__ import annotations

import contextlib
import itertools
import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from study.core import run, temporary
from study.core.registry import Scene, find_scene
from study.experiments.rods.schema import Rods
from study.numbers import stats
from study.pictures import images
from study.pictures.images import Picture
from study.truth import judging, truth

Row = dict[str, Any]
FILE, THROTTLE = "rods.json", "throttle.json"
SETTINGS = "STEPWISE_RODS"  # of a driver: the phases' settings.h
SCENE = "two_spheres"  # the article's: "a couple of spheres", 800×800, at most 20 steps
ARTICLE = {
    "size": 800,
    "max_steps": 20,
    "down": 16,
    "pixels_ms": 150,
    "rods_ms": 10,  # "under"
    "evaluations": 100,  # "two orders of magnitude less"
    "cpu": "Core2 Duo T9400 @ 2.53GHz, one core",
}
DOWN = (4, 8, 16, 32, 64)  # starting rods from top to bottom
CAPS = (10, 14, 20, 28, 40)  # steps
LEAST = (1, 2, 4, 8)  # pixels on a side of the smallest rod


@contextlib.contextmanager
def settings(words: str) -> Iterator[None]:
    """Drivers started within work as `words` say; not for several threads."""
    before = os.environ.get(SETTINGS)
    os.environ[SETTINGS] = words
    try:
        yield
    finally:
        if before is None:
            del os.environ[SETTINGS]
        else:
            os.environ[SETTINGS] = before


def milliseconds(
    phase: str, words: str, scene: Scene, size: tuple[int, int], reps: int, env_bytes: int = 0, **more: Any
) -> float:
    """Median time of a launch's frames, on as many CPUs as it has threads. Raises StudyError."""
    how = {"cpu": run.FASTEST, "env_bytes": env_bytes, "reps": reps, "warmup": 1, "timed": False}
    with settings(words):
        record = run.render(phase, scene.path, size[1], size[0], **how, **more)
    return float(np.median([f["ns"] for f in record["frames"] if not f["warmup"]])) / 1e6


def picture(phase: str, words: str, scene: Scene, size: tuple[int, int], **more: Any) -> Picture:
    """All planes of a frame. Raises StudyError."""
    with temporary.folder() as scratch, settings(words):
        out = scratch / "picture.exr"
        run.render(phase, scene.path, size[1], size[0], aov=True, out=out, timed=False, **more)
        return images.read(out)


def decibels(square: float) -> float | None:
    """PSNR in dB of a mean squared error of colours in [0, 1]; None: identical. NaN is NaN."""
    return None if square == 0 else float(-10 * np.log10(square))


def errors(exact: Picture, made: Picture, colour: bool = True) -> Row:
    """How far a picture is from truth: wrong hits in ppm of the pixels that truth proves (where it proves
    none, of those that converged), whose share `judged` is; |Δt| in scene units where the shape is right;
    PSNR in dB of linear colours in [0, 1]. As judging.measure has them. `known`: share that truth knows.
    """
    least = judging.PROVED if (exact["status"] == judging.PROVED).any() else judging.CONVERGED
    count = int((exact["status"] >= least).sum())
    off = judging.right_distances(exact, made, least)
    found: Row = {
        "evaluations": float((made["evals"] + made.get("rods", 0)).mean()),
        "judged": count / exact["status"].size,
        "known": float((exact["status"] >= truth.CONVERGED).mean()),
        **{
            f"{kind}_ppm": float(mask.sum() / count * 1e6) if count else math.nan
            for kind, mask in judging.wrong_hits(exact, made, least).items()
        },
        **{f"dt_p{p}": float(np.percentile(off, p)) if off.size else None for p in (50, 99, 100)},
        "non_finite": images.non_finite(made),
    }
    found["wrong_ppm"] = sum(found[f"{kind}_ppm"] for kind in ("false_hits", "false_misses", "wrong_shape"))
    if colour:
        a, b = (images.clamped(images.rgb(p)).astype(float) for p in (exact, made))
        finite = np.isfinite(a).all(axis=-1) & (exact["status.all"] >= truth.CONVERGED)
        square = float(np.mean((a[finite] - b[finite]) ** 2)) if finite.any() else np.nan
        found["psnr_db"] = decibels(square)
    return found


def interleaved(
    cases: Mapping[str, Callable[[int], float]], launches: int, seed: int
) -> dict[str, list[float]]:
    """run.interleaved of cases by name, each a function of the bytes that its environment is padded with."""
    return run.interleaved(list(cases), launches, seed, run.FASTEST, lambda name, pad: cases[name](pad))


def timed(times: Sequence[float]) -> Row:
    """ms with its interval over launches."""
    found = stats.median_interval(times)
    return {"ms": found.value, "ms_low": found.low, "ms_high": found.high, "launches": list(times)}


MARCHES = {"pixels": "march=pixels", "rods": "march=rods"}


def beside(scene: Scene, n: int, launches: int, seed: int, reps: int = 7) -> Row:
    """Rods and per-pixel marching on a scene, the march alone: times, evaluations, errors of both."""
    size = scene.size(n)
    cases = {
        name: lambda pad, w=words: milliseconds("rods", f"{w} picture=map", scene, size, reps, pad)
        for name, words in MARCHES.items()
    }
    times = interleaved(cases, launches, seed)
    exact, found = truth.picture(scene, size), {}
    for name, words in MARCHES.items():
        made = picture("rods", words, scene, size)
        found[name] = {
            **timed(times[name]),
            **errors(exact, made),
        }
    gain = stats.ratio_interval(times["pixels"], times["rods"])
    return {
        "scene": scene.name,
        "width": size[0],
        "n": n,
        **found,
        "gain": gain.value,
        "gain_low": gain.low,
        "gain_high": gain.high,
        "fewer": found["pixels"]["evaluations"] / found["rods"]["evaluations"],
    }


def trade(n: int, launches: int, seed: int) -> tuple[list[Row], Row]:
    """The article's open question: starting rods × step cap, its step, the smallest rod → time, error; and
    `gain` over the march per pixel, of the same interleaved run; behind the rows the time of that march.
    """
    scene = find_scene(SCENE)
    size = scene.size(n)
    exact = truth.picture(scene, size)
    wanted = [(down, cap, 1, "whole") for down, cap in itertools.product(DOWN, CAPS)]
    wanted += [(ARTICLE["down"], ARTICLE["max_steps"], least, "whole") for least in LEAST[1:]]
    wanted += [(ARTICLE["down"], cap, 1, "safe") for cap in CAPS]
    cases, rows = {}, []
    for down, cap, least, step in wanted:
        words = f"down={down} least={least} step={step}"
        more = {"max_steps": cap}
        made = picture("rods", words, scene, size, **more)
        about = {"down": down, "max_steps": cap, "least": least, "step": step}
        rows.append(
            about
            # less steps of the scene than its own are another scene's: truth knows no cap, and stays
            | errors(exact, made)
        )
        name = f"{words} {cap}"
        rows[-1]["name"] = name
        drawn = f"{words} picture=map"
        cases[name] = lambda pad, w=drawn, m=more: milliseconds("rods", w, scene, size, 5, pad, **m)
    plain = MARCHES["pixels"]  # by the scene's own cap: what all of them are compared with
    cases[plain] = lambda pad: milliseconds("rods", f"{plain} picture=map", scene, size, 5, pad)
    times = interleaved(cases, launches, seed)
    by_row = [(row, times[row.pop("name")]) for row in rows]
    return [row | timed(mine) | gain_of(times[plain], mine) for row, mine in by_row], timed(times[plain])


def study(scenes: Sequence[Scene], n: int, article_n: int, launches: int, seed: int) -> Row:
    """All of rods.json but the context."""
    found = {
        "article": ARTICLE,
        "own": beside(find_scene(SCENE), article_n, launches, seed),
        "rows": [beside(scene, n, launches, seed, 1) for scene in scenes],
    }
    rows, pixels = trade(article_n, launches, seed)
    return found | {"trade": rows, "trade_pixels": pixels}


def read(file: Path) -> Row:
    """The file, or one with no rows. Raises StudyError."""
    return Rods.read(file) if file.exists() else {"rows": []}


# What a throttle may choose of phase rods_simd.
SIZES, SMALLEST = (8, 16, 32, 64), (2, 4, 8)
ROD_STEPS = (4, 8, 16, 32, 0)  # 0: the scene's cap
FINISH = (4, 8, 16, 32, 64, 128, 0)
PLAIN = "march=pixels"  # packets without rods
GRANTED_DB = 0.1  # a tenth of the third digit of a PSNR, by which rounding moves it


def choices() -> list[str]:
    """Every setting that is tried, and the packets without rods."""
    found = [
        f"march=rods size={size} least={least} steps={steps} finish={finish}"
        for size, least, steps, finish in itertools.product(SIZES, SMALLEST, ROD_STEPS, FINISH)
        if least <= size
    ]
    return [PLAIN, *found]


def enough(found: Row, psnr_db: float, wrong_ppm: float) -> bool:
    """Whether a picture is within the stated error."""
    psnr = found["psnr_db"]
    return not found["non_finite"] and (psnr is None or psnr >= psnr_db) and found["wrong_ppm"] <= wrong_ppm


def gain_of(plain: Sequence[float], chosen: Sequence[float]) -> Row:
    """`gain` with its interval: how many times as fast a setting is as the plain march."""
    ratio = stats.ratio_interval(plain, chosen)
    return {"gain": ratio.value, "gain_low": ratio.low, "gain_high": ratio.high}


def larger(scene: Scene, n: int, words: str, plain: str, launches: int, seed: int) -> Row:
    """The chosen setting and packets alone at another size, in interleaved launches; how far the two
    pictures are apart. Raises StudyError.
    """
    size = scene.size(n)
    cases = {w: lambda pad, w=w: milliseconds("rods_simd", w, scene, size, 2, pad) for w in (plain, words)}
    times = interleaved(cases, launches, seed)
    bare, made = (picture("rods_simd", w, scene, size) for w in (plain, words))
    a, b = (images.clamped(images.rgb(p)).astype(float) for p in (bare, made))
    square = float(np.mean((a - b) ** 2))
    return {
        "width": size[0],
        "n": n,
        "plain": timed(times[plain]),
        "chosen": timed(times[words]),
        **gain_of(times[plain], times[words]),
        # of the pictures, the one against the other
        "psnr_db": decibels(square),
        "other_ppm": float((bare["id"] != made["id"]).mean() * 1e6),
        "non_finite": images.non_finite(bare) + images.non_finite(made),
    }


def throttle(
    scene: Scene,
    n: int,
    psnr_db: float,
    wrong_ppm: float,
    launches: int,
    seed: int,
    best: int = 4,
    large: int | None = None,
    settings: Sequence[str] | None = None,
) -> Row:
    """The fastest settings whose picture is within the error, of all tried: a first look at each, then
    the best of those within it timed again, interleaved with packets without rods. The fastest of them is
    the choice, and both are timed anew: the time that made it the choice is the least of several, so it
    says too much. `large`: the height of another size for both. `settings`: what may be chosen; None: all of
    choices().

    `psnr_db`, `wrong_ppm` become what packets alone reach where that is further off. Raises StudyError.
    """
    size = scene.size(n)
    exact = truth.picture(scene, size)
    plain, *others = choices() if settings is None else [PLAIN, *settings]
    found = errors(exact, picture("rods_simd", plain, scene, size))
    # Where the scene's own limits keep packets from that error, what they reach is all that can be asked for.
    if found["psnr_db"] is not None:
        psnr_db = min(psnr_db, found["psnr_db"] - GRANTED_DB)
    wrong_ppm = max(wrong_ppm, found["wrong_ppm"])
    tried: list[Row] = []
    for words in (plain, *others):
        found = errors(exact, picture("rods_simd", words, scene, size))
        row = {"settings": words, **found, "within": enough(found, psnr_db, wrong_ppm), "first_ms": None}
        if row["within"]:
            row["first_ms"] = milliseconds("rods_simd", words, scene, size, 3)
        tried.append(row)

    def times_of(names: Sequence[str], turn: int) -> dict[str, list[float]]:
        cases = {w: lambda pad, w=w: milliseconds("rods_simd", w, scene, size, 3, pad) for w in names}
        return interleaved(cases, launches, seed + turn)

    able = sorted((row for row in tried[1:] if row["within"]), key=lambda row: row["first_ms"])[:best]
    finals = {w: timed(t) for w, t in times_of([row["settings"] for row in able], 0).items()} if able else {}
    chosen = min(finals, key=lambda words: finals[words]["ms"]) if finals else None
    anew = times_of([plain, chosen] if chosen else [plain], 1)
    rows = {row["settings"]: row for row in tried}
    nothing: Row = dict.fromkeys(("gain", "gain_low", "gain_high"))
    return {
        "scene": scene.name,
        "width": size[0],
        "n": n,
        "psnr_db": psnr_db,
        "wrong_ppm": wrong_ppm,
        "tried": len(tried),
        "within": sum(row["within"] for row in tried[1:]),
        "chosen": rows[chosen] | timed(anew[chosen]) if chosen else None,
        "plain": rows[plain] | timed(anew[plain]),
        "finalists": finals,
        **(gain_of(anew[plain], anew[chosen]) if chosen else nothing),
        "large": larger(scene, large, chosen, plain, launches, seed) if chosen and large else None,
        "all": tried,
    }
