"""Rays for build/packets/hits: of the camera, to the light, mirrored, scattered."""

import functools
import math
import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from study.core import run, scene_json, temporary
from study.core.build import build
from study.core.host import child
from study.core.registry import Scene
from study.core.scene_json import Shape

KINDS = ("primary", "shadow", "mirror", "scattered")
SETTINGS = "STEPWISE_PACKETS"  # systems/packets/settings.h
TILE, BLOCK = 16, 4  # pixels on a side: systems/packets/trace.h
Rays = np.ndarray  # float32, (count, 7): origin, unit direction, far


def _unit(v: np.ndarray) -> np.ndarray:
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def places(width: int, height: int) -> tuple[np.ndarray, np.ndarray]:
    """Row and column of each pixel in the phase's order: tiles, in them blocks, in those rows."""
    row, column = (a.ravel() for a in np.mgrid[:height, :width])
    order = np.lexsort((column, row, column // BLOCK, row // BLOCK, column // TILE, row // TILE))
    return row[order], column[order]


def camera(data: dict[str, Any], width: int, height: int) -> Rays:
    """Camera rays in the order of `places`."""
    c = scene_json.read(data).camera
    ahead = _unit(np.subtract(c.look_at, c.position))
    right = _unit(np.cross(c.up, ahead))
    up, half = np.cross(ahead, right), math.tan(math.radians(c.vertical_fov_degrees) / 2)
    row, column = places(width, height)
    x, y = (2 * column + 1 - width) * half / height, (height - 2 * row - 1) * half / height
    d = _unit(ahead + x[:, None] * right + y[:, None] * up)
    return _packed(np.broadcast_to(c.position, d.shape), d)


def _packed(origin: np.ndarray, direction: np.ndarray, far: np.ndarray | float = math.inf) -> Rays:
    far = np.broadcast_to(far, len(direction))[:, None]
    return np.ascontiguousarray(np.hstack([origin, direction, far]), "<f4")


def normals(shapes: Sequence[Shape], points: np.ndarray, shape: np.ndarray) -> np.ndarray:
    """Normals of spheres and unturned planes."""
    centre = np.array([s.position for s in shapes], float)
    plane = np.array([s.normal for s in shapes], float)
    return _unit(np.where(plane[shape].any(1)[:, None], plane[shape], points - centre[shape]))


def secondary(
    data: dict[str, Any], rays: Rays, t: np.ndarray, shape: np.ndarray, seed: int
) -> dict[str, Rays]:
    """Rays from the hits of camera rays: from the light up to each that faces it, mirrored by every shape,
    and in any direction off the surface, in no order."""
    scene, met = scene_json.read(data), shape >= 0
    o, d = rays[met, :3].astype(float), rays[met, 3:6].astype(float)
    p = o + t[met, None] * d
    n = normals(scene.shapes, p, shape[met].astype(int))
    n = np.where((n * d).sum(1, keepdims=True) > 0, -n, n)
    offset = scene.march.surface_offset
    light = np.array(scene.light.position, float)
    to = p - light
    length = np.linalg.norm(to, axis=1)
    lit = (to * n).sum(1) < 0
    dice = np.random.default_rng(seed)
    any_way = _unit(dice.normal(size=n.shape))
    any_way *= np.sign((any_way * n).sum(1, keepdims=True))
    order = dice.permutation(len(n))
    return {
        "shadow": _packed(np.broadcast_to(light, to[lit].shape), _unit(to[lit]), length[lit] - 10 * offset),
        "mirror": _packed(p + offset * n, _unit(d - 2 * (d * n).sum(1, keepdims=True) * n)),
        "scattered": _packed((p + offset * n)[order], any_way[order]),
    }


@functools.cache
def asserts(program: Path) -> bool:
    """Whether the program's Embree was built with assertions, as Debian's 3.13.5 is: it could be faster."""
    linked = child.run(["ldd", program], capture_output=True, text=True, check=False).stdout
    library = re.search(r"libembree\S* => (/\S+)", linked)
    return bool(library) and b"__assert_fail" in Path(library[1]).read_bytes()


class Record(msgspec.Struct):
    """What the program says. Times are of repetitions, in ns; of Embree's ways those that it has."""

    ns: list[float]
    lanes: int
    settings: str
    embree: str
    embree16_ns: list[float] = []
    embree1_ns: list[float] = []
    embree_stream_ns: list[float] = []


def hits(
    scene: Path,
    rays: Rays,
    kind: str,
    words: str = "",
    limit: str = "",
    reps: int = 1,
    beside: bool = False,
    *,
    cpu: int | None = None,
    env_bytes: int = 0,
) -> tuple[Record, np.ndarray]:
    """The program's record and hits, shape (1 or 2, count, 2): t and shape, of the phase and of Embree.
    `cpu`, `env_bytes`: as run.frames has them, of one thread. Raises DriverError."""
    program = build("packets", "hits")
    told = {SETTINGS: words} | ({"STEPWISE_ISA_LIMIT": limit} if limit else {})
    cpus = run.cpu_set(cpu, 1) or set(run.USABLE)
    options = ["--embree"] * beside + ["--any"] * (kind == "shadow")
    options += ["--coherent"] * (kind in ("primary", "shadow"))
    with temporary.folder() as scratch:
        out = scratch / "hits"
        command = [program, scene, *options, "--reps", reps, "-o", out]
        done = child.run(
            [str(w) for w in command],
            input=rays.tobytes(),
            capture_output=True,
            env=run.environment(env_bytes, more=told),
            preexec_fn=lambda: os.sched_setaffinity(0, cpus),
        )
        if done.returncode != 0:
            raise run.DriverError(done.returncode, done.stderr.decode(errors="replace").strip())
        pairs = np.fromfile(out, "<f4").reshape(-1, len(rays), 2)
    record = msgspec.json.decode(done.stdout, type=Record)
    if beside and asserts(Path(program)):
        record.embree += ", a build with assertions"
    return record, pairs


def all_kinds(scene: Scene, height: int, seed: int) -> dict[str, Rays]:
    rays = camera(scene.data, *scene.size(height))
    _, found = hits(scene.path, rays, "primary")
    return {"primary": rays, **secondary(scene.data, rays, *found[0].T, seed)}
