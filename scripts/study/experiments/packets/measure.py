"""What packets.json says: rays a second of phase packets beside Embree, by tree, width and root; and ray
tracing against sphere tracing at equal error. The article: J. Bikker, "Architecture of a Real-Time
Ray-Tracer".
"""

from __future__ import annotations

import copy
import zlib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from study.core import registry, run, store
from study.core.registry import Scene, find_phase, find_scene
from study.experiments.functions import measure as functions
from study.experiments.moving import measure as moving
from study.experiments.packets.schema import Packets
from study.experiments.rods import measure as rods
from study.measuring import rays as packets_rays
from study.measuring.rays import KINDS, Rays
from study.numbers import stats
from study.truth import truth

Row = dict[str, Any]
FILE = "packets.json"
ARTICLE = {"scalar_ms": 3156, "sse_ms": 172, "speed_up": 18.35, "cpu": "Core 2 Duo, 1.6 GHz"}
GOALS = {"primary": 1.0, "shadow": None, "mirror": 0.5, "scattered": 0.5}  # of Embree's rays a second
# Embree's ways to be asked: packets of 16, one ray, 256 rays a call (its version 3 alone).
EMBREE = ("embree16", "embree1", "embree_stream")
# Name → settings (systems/packets/settings.h), what the CPU may have.
VARIANTS = {
    "own": ("", ""),
    "kd-tree": ("tree=kd", ""),
    "8 lanes": ("", "avx2"),
    "4 lanes": ("", "none"),
    "each alone": ("rays=alone", ""),
    "root by Newton": ("root=newton", ""),
}
MARCHED = ("opt4", "opt5_threads", "opt6_wide", "opt7_tiles", "opt8_streams", "opt9_convex", "opt10_scene")
HIT_DISTANCES = (None, 1e-7, 1e-5, 1e-4, 1e-3)  # None: the scene's own
UNBOUND_STEPS = 3000  # no ray of these scenes needs as many; most of them have it as their own cap
ENDS = {"": "value", "_low": "low", "_high": "high"}
GRANTED_DB = 0.1  # a tenth of the third digit of a PSNR
ENOUGH_DB = 80.0  # an RMS error of 1/39 of a display level, which nobody sees: as in phase.json


def able(limit: str) -> bool:
    """Whether this CPU has more lanes than that limit leaves, or as many: else it would be timed twice."""
    variants = registry.find_phase("packets").variants
    here = registry.variant_here(find_phase("packets")).lanes
    lanes = {"": here, "avx2": 8, "none": 4}[limit]
    return lanes <= here and (limit == "" or lanes < here) and len(variants) == 3


def agreement(data: Row, kind: str, rays: Rays, found: np.ndarray) -> Row:
    """Ours against Embree's hits, ray by ray, of those within the bounds: Embree's planes are squares."""
    ours, theirs = found.astype(float)
    if kind == "shadow":
        other = (ours[:, 0] == -np.inf) != (theirs[:, 0] == -np.inf)
        return {"compared": len(rays), "other_shape": int(other.sum()), "dt_max": None}
    bounds = data["march"]["bounds_radius"]

    def inside(hits: np.ndarray) -> np.ndarray:
        t = np.where(hits[:, 1] >= 0, hits[:, 0], 0)
        return np.linalg.norm(rays[:, :3] + t[:, None] * rays[:, 3:6], axis=1) < 0.999 * bounds

    usable = inside(ours) & inside(theirs)
    same = usable & (ours[:, 1] == theirs[:, 1])
    hit = same & (ours[:, 1] >= 0)
    off = np.abs(ours[hit, 0] - theirs[hit, 0])
    return {
        "compared": int(usable.sum()),
        "other_shape": int((usable & ~same).sum()),
        "dt_max": float(off.max()) if off.size else None,
    }


def rate(ns: Sequence[float], count: int) -> Row:
    """Million rays a second of launches' median times, with the interval."""
    found = stats.median_interval([count / t * 1e3 for t in ns])
    return {"mrays": found.value, "mrays_low": found.low, "mrays_high": found.high}


def one_launch(
    scene: Scene, rays: Rays, kind: str, name: str, reps: int, env_bytes: int = 0
) -> tuple[Row, np.ndarray]:
    """A process: medians over its repetitions in ns, ours and (with our own settings) Embree's."""
    words, limit = VARIANTS[name]
    where = {"cpu": run.FASTEST, "env_bytes": env_bytes}
    record, found = packets_rays.hits(scene.path, rays, kind, words, limit, reps, name == "own", **where)
    keys = ("ns", *(f"{way}_ns" for way in EMBREE))
    times = {key: float(np.median(record[key])) if record[key] else None for key in keys}
    return times | {"embree": record["embree"], "lanes": record["lanes"]}, found


