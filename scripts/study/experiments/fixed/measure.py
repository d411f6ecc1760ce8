"""Rays in integers (phases fixed, fixed_simd) against the same in floats (fixed_float): what fixed.json says.

The article: N. L. Corneliusen, "Integer Raytracing on Mellanox TILE-Gx" (5 June 2017); results/keys/ has
the keys.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from study.core import registry, run, store, temporary
from study.core.registry import Scene, find_scene
from study.experiments.fixed.schema import Fixed
from study.experiments.moving import measure as moving
from study.experiments.rods import measure as rods
from study.numbers import stats
from study.pictures import images
from study.truth import truth

Row = dict[str, Any]
FILE = "fixed.json"
SETTINGS = "STEPWISE_FIXED"  # of a driver: the phases' settings.c
SCENE, MOVING = "spheres40", moving.MOVING
ARTICLE = {
    "ms": 14.29,
    "cores": 35,
    "width": 1920,
    "height": 1080,
    "frames": 900,
    "spheres": 40,
    "bits": 20,
    "cpu": "Mellanox TILE-Gx36, 35 of its 36 cores",
}
BITS = tuple(range(8, 29, 2))
SAFE = "clear=lists"
# What is timed in one interleaved run: name, phase, settings, lanes.
CASES = {
    "article, 1 lane": ("fixed", "roots=article clear=corners", 1),
    "1 lane": ("fixed", f"roots=3 {SAFE}", 1),
    "8 lanes": ("fixed_simd", f"roots=3 {SAFE}", 8),
    "16 lanes": ("fixed_simd", f"roots=3 {SAFE}", 16),
    "16 lanes, 28 bits": ("fixed_simd", f"bits=28 unit=auto roots=3 {SAFE}", 16),
    "float, 8 lanes": ("fixed_float", SAFE, 8),
    "float, 16 lanes": ("fixed_float", SAFE, 16),
}
CLEARS = ("never", "corners", "safe", "lists")
ARTICLE_WORDS = CASES["article, 1 lane"][1]
# Heights up to which truth is drawn for each size: its 1,920 × 1,080 would take as long as all the rest.
TRUTH_HEIGHT = 400
# Shares of the animation's frames: all of them in lanes on every core, a quarter on one thread. The article's
# program, which would take minutes, has a quarter with shadows on every core, else a fifteenth.
QUARTER, FIFTEENTH = 4, 15


def settings(words: str, lanes: int | None = None) -> contextlib.AbstractContextManager[None]:
    """Drivers started within work as `words` say, on no more lanes; not for several threads."""
    return moving.environment({SETTINGS: words} | ({"STEPWISE_ISA_LIMIT": "avx2"} if lanes == 8 else {}))


def able() -> dict[str, tuple[str, str, int]]:
    """CASES that this CPU runs in the lanes they are named by: with fewer they would be timed as another."""
    found = {}
    for name, (phase, words, lanes) in CASES.items():
        about = registry.find_phase(phase)
        with settings(words, lanes):
            if registry.cpu_supports(about) and registry.variant_here(about).lanes == lanes:
                found[name] = (phase, words, lanes)
    return found


def widest(cases: Iterable[str], phase: str) -> str | None:
    """The case of the phase with most lanes, the first of several; None: it has none."""
    return max((c for c in cases if CASES[c][0] == phase), key=lambda c: CASES[c][2], default=None)


def milliseconds(
    phase: str,
    words: str,
    scene: Scene,
    size: tuple[int, int],
    reps: int,
    env_bytes: int = 0,
    lanes: int | None = None,
) -> float:
    """Median time of a launch's frames on one thread. Raises StudyError."""
    with settings(words, lanes):
        return rods.milliseconds(phase, "", scene, size, reps, env_bytes)


def errors(phase: str, words: str, scene: Scene, size: tuple[int, int], lanes: int | None = None) -> Row:
    """How far its picture is from truth (rods.errors), and how many pixels a cleared block took wrongly."""
    with settings(words, lanes):
        made = rods.picture(phase, "", scene, size)
    exact = truth.picture(scene, size)
    lost = (exact["status"] >= truth.CONVERGED) & (exact["id"] >= 0) & (made["cleared"] > 0)
    found = rods.errors(exact, made)
    return found | {"cleared": float(made["cleared"].mean()), "wrongly_cleared_ppm": float(lost.mean() * 1e6)}


