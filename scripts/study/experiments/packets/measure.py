"""Rays a second of phase packets beside Embree, by tree, width and root; and ray tracing against sphere
tracing at equal error. The article: J. Bikker, "Architecture of a Real-Time Ray-Tracer".
"""

import zlib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from msgspec.structs import asdict

from study.core import machine, registry, run
from study.core.registry import Scene, find_phase
from study.experiments.packets import scenes, schema
from study.experiments.packets.schema import (
    Agreement,
    Article,
    Drawn,
    Limits,
    Normalise,
    Rate,
    Threads,
    Variant,
)
from study.measuring import function_bench, hits, launches, rays
from study.measuring.rays import KINDS, Rays, Record
from study.numbers import stats
from study.truth import truth

# Embree's ways to be asked: packets of 16, one ray, 256 rays a call (its version 3 alone).
EMBREE = ("embree16", "embree1", "embree_stream")
OWN, NEWTON = "own", "root by Newton"
# Name → settings (the phase's settings.h), what the CPU may have.
VARIANTS = {
    OWN: ("", ""),
    "kd-tree": ("tree=kd", ""),
    "8 lanes": ("", "avx2"),
    "4 lanes": ("", "none"),
    "each alone": ("rays=alone", ""),
    NEWTON: ("root=newton", ""),
}
MARCHED = ("opt4", "opt5_threads", "opt6_wide", "opt7_tiles", "opt8_streams", "opt9_convex", "opt10_scene")
HIT_DISTANCES = (None, 1e-7, 1e-5, 1e-4, 1e-3)  # None: the scene's own
UNBOUND_STEPS = 3000  # no ray of these scenes needs as many; most of them have it as their own cap
GRANTED_DB = 0.1  # a tenth of the third digit of a PSNR
ENOUGH_DB = 80.0  # an RMS error of 1/39 of a display level, which nobody sees: as in phase.json
ARTICLE = Article(scalar_ms=3156, sse_ms=172, speed_up=18.35, cpu="Core 2 Duo, 1.6 GHz")
NORMALISED = ("vectors", "isa", "layout", "name", "max_ulp")  # of a row of stepwise functions
ROUNDS = 6  # of normalising: the fewest that have an interval
MOST_OTHERS = 1e-4  # of the rays may have another hit than Embree's: those that graze


def able(limit: str) -> bool:
    """Whether this CPU has more lanes than that limit leaves: else it would be timed twice. NEON's eight have
    no limit."""
    if machine.not_x86():
        return limit == ""
    here = registry.variant_here(find_phase("packets")).lanes
    return limit == "" or {"avx2": 8, "none": 4}[limit] < here


def agreement(data: dict[str, Any], kind: str, wanted: Rays, found: np.ndarray) -> Agreement:
    """Ours against Embree's hits, ray by ray, of those within the bounds: Embree's planes are squares."""
    ours, theirs = found.astype(float)
    if kind == "shadow":
        other = (ours[:, 0] == -np.inf) != (theirs[:, 0] == -np.inf)
        return Agreement(compared=len(wanted), other_shape=int(other.sum()), dt_max=None)
    bounds = data["march"]["bounds_radius"]

    def inside(met: np.ndarray) -> np.ndarray:
        t = np.where(met[:, 1] >= 0, met[:, 0], 0)
        return np.linalg.norm(wanted[:, :3] + t[:, None] * wanted[:, 3:6], axis=1) < 0.999 * bounds

    usable = inside(ours) & inside(theirs)
    same = usable & (ours[:, 1] == theirs[:, 1])
    hit = same & (ours[:, 1] >= 0)
    off = np.abs(ours[hit, 0] - theirs[hit, 0])
    return Agreement(
        compared=int(usable.sum()),
        other_shape=int((usable & ~same).sum()),
        dt_max=float(off.max()) if off.size else None,
    )


def rate(ns: Sequence[float], count: int) -> Rate:
    """Million rays a second of launches' median times, with the interval."""
    found = stats.median_interval([count / t * 1e3 for t in ns])
    return Rate(mrays=found.value, mrays_low=found.low, mrays_high=found.high)


def beside_embree(ours: Sequence[Record], count: int) -> dict[str, Any]:
    """Embree's rates and ours over them, for each of its ways that was timed."""
    found: dict[str, Any] = {}
    mine = [float(np.median(one.ns)) for one in ours]
    for way in EMBREE:
        theirs = [float(np.median(ns)) for one in ours if (ns := getattr(one, f"{way}_ns"))]
        if theirs:
            ratio = stats.ratio_interval(theirs, mine)
            found |= {way: rate(theirs, count), f"{way}_ratio": ratio.value}
            found |= {f"{way}_ratio_low": ratio.low, f"{way}_ratio_high": ratio.high}
    return found


def of_rays(scene: Scene, wanted: Rays, kind: str, count: int, reps: int, seed: int) -> schema.Rays:
    """Every variant on the same rays, launches interleaved; Embree by turns with ours in each of ours."""
    names = [name for name, (_, limit) in VARIANTS.items() if able(limit)]
    records: dict[str, list[Record]] = {name: [] for name in names}
    met: dict[str, np.ndarray] = {}

    def once(name: str, env_bytes: int) -> float:
        where = {"cpu": run.FASTEST, "env_bytes": env_bytes}
        words, limit = VARIANTS[name]
        record, met[name] = rays.hits(scene.path, wanted, kind, words, limit, reps, name == OWN, **where)
        records[name].append(record)
        return float(np.median(record.ns))

    about = f"{scene.name}, {kind}"
    times = run.interleaved(names, count, zlib.crc32(f"{seed} {about}".encode()), run.FASTEST, once, about)
    t, own = met[NEWTON][0][:, 0], met[OWN][0][:, 0]
    both = np.isfinite(t) & np.isfinite(own)
    off = np.abs(t[both].astype(float) - own[both])
    return schema.Rays(
        scene=scene.name,
        kind=kind,
        rays=len(wanted),
        embree=records[OWN][0].embree,
        variants=[
            Variant(name=name, lanes=records[name][0].lanes, **asdict(rate(ns, len(wanted))))
            for name, ns in times.items()
        ],
        newton_dt_max=float(off.max()) if off.size and kind != "shadow" else None,
        agreement=agreement(scene.data, kind, wanted, met[OWN]) if len(met[OWN]) > 1 else None,
        **beside_embree(records[OWN], len(wanted)),
    )