def of_rays(scene: Scene, rays: Rays, kind: str, launches: int, reps: int, seed: int) -> Row:
    """Every variant on the same rays, launches interleaved; Embree by turns with ours in each of ours."""
    names = [name for name, (_, limit) in VARIANTS.items() if able(limit)]
    times: dict[str, list[Row]] = {name: [] for name in names}
    hits: dict[str, np.ndarray] = {}

    def once(name: str, env_bytes: int) -> float:
        took, hits[name] = one_launch(scene, rays, kind, name, reps, env_bytes)
        times[name].append(took)
        return float(took["ns"])

    about = f"{scene.name}, {kind}"
    run.interleaved(names, launches, zlib.crc32(f"{seed} {about}".encode()), run.FASTEST, once, about)
    ours, count = times["own"], len(rays)
    found: Row = {"scene": scene.name, "kind": kind, "rays": count, "embree": ours[0]["embree"]}
    found["variants"] = [
        {"name": name, "lanes": rows[0]["lanes"], **rate([r["ns"] for r in rows], count)}
        for name, rows in times.items()
    ]
    t, own = hits["root by Newton"][0][:, 0], hits["own"][0][:, 0]
    both = np.isfinite(t) & np.isfinite(own)
    off = np.abs(t[both].astype(float) - own[both])
    found["newton_dt_max"] = float(off.max()) if off.size and kind != "shadow" else None
    for key in EMBREE:
        theirs = [r[f"{key}_ns"] for r in ours if r[f"{key}_ns"]]
        found[key] = rate(theirs, count) if theirs else None
        ratio = stats.ratio_interval(theirs, [r["ns"] for r in ours]) if theirs else None
        for end in ("value", "low", "high"):
            name = f"{key}_ratio" + ("" if end == "value" else f"_{end}")
            found[name] = getattr(ratio, end) if ratio else None
    found["agreement"] = agreement(scene.data, kind, rays, hits["own"]) if len(hits["own"]) > 1 else None
    return found


def solids() -> Row:
    """scene0_plain without its torus and octahedron: a box, a sphere, a cone and a plane, no shadows."""
    data = copy.deepcopy(find_scene("scene0_plain").data)
    data["shapes"] = [s for s in data["shapes"] if s["type"] not in ("torus", "octahedron")]
    return data


def drawn_scenes(folder: Path) -> list[Scene]:
    """Scenes that both ray tracing and sphere tracing render, shadows hard or none."""
    found = [find_scene("spheres40"), find_scene("two_spheres")]
    for name, data in (("trio_balls", packets_rays.balls()), ("scene0_solids", solids())):
        path = folder / f"{name}.json"
        store.write_json(path, data)
        found.append(Scene(name, path, data, False))
    return found


def knobs_of(scene: Scene) -> list[Row]:
    """What a march may be told: each hit distance with the scene's own cap of steps, and with one that does
    not bind where the scene's does. None: the scene's own.
    """
    caps = [None, UNBOUND_STEPS] if scene.data["march"]["max_steps"] < UNBOUND_STEPS else [None]
    return [{"hit_distance": hit, "max_steps": cap} for cap in caps for hit in HIT_DISTANCES]


def better(psnr: float | None) -> float:
    """None stands for a picture without any difference."""
    return np.inf if psnr is None else psnr


def target_of(traced: Row) -> float:
    """PSNR in dB that makes an error equal to ray tracing's: its own, or what nobody sees more than."""
    return min(better(traced["psnr_db"]), ENOUGH_DB)


def reached(row: Row, target: float) -> bool:
    """Whether a picture is as near to truth; one with NaN is not, whose PSNR a file has as null."""
    return row["non_finite"] == 0 and better(row["psnr_db"]) >= target - GRANTED_DB


def chosen(tried: Sequence[Row], target: float, milliseconds: Callable[[Row], float]) -> Row:
    """The fastest of those that reach the target; where none does, of those that come nearest to it."""
    whole = [row for row in tried if row["non_finite"] == 0 and not np.isnan(better(row["psnr_db"]))]
    nearest = max((better(row["psnr_db"]) for row in whole), default=0)
    able = [row for row in tried if reached(row, min(target, nearest))] or list(tried)
    return min(able, key=milliseconds) if len(able) > 1 else able[0]


