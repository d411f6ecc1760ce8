"""CPU-RTRM's scene (common/scenes/lattice.json) by every phase of the ladder: what lattice.json says.

The scene is made from a description of that program's: an infinite lattice of rounded cubes and spheres. What
it takes for a frame was measured elsewhere, by others; results/keys/ has the keys.
"""

from __future__ import annotations

import contextlib
import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from study.core import registry, run, store
from study.core.registry import Scene, Spec
from study.experiments.lattice.schema import Lattice
from study.measuring import hits
from study.numbers import stats
from study.pictures.images import Picture
from study.truth import truth

Row = dict[str, Any]
FILE, SCENE = "lattice.json", "lattice"
SIZES = ((1000, 562), (1280, 720))
# CPU-RTRM's own program, its own shading: ms by threads.
PROGRAM = {"size": (1280, 720), "ms": {1: 57.7, 2: 33.1}, "machine": "a 2-core Zen 5 VM at 4.27 GHz"}
PAPER = 14  # times as fast as CPU-RTRM with threads, as the paper has its own last step
# Functions of normals, light and colours alone (phases/*/costs.def), not what the march calls, too.
SHADING = frozenset(
    [
        *("normal_at", "normal_on", "near_hit", "gradient_of", "box_gradient", "difference"),
        *("scene_difference", "surface_at", "surface_of", "find_surfaces", "light_at", "light_from"),
        *("light_surfaces", "queue_or_add", "color_of", "shade_packets", "lit_color", "add_light"),
        *("vec_reflect", "add_phong", "primary_light", "shade_primary_hit", "shade_primary_row"),
        *("primary_material", "trace", "exp_of", "log_of", "power_of", "v_exp", "v_log", "v_pow"),
    ]
)
BEHIND = 1e4  # scene units ahead of the camera, whence light falls on what faces away from it


@dataclass(frozen=True)
class Point:
    """A phase at a size on a number of threads; `lit`: by the scene's own light."""

    phase: str
    size: tuple[int, int]
    threads: int
    lit: bool = True


def points(names: Sequence[str], sizes: Sequence[tuple[int, int]], threads: Sequence[int]) -> list[Point]:
    """Every phase at every size, with more threads where it has them; without its light at the last size."""
    made = []
    for size in sizes:
        for name in names:
            most = registry.find_phase(name).threads
            made += [Point(name, size, count) for count in dict.fromkeys(threads) if count == 1 or most]
    return made + [Point(name, sizes[-1], 1, lit=False) for name in names]


def unlit(scene: Scene, folder: Path) -> Path:
    """The scene with its light far behind what is seen, which then shades hardly anything of it."""
    camera = scene.data["camera"]
    eye, at = (np.array(camera[key], float) for key in ("position", "look_at"))
    light = {"position": (eye + (at - eye) / np.linalg.norm(at - eye) * BEHIND).tolist()}
    path = folder / f"{scene.name}-unlit.json"
    store.write_json(path, {**scene.data, "light": {**scene.data["light"], **light}})
    return path


def still_lit(scene: Scene, exact: dict[str, np.ndarray]) -> float:
    """Share of the hits that face a light so far ahead of the camera."""
    camera = scene.data["camera"]
    ahead = np.array(camera["look_at"], float) - np.array(camera["position"], float)
    facing = sum(exact[f"N.{axis}"] * part for axis, part in zip("xyz", ahead, strict=True))
    return float((facing[exact["id"] >= 0] > 0).mean())


def shading(name: str, scene: Scene, size: tuple[int, int]) -> float | None:
    """Share of a frame's FLOPs (machine convention) in SHADING: a lower bound of what shading takes, exact
    and the same on every machine. None for what cannot be counted here, and for baseline and opt1, whose
    arithmetic is in functions of vectors that the march calls, too.
    """
    try:
        said = run.render(name, scene.path, size[1], size[0], target="render-count", timed=False)
    except run.DriverError:
        return None
    if "vec_dot" in said["by_function"]:
        return None
    own = sum(found["machine"] for function, found in said["by_function"].items() if function in SHADING)
    return float(own / said["flops"]["machine"])