def beside(n: int, launches: int, seed: int, reps: int = 5) -> list[Row]:
    """CASES on SCENE: times of one interleaved run, errors, and each one's gain over the first."""
    scene = find_scene(SCENE)
    size = scene.size(n)
    cases = able()
    times = rods.interleaved(
        {k: lambda pad, v=v: milliseconds(*v[:2], scene, size, reps, pad, v[2]) for k, v in cases.items()},
        launches,
        seed,
    )
    rows = []
    for name, (phase, words, lanes) in cases.items():
        row = {"case": name, "phase": phase, "settings": words, "width": size[0], "n": n}
        row |= rods.timed(times[name]) | errors(phase, words, scene, size, lanes)
        against = {"gain": next(iter(cases)), "over_float": widest(cases, "fixed_float")}
        for key, other in against.items():
            if other in times and other != name:
                ratio = stats.ratio_interval(times[other], times[name])
                row |= {key: ratio.value, f"{key}_low": ratio.low, f"{key}_high": ratio.high}
        rows.append(row)
    return like_for_like(rows)


def like_for_like(rows: Sequence[Row]) -> list[Row]:
    """With `over_like_float`: floats' time in as many lanes over the row's, of rows that have their launches;
    a float case is that ratio's base and has none."""
    floats = {CASES[r["case"]][2]: r for r in rows if r.get("phase") == "fixed_float" and r.get("launches")}
    found = []
    for row in rows:
        base = floats.get(CASES[row["case"]][2])
        if base and row.get("launches") and row["phase"] != "fixed_float":
            ratio = stats.ratio_interval(base["launches"], row["launches"])
            ends = {"": ratio.value, "_low": ratio.low, "_high": ratio.high}
            row = row | {f"over_like_float{end}": value for end, value in ends.items()}
        found.append(row)
    return found


def refused(error: run.DriverError) -> Row:
    """A row of what does not fit: the reason, no value."""
    return {"refused": error.message.rpartition(".json: ")[2]}


def sweep(n: int, launches: int, seed: int, phase: str) -> list[Row]:
    """Bits of fraction × roots: error and time, or why they do not fit the scene."""
    scene = find_scene(SCENE)
    size = scene.size(n)
    rows: list[Row] = []
    for roots in ("article", "2", "3"):
        for bits in BITS:
            words = f"bits={bits} unit=auto roots={roots} {SAFE}"
            row: Row = {"bits": bits, "roots": roots, "settings": words}
            try:
                row |= errors(phase, words, scene, size)
            except run.DriverError as error:
                if error.status != run.UNSUPPORTED:
                    raise
                row |= refused(error)
            rows.append(row)
    cases = {r["settings"]: r["settings"] for r in rows if "refused" not in r}
    times = rods.interleaved(
        {k: lambda pad, w=w: milliseconds(phase, w, scene, size, 5, pad) for k, w in cases.items()},
        launches,
        seed,
    )
    return [row | (rods.timed(times[row["settings"]]) if row["settings"] in times else {}) for row in rows]


def clearing(sizes: Sequence[int], launches: int, seed: int, phase: str) -> list[Row]:
    """The corner test and those that miss nothing, by picture size: pixels wrongly cleared, and time."""
    scene, rows = find_scene(SCENE), []
    for n in sizes:
        size = scene.size(n)
        words = {clear: f"roots=3 clear={clear}" for clear in CLEARS}
        times = rods.interleaved(
            {k: lambda pad, w=w, s=size: milliseconds(phase, w, scene, s, 5, pad) for k, w in words.items()},
            launches,
            seed,
        )
        how = errors if n <= TRUTH_HEIGHT else losses
        for clear in CLEARS:
            row = {"clear": clear, "width": size[0], "n": n}
            rows.append(row | rods.timed(times[clear]) | how(phase, words[clear], scene, size))
    return rows