def equal_error(scene: Scene, n: int, threads: Sequence[int], launches: int, seed: int) -> Row:
    """Times of packets and of the marching phases, each by the hit distance and the cap of steps with which
    it is fastest among those that reach packets' PSNR, or 80 dB; `reached`: whether any does.
    """
    size = scene.size(n)
    exact = truth.picture(scene, size)

    def error(phase: str, knobs: Row) -> Row:
        found = rods.errors(exact, rods.picture(phase, "", scene, size, **knobs))
        return knobs | {key: found[key] for key in ("psnr_db", "wrong_ppm", "non_finite")}

    def once(phase: str, count: int, row: Row, env_bytes: int = 0) -> float:
        knobs = {key: row[key] for key in ("hit_distance", "max_steps")}
        return rods.milliseconds(phase, "", scene, size, 5, env_bytes, threads=count, **knobs)

    own = error("packets", {"hit_distance": None, "max_steps": None})
    target = target_of(own)
    rows: list[Row] = [{"phase": "packets", "target_db": own["psnr_db"], "reached": True, **own}]
    for phase in MARCHED:
        if not registry.cpu_supports(find_phase(phase)):
            continue
        tried = [error(phase, knobs) for knobs in knobs_of(scene)]
        best = chosen(tried, target, lambda row, phase=phase: once(phase, 1, row))
        rows.append({"phase": phase, "target_db": target, "reached": reached(best, target), **best})
    cases: dict[str, Callable[[int], float]] = {}
    for row in rows:
        several = find_phase(row["phase"]).threads
        for count in threads if several else threads[:1]:
            cases[f"{row['phase']} {count}"] = lambda pad, r=row, c=count: once(r["phase"], c, r, pad)
    times = rods.interleaved(cases, launches, seed)
    for row in rows:
        row["threads"] = []
        for count in threads:
            mine = times.get(f"{row['phase']} {count}")
            if mine is None:
                continue
            gain = stats.ratio_interval(mine, times[f"packets {count}"])
            ends = {"gain": gain.value, "gain_low": gain.low, "gain_high": gain.high}
            row["threads"].append({"threads": count, **rods.timed(mine), **ends})
    return {"scene": scene.name, "width": size[0], "n": n, "rows": rows}


ROOTS = ("exact", "newton")


def by_root(scene: Scene, n: int, launches: int, seed: int) -> list[Row]:
    """Whole frames with the exact root and with the approximate one and a Newton step, one thread: times in
    interleaved launches, errors to truth. Raises StudyError.
    """
    size = scene.size(n)
    exact = truth.picture(scene, size)

    def under(root: str, do: Callable[[], Any]) -> Any:
        with moving.environment({packets_rays.SETTINGS: f"root={root}"}):
            return do()

    cases = {
        root: lambda pad, r=root: under(r, lambda: rods.milliseconds("packets", "", scene, size, 5, pad))
        for root in ROOTS
    }
    times = rods.interleaved(cases, launches, seed)
    gain = stats.ratio_interval(times["exact"], times["newton"])
    rows = []
    for root in ROOTS:
        found = rods.errors(exact, under(root, lambda: rods.picture("packets", "", scene, size)))
        errors = {key: found[key] for key in ("psnr_db", "wrong_ppm", "non_finite")}
        about = {"scene": scene.name, "width": size[0], "n": n, "root": root}
        ends = {f"gain{end}": getattr(gain, key) if root == "newton" else None for end, key in ENDS.items()}
        rows.append(about | rods.timed(times[root]) | ends | errors)
    return rows


NORMALISE_ROUNDS = 6  # the fewest that have an interval


def normalised(vectors: int, seed: int) -> list[Row]:
    """The article's benchmark: ms to normalise so many vectors of three floats, error in ulp, and how many
    times as fast as scalar code that is. All of it is in the function study. Raises StudyError.
    """
    rows = functions.normalise(vectors, NORMALISE_ROUNDS, seed, run.FASTEST)
    largest = max(row["vectors"] for row in rows)
    return [
        {key: row[key] for key in ("vectors", "isa", "layout", "name", "max_ulp")}
        | {f"ms{end}": row["ns"][key] * largest * 1e-6 for end, key in ENDS.items()}
        | {f"gain{end}": row["speedup"][key] for end, key in ENDS.items()}
        for row in rows
        if row["vectors"] == largest
    ]


def study(folder: Path, ray_n: int, n: int, launches: int, reps: int, seed: int) -> Row:
    """All of packets.json but the context. `folder` gets the scenes that are made here."""
    rows = []
    for scene in packets_rays.scenes(folder):
        rays = packets_rays.all_kinds(scene, ray_n, seed)
        rows += [of_rays(scene, rays[kind], kind, launches, reps, seed) for kind in KINDS]
    threads = [1, 2] if len(run.USABLE) > 1 else [1]
    drawn = [equal_error(scene, n, threads, launches, seed) for scene in drawn_scenes(folder)]
    roots = by_root(find_scene("spheres40"), n, launches, seed)
    found = {"article": ARTICLE, "goals": GOALS, "ray_n": ray_n, "rays": rows, "drawn": drawn}
    return found | {"roots": roots}


def read(file: Path) -> Row:
    """The file, or one with no rows. Raises StudyError."""
    if not file.exists():
        return {"rays": [], "drawn": []}
    result = Packets.read(file)
    return result | {"animation": result.get("animation", [])}