def limits_of(scene: Scene) -> list[dict[str, Any]]:
    """What a march may be told: each hit distance with the scene's own cap of steps, and with one that does
    not bind where the scene's does. None: the scene's own."""
    caps = [None, UNBOUND_STEPS] if scene.content.march.max_steps < UNBOUND_STEPS else [None]
    return [{"hit_distance": hit, "max_steps": cap} for cap in caps for hit in HIT_DISTANCES]


def decibels(row: Limits) -> float:
    return np.inf if row.psnr_db is None else row.psnr_db


def target_of(traced: Limits) -> float:
    """PSNR in dB that makes an error equal to ray tracing's: its own, or what nobody sees more than."""
    return min(decibels(traced), ENOUGH_DB)


def reached(row: Limits, target: float) -> bool:
    """Whether a picture is as near to truth; one with NaN is not, whose PSNR a file has as null."""
    return row.non_finite == 0 and decibels(row) >= target - GRANTED_DB


def chosen(tried: Sequence[Limits], target: float, milliseconds: Callable[[Limits], float]) -> Limits:
    """The fastest of those that reach the target; where none does, of those that come nearest to it."""
    whole = [row for row in tried if row.non_finite == 0 and not np.isnan(decibels(row))]
    nearest = max(map(decibels, whole), default=0)
    able = [row for row in tried if reached(row, min(target, nearest))] or list(tried)
    return min(able, key=milliseconds) if len(able) > 1 else able[0]


def equal_error(scene: Scene, n: int, threads: Sequence[int], count: int, seed: int) -> schema.Scene:
    """Times of packets and of the marching phases, each by the hit distance and the cap of steps with which
    it is fastest among those that reach packets' PSNR, or 80 dB; `reached`: whether any does."""
    size = scene.size(n)
    exact = truth.picture(scene, size)

    def error(phase: str, limits: dict[str, Any]) -> Limits:
        found = hits.errors(exact, hits.picture(phase, scene, size, **limits))
        psnr, wrong, bad = found.psnr_db, found.wrong_ppm, found.non_finite or 0
        return Limits(psnr_db=psnr, wrong_ppm=wrong, non_finite=bad, **limits)

    def once(phase: str, many: int, row: Limits, pad: int = 0) -> float:
        limits = {"hit_distance": row.hit_distance, "max_steps": row.max_steps}
        return launches.milliseconds(phase, scene, size, 5, pad, threads=many, **limits)

    own = error("packets", {})
    target = target_of(own)
    made = {"packets": own}
    for phase in MARCHED:
        if registry.cpu_supports(find_phase(phase)):
            tried = [error(phase, limits) for limits in limits_of(scene)]
            made[phase] = chosen(tried, target, lambda row, phase=phase: once(phase, 1, row))
    cases = {
        f"{phase} {many}": lambda pad, p=phase, r=row, c=many: once(p, c, r, pad)
        for phase, row in made.items()
        for many in (threads if find_phase(phase).threads else threads[:1])
    }
    times = launches.interleaved(cases, count, seed)
    rows = []
    for phase, row in made.items():
        timed = []
        for many in threads:
            if mine := times.get(f"{phase} {many}"):
                gain = launches.gain(mine, times[f"packets {many}"])
                timed.append(Threads(threads=many, **asdict(launches.timed(mine)), **asdict(gain)))
        wanted = own.psnr_db if phase == "packets" else target
        is_reached = phase == "packets" or reached(row, target)
        rows.append(Drawn(phase=phase, target_db=wanted, reached=is_reached, threads=timed, **asdict(row)))
    return schema.Scene(scene=scene.name, width=size[0], n=n, rows=rows)


def normalised(vectors: int, seed: int) -> list[Normalise]:
    """The article's own benchmark, by the program of stepwise functions: ms to normalise so many vectors of
    three floats, error in ulp, and how many times as fast as scalar code that is. Raises StudyError."""
    rows = function_bench.normalise(vectors, ROUNDS, seed, run.FASTEST)
    made = []
    for row in (one for one in rows if one.vectors == max(row.vectors for row in rows)):
        about: dict[str, Any] = {key: getattr(row, key) for key in NORMALISED}
        for end, key in (("", "value"), ("_low", "low"), ("_high", "high")):
            ns = getattr(row.ns, key)
            about |= {f"ms{end}": ns and ns * row.vectors * 1e-6, f"gain{end}": getattr(row.speedup, key)}
        made.append(Normalise(**about))
    return made


def study(folder: Path, ray_n: int, n: int, count: int, reps: int, seed: int) -> dict[str, Any]:
    """The rays and drawn scenes of packets.json. `folder` gets the scenes that are made here."""
    found = []
    for scene in scenes.traced(folder):
        wanted = rays.all_kinds(scene, ray_n, seed)
        found += [of_rays(scene, wanted[kind], kind, count, reps, seed) for kind in KINDS]
    threads = [1, 2] if len(run.USABLE) > 1 else [1]
    drawn = [equal_error(scene, n, threads, count, seed) for scene in scenes.drawn(folder)]
    return {"ray_n": ray_n, "rays": found, "drawn": drawn}
