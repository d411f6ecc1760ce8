"""fidget: the solids as one expression, evaluated in intervals and by compiled code down to voxels."""

from __future__ import annotations

import functools
import math
import re
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from study.core.cli import CANNOT_RUN, StudyError
from study.core.host import child
from study.core.scene_json import GROUP, Content, Shape
from study.experiments.peers import shader
from study.experiments.peers.peer import WORKERS, Drawn, Job, Peer, Said, run

WORKER = WORKERS / "fidget"
DEPTH = 1024  # voxels behind a pixel
NEAR = 10.0  # units before the camera; the voxels are even in 1/distance from here to bounds_radius
STEP = 1e-4  # of the normals
OPERATIONS = {np.add: "add", np.subtract: "sub", np.multiply: "mul", np.absolute: "abs"}
OPERATIONS |= {np.sqrt: "sqrt", np.minimum: "min", np.maximum: "max"}
OPERATIONS |= {np.sin: "sin", np.cos: "cos", np.negative: "neg"}


class Text(np.lib.mixins.NDArrayOperatorsMixin):
    """A number in fidget's text, whose lines are operations: NumPy's on a Text add one."""

    def __init__(self, lines: list[str], *words: str) -> None:
        self.lines, self.name = lines, f"_{len(lines)}"
        lines.append(" ".join([self.name, *words]))

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *operands: Any) -> Text:
        texts = [x if isinstance(x, Text) else Text(self.lines, "const", repr(float(x))) for x in operands]
        return Text(self.lines, OPERATIONS[ufunc], *(x.name for x in texts))


def in_frame(s: Shape, p: np.ndarray) -> np.ndarray:
    """The point as the shape sees it, before a twist. Raises StudyError."""
    if any(s.repeat):
        raise StudyError("fidget gets no repeated shape here")
    p = (p.T - s.position).T
    if any(s.rotation_degrees):
        p = shader.turn(s.rotation_degrees) @ p
    axes = [abs(q) if axis in s.mirror else q for axis, q in zip("xyz", p, strict=True)]
    return np.array(axes, p.dtype) if s.mirror else p


def leaf(s: Shape, p: np.ndarray) -> Any:
    """Below 0 inside a shape that is no group, with its modifiers. Raises StudyError."""
    at = p = in_frame(s, p)
    if s.twist:
        sine, cosine = np.sin(p[1] * s.twist), np.cos(p[1] * s.twist)
        p = np.array([cosine * p[0] - sine * p[2], p[1], sine * p[0] + cosine * p[2]], p.dtype)
    f = unchanged(s, p)
    if s.displace:
        waves = [np.sin(q * by) for q, by in zip(at, s.displace.frequency, strict=True)]
        f = f + waves[0] * waves[1] * waves[2] * s.displace.amplitude
    if s.shell:
        f = abs(f) - s.shell
    return f - s.offset if s.offset and s.type != "plane" else f


def solid(s: Shape, p: np.ndarray, seen: list | None = None) -> Any:
    """Below 0 inside the shape or group; not its distance. `p`: 3 Texts, or 3 × n coordinates. Appends the
    same of each leaf to `seen`. Raises StudyError."""
    if s.type != GROUP:
        found = leaf(s, p)
        if seen is not None:
            seen.append(found)
        return found
    if s.blend or s.twist or s.displace or s.shell or s.offset:
        raise StudyError("fidget gets no blend and no changed group here")
    p = in_frame(s, p)
    first, *rest = (solid(one, p, seen) for one in s.shapes)
    if s.operation == "difference":
        rest = [-one for one in rest]
    return functools.reduce(np.minimum if s.operation == "union" else np.maximum, [first, *rest])


def unchanged(s: Shape, p: np.ndarray) -> Any:
    (x, y, z), kind = p, s.type
    if kind == "sphere":
        return np.sqrt(x * x + y * y + z * z) - s.radius
    if kind == "plane":
        a, b, c = s.normal
        return x * a + y * b + z * c - s.offset
    if kind == "box" and s.rounding:
        out = [np.maximum(abs(q) - h, 0) for q, h in zip(p, s.half_size, strict=True)]
        return np.sqrt(out[0] * out[0] + out[1] * out[1] + out[2] * out[2]) - s.rounding
    if kind == "box":
        return functools.reduce(np.maximum, [abs(q) - h for q, h in zip(p, s.half_size, strict=True)])
    if kind == "octahedron":
        return abs(x) + abs(y) + abs(z) - s.radius
    if kind == "capsule":
        past = np.maximum(abs(y) - s.half_height, 0)
        return np.sqrt(x * x + past * past + z * z) - s.radius
    if kind == "gyroid":
        turns = [q * (2 * math.pi / s.cell) for q in p]
        wave = sum(np.sin(turns[i]) * np.cos(turns[(i + 1) % 3]) for i in range(3))
        return abs(wave) - s.thickness * math.pi * math.sqrt(3) / s.cell
    round_y = np.sqrt(x * x + z * z)
    if kind == "torus":
        off = round_y - s.major_radius
        return np.sqrt(off * off + y * y) - s.minor_radius
    if kind == "cone":
        r1, r2, h = s.bottom_radius, s.top_radius, s.half_height
        return np.maximum(round_y - (y * ((r2 - r1) / (2 * h)) + (r1 + r2) / 2), abs(y) - h)
    raise StudyError(f"fidget gets no {kind} here")