def once(point: Point, padding: int, *, paths: dict[bool, Path], cpu: int) -> float:
    """Median ns of a launch's frames: one frame of the phases in doubles, which take seconds."""
    slow = registry.find_phase(point.phase).precision == "double"
    how = {"cpu": cpu, "threads": point.threads, "env_bytes": padding}
    how |= {"warmup": 0, "reps": 1} if slow else {"warmup": 1, "reps": 5}
    width, height = point.size
    with contextlib.closing(run.frames(point.phase, paths[point.lit], height, width, **how)) as made:
        return float(np.median([frame["ns"] for frame in made if not frame["warmup"]]))


def rows(times: dict[Point, list[float]], errors: dict[str, Row]) -> list[Row]:
    """One per phase, size and threads: ms, times as fast as CPU-RTRM's figure, the light's share of it."""
    made = []
    for point, ns in times.items():
        if not point.lit:
            continue
        theirs = PROGRAM["ms"].get(point.threads) if point.size == PROGRAM["size"] else None
        ms = stats.median_interval(np.array(ns) * 1e-6)
        dark = times.get(Point(point.phase, point.size, point.threads, lit=False))
        share = None if dark is None else stats.ratio_interval(dark, ns)
        made.append(
            {
                **{
                    "phase": point.phase,
                    "width": point.size[0],
                    "n": point.size[1],
                    "threads": point.threads,
                },
                **{"ms": ms.value, "ms_low": ms.low, "ms_high": ms.high, "ns": ns},
                "program_ms": theirs,
                **{
                    f"program{end}": None if theirs is None else theirs / value
                    for end, value in (("", ms.value), ("_low", ms.high), ("_high", ms.low))
                },
                **{
                    f"light{end}": None if share is None else 1 - value
                    for end, value in (
                        ("", share.value if share else 0),
                        ("_low", share.high if share else 0),
                        ("_high", share.low if share else 0),
                    )
                },
                **errors[point.phase],
            }
        )
    return made


def _errors(name: str, exact: Picture, scene: Scene, size: tuple[int, int]) -> Row:
    found: Row = msgspec.to_builtins(hits.errors(exact, hits.picture(name, scene, size)))
    return found


def study(
    names: Sequence[str],
    sizes: Sequence[tuple[int, int]],
    threads: Sequence[int],
    launches: int,
    seed: int,
    cpu: int,
    error_n: int,
    scratch: Path,
) -> Row:
    """All of lattice.json but the context. Raises StudyError."""
    scene = registry.find_scene(SCENE)
    size = scene.size(error_n)
    exact = truth.picture(scene, size)
    errors = {name: _errors(name, exact, scene, size) for name in names}
    for name, row in errors.items():
        row["shading"] = shading(name, scene, size)
    paths = {True: scene.path, False: unlit(scene, scratch)}
    timed = functools.partial(once, paths=paths, cpu=cpu)
    times = run.interleaved(points(names, sizes, threads), launches, seed, cpu, timed, "lattice")
    program = {**PROGRAM, "ms": {str(count): ms for count, ms in PROGRAM["ms"].items()}}
    return {
        "program": program,
        "paper": PAPER,
        "error_size": size,
        "still_lit": still_lit(scene, exact),
        "known": float((exact["status"] >= truth.CONVERGED).mean()),
        "rows": rows(times, errors),
    }


def able(names: Sequence[str] | None) -> list[str]:
    """The phases named, or the ladder's, that this CPU can run."""
    wanted = names or list(registry.ladder())
    return [name for name in dict.fromkeys(wanted) if registry.cpu_supports(Spec.parse(name))]


def read(path: Path) -> Row:
    """A run's lattice.json; without that file no row. Raises StudyError for another thing's JSON."""
    if not path.exists():
        return {"rows": []}
    return Lattice.read(path)


def best(result: Row, threads: int) -> Row | None:
    """The fastest at the size of CPU-RTRM's figure on so many threads."""
    mine = [r for r in result["rows"] if r["threads"] == threads and r["program_ms"] is not None]
    return min(mine, key=lambda r: r["ms"] if math.isfinite(r["ms"]) else math.inf, default=None)