def losses(phase: str, words: str, scene: Scene, size: tuple[int, int]) -> Row:
    """What clearing took from the phase's own picture without any: of sizes for which truth is too slow."""
    with settings("roots=3 clear=never"):
        whole = rods.picture(phase, "", scene, size)
    with settings(words):
        picture = rods.picture(phase, "", scene, size)
    lost = (picture["cleared"] > 0) & (whole["id"] >= 0)
    return {
        "against": "never",
        "cleared": float(picture["cleared"].mean()),
        "wrongly_cleared_ppm": float(lost.mean() * 1e6),
        "lost_pixels": int(lost.sum()),
        "non_finite": images.non_finite(picture),
    }


def without_shadows(scene: Scene, folder: Path) -> Scene:
    """The scene as a file in `folder`, its light without shadows, as the article's is."""
    data = scene.data | {"light": scene.data["light"] | {"shadows": "none"}}
    path = folder / f"{scene.name}_unshadowed.json"
    store.write_json(path, data)
    return Scene(path.stem, path, data, scene.fractal)


def share(frames: int, article: bool, threads: int, shadows: bool) -> int:
    """How many of the animation's `frames` are timed, from the first on."""
    every = threads == moving.thread_counts()[-1]
    if article:
        return max(2, frames // (QUARTER if every and shadows else FIFTEENTH))
    return frames if every else max(2, frames // QUARTER)


ANIMATED = ("fixed", "fixed_simd", "fixed_float")


def animations(frames: int, n: int, keep: Path, simd: bool) -> list[Row]:
    """The article's program first, then ours in lanes and in floats; then both integers without shadows, as
    the article's picture is, on every core. Raises StudyError."""
    programs = {"article": ("fixed", ARTICLE_WORDS)}
    if simd:
        programs |= {"lanes": ("fixed_simd", f"roots=3 {SAFE}"), "floats": ("fixed_float", SAFE)}
    rows, shadowed = [], registry.animated()[MOVING]
    with temporary.folder() as folder:
        scenes = {True: shadowed, False: without_shadows(shadowed, folder)}
        for shadows, scene in scenes.items():
            for name, (phase, words) in programs.items():
                if name == "floats" and not shadows:
                    continue
                with settings(words):
                    error = moving.still_error(phase, scene, n)
                for threads in moving.thread_counts() if shadows else moving.thread_counts()[-1:]:
                    count = share(frames, name == "article", threads, shadows)
                    with settings(words):
                        row = moving.animation(phase, count, n, threads, keep, scene)
                    rows.append({"program": name, "shadows": shadows, **row, "error": error})
    return rows


def with_common(rows: Sequence[Row]) -> list[Row]:
    """With `common_ms`, the mean of the first `common_frames`, as many as the shortest row has: what
    the frames show drifts, so that means of different numbers of them are of different work."""
    fewest = min((len(row["all_ms"]) for row in rows if row.get("all_ms")), default=0)
    return [
        row | {"common_frames": fewest, "common_ms": sum(row["all_ms"][:fewest]) / fewest}
        if row.get("all_ms") else row
        for row in rows
    ]  # fmt: skip


def study(
    n: int, sizes: Sequence[int], frames: int, frame_n: int, launches: int, seed: int, keep: Path
) -> Row:
    """All of fixed.json but the context. `keep`: where the animation's frames outlive an interruption."""
    simd = registry.cpu_supports(registry.find_phase("fixed_simd"))
    fast = "fixed_simd" if simd else "fixed"
    moved = animations(frames, frame_n, keep, simd)  # first: the longest that an interruption can cut
    return {
        "article": ARTICLE,
        "rows": beside(n, launches, seed),
        "sweep": sweep(n, launches, seed, fast),
        "clearing": clearing(sizes, launches, seed, fast),
        "animation": with_common(moved),
    }


def read(file: Path) -> Row:
    """The file, or one with no rows. Raises StudyError."""
    if not file.exists():
        return {"rows": []}
    result = Fixed.read(file)
    if all(isinstance(row, dict) and row.get("case") in CASES for row in result["rows"]):  # an older file
        result["rows"] = like_for_like(result["rows"])
    return result | {"animation": result.get("animation", [])}