def expression(scene: Content) -> str:
    """The union of the scene's solids. Raises StudyError."""
    lines: list[str] = []
    p = np.array([Text(lines, f"var-{axis}") for axis in "xyz"], object)
    functools.reduce(np.minimum, [solid(shape, p) for shape in scene.shapes])
    return "\n".join(lines) + "\n"


def from_voxels(scene: Content, width: int, height: int) -> np.ndarray:
    """4 × 4: from column, row and voxel to the scene. Along a pixel 1/distance ahead is even in voxels."""
    seen, far = shader.camera(scene, width, height), scene.march.bounds_radius
    made = np.zeros((4, 4))
    made[3, 2:] = (1 / NEAR - 1 / far) / DEPTH, 1 / far
    made[:3, 0], made[:3, 1] = seen.right * 2 / width, seen.up * -2 / height
    made[:3, 3] = seen.ahead + seen.right * (1 / width - 1) + seen.up * (1 - 1 / height)
    made[:3] += np.outer(seen.position, made[3])
    return made


def from_world(scene: Content, width: int, height: int) -> np.ndarray:
    """4 × 4: from fidget's world, which is its own map of the voxels, to the scene."""
    scale = min(width, height, DEPTH) / 2
    back = np.diag([scale, -scale, scale, 1.0])
    back[:3, 3] = width / 2, height / 2 - 1, DEPTH / 2
    return from_voxels(scene, width, height) @ back


def shaded(scene: Content, depth: np.ndarray) -> np.ndarray:
    """The picture of voxels, height × width: its hits lie in the middle of theirs, or nowhere at 0."""
    row, column = np.mgrid[: depth.shape[0], : depth.shape[1]]
    voxels = np.stack([column, row, depth - 0.5, np.ones_like(row)]).reshape(4, -1)
    made = from_voxels(scene, depth.shape[1], depth.shape[0]) @ voxels
    points = (made[:3] / made[3]).T
    d = points - scene.camera.position
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    met = depth.ravel() > 0
    p = points[met]

    def at(where: np.ndarray, near: Any = np.inf) -> np.ndarray:
        made = []
        for shape in scene.shapes:
            seen: list = []
            far = np.abs(solid(shape, where.T, seen))
            made += [np.where(far > near, np.inf, one) for one in seen]
        return np.stack(made)

    nearest = np.min([np.abs(solid(shape, p.T)) for shape in scene.shapes], axis=0)
    which = np.abs(at(p, nearest)).argmin(axis=0)
    n = np.stack([(at(p + e) - at(p - e))[which, np.arange(len(p))] for e in STEP * np.eye(3)], -1)
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    return shader.colours(scene, d, met, p, n, which).reshape(*depth.shape, 3)


@dataclass(frozen=True)
class Fidget(Peer):
    @property
    def program(self) -> Path:
        return self.home / "target" / "release" / "draw_fidget"

    def lacking(self) -> str | None:
        return None if self.program.exists() else "needs cargo, and fidget from crates.io: --install"

    def install(self) -> None:
        if not shutil.which("cargo"):
            raise StudyError("needs cargo (rustup, or Debian's package cargo)", CANNOT_RUN)
        shutil.copytree(WORKER, self.home, dirs_exist_ok=True)
        done = child.run(["cargo", "build", "--release", "-q"], cwd=self.home, capture_output=True, text=True)
        if done.returncode:
            said = [line for line in done.stderr.splitlines() if line.startswith("error")]
            raise StudyError(f"fidget cannot be built ({(said or ['no message'])[0]})", CANNOT_RUN)

    def draw(self, job: Job) -> Drawn:
        scene, (width, height) = job.scene.content, job.size
        (job.folder / "scene.vm").write_text(expression(scene), encoding="utf-8")
        matrix = [repr(float(x)) for x in from_world(scene, width, height).ravel()]
        words = [*map(str, (width, height, DEPTH, job.threads, job.frames)), "depths", *matrix]
        said, _ = run([self.program, "scene.vm", *words], job, self.title)
        depth = np.fromfile(job.folder / "depths", "<u4").reshape(height, width)
        cargo = (WORKER / "Cargo.toml").read_text(encoding="utf-8")
        (version,) = re.findall(r'fidget = .*"=([\d.]+)"', cargo)
        rgb = shaded(scene, depth) if job.picture else None
        return Drawn(msgspec.json.decode(said, type=Said).ns, version, rgb)


PEER = Fidget(
    name="fidget",
    title="fidget",
    timed="compiling the expression and finding voxels; nothing is shaded",
    differs=f"hits are the middles of {DEPTH:,} voxels between {NEAR:g} and 100 units; shaded by NumPy",
    least_db={"scene0_plain": 33, "csg_plain": 30, "bumpy_plain": 30},
)
