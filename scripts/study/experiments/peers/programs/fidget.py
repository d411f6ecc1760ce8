"""fidget: the solids as one expression, evaluated in intervals and by compiled code down to voxels."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from study.core.cli import CANNOT_RUN, StudyError
from study.core.host import child
from study.experiments.peers import peer as common
from study.experiments.peers import shade, shader
from study.experiments.peers.peer import Drawn, Job, Peer, run

WORKER = common.WORKERS / "fidget"
DEPTH = 1024  # voxels behind a pixel
NEAR = 10.0  # units before the camera; the voxels are even in 1/distance from here to bounds_radius
STEP = 1e-4  # of the normals


class Text:
    """An expression as fidget's text: a line for each operation. Arithmetic on an entry adds lines."""

    def __init__(self, lines: list[str], operation: str, *operands: Any) -> None:
        self.lines = lines
        names = [one.name if isinstance(one, Text) else str(one) for one in operands]
        self.name = f"_{len(lines)}"
        lines.append(" ".join([self.name, operation, *names]))

    def _with(self, operation: str, other: Any) -> Text:
        if not isinstance(other, Text):
            other = Text(self.lines, "const", repr(float(other)))
        return Text(self.lines, operation, self, other)

    def __add__(self, other: Any) -> Text:
        return self._with("add", other)

    def __sub__(self, other: Any) -> Text:
        return self._with("sub", other)

    def __mul__(self, other: Any) -> Text:
        return self._with("mul", other)

    def __abs__(self) -> Text:
        return Text(self.lines, "abs", self)

    def sqrt(self) -> Text:
        return Text(self.lines, "sqrt", self)


def largest(*values: Any) -> Any:
    """The greatest of entries, or of arrays."""
    first, *others = values
    for one in others:
        first = first._with("max", one) if isinstance(first, Text) else np.maximum(first, one)
    return first


def solid(s: dict[str, Any], p: list[Any], sqrt: Callable[[Any], Any]) -> Any:
    """A function of the point p that is below 0 inside the shape; not its distance. Raises StudyError."""
    if any(s.get("repeat", ())) or s.get("rounding"):
        raise StudyError("fidget gets no repeated shape and no rounded edges here")
    p = [x - at for x, at in zip(p, s.get("position", (0, 0, 0)), strict=True)]
    if any(s.get("rotation_degrees", ())):
        rows = shader.turn(s["rotation_degrees"])
        p = [p[0] * float(r[0]) + p[1] * float(r[1]) + p[2] * float(r[2]) for r in rows]
    x, y, z = p
    kind = s["type"]
    if kind == "sphere":
        return sqrt(x * x + y * y + z * z) - s["radius"]
    if kind == "plane":
        a, b, c = s["normal"]
        return x * a + y * b + z * c - s["offset"]
    if kind == "box":
        return largest(*(abs(q) - h for q, h in zip(p, s["half_size"], strict=True)))
    if kind == "octahedron":
        return abs(x) + abs(y) + abs(z) - s["radius"]
    round_y = sqrt(x * x + z * z)
    if kind == "torus":
        off = round_y - s["major_radius"]
        return sqrt(off * off + y * y) - s["minor_radius"]
    if kind == "cone":
        r1, r2, h = s["bottom_radius"], s["top_radius"], s["half_height"]
        return largest(round_y - (y * ((r2 - r1) / (2 * h)) + (r1 + r2) / 2), abs(y) - h)
    raise StudyError(f"fidget gets no {kind} here")


def expression(data: dict[str, Any]) -> str:
    """The union of the scene's solids. Raises StudyError."""
    lines: list[str] = []
    p = [Text(lines, f"var-{axis}") for axis in "xyz"]
    whole, *others = (solid(shape, p, Text.sqrt) for shape in data["shapes"])
    for one in others:
        whole = whole._with("min", one)
    return "\n".join(lines) + "\n"


def from_voxels(data: dict[str, Any], width: int, height: int) -> np.ndarray:
    """4 × 4: from column, row and voxel to the scene. Along a pixel 1/distance ahead is even in voxels."""
    seen, far = shader.camera(data, width, height), data["march"]["bounds_radius"]
    ahead, right, up = (np.array(seen[name]) for name in ("ahead", "right", "up"))
    made = np.zeros((4, 4))
    made[3, 2:] = (1 / NEAR - 1 / far) / DEPTH, 1 / far
    made[:3, 0], made[:3, 1] = right * 2 / width, up * -2 / height
    made[:3, 3] = ahead + right * (1 / width - 1) + up * (1 - 1 / height)
    made[:3] += np.outer(seen["position"], made[3])
    return made


def from_world(data: dict[str, Any], width: int, height: int) -> np.ndarray:
    """4 × 4: from fidget's world, which is its own map of the voxels, to the scene."""
    scale = min(width, height, DEPTH) / 2
    back = np.diag([scale, -scale, scale, 1.0])
    back[:3, 3] = width / 2, height / 2 - 1, DEPTH / 2
    return from_voxels(data, width, height) @ back


def shaded(data: dict[str, Any], depth: np.ndarray) -> np.ndarray:
    """The picture of voxels, height × width: its hits lie in the middle of theirs, or nowhere at 0."""
    height, width = depth.shape
    row, column = np.mgrid[:height, :width]
    voxels = np.stack([column, row, depth - 0.5, np.ones_like(row)], -1).reshape(-1, 4)
    made = voxels @ from_voxels(data, width, height).T
    points = made[:, :3] / made[:, 3:]
    d = points - data["camera"]["position"]
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    met = depth.ravel() > 0
    p = points[met]

    def at(where: np.ndarray) -> np.ndarray:
        return np.stack([solid(shape, list(where.T), np.sqrt) for shape in data["shapes"]])

    which = np.abs(at(p)).argmin(axis=0)
    taps = [at(p + e) - at(p - e) for e in STEP * np.eye(3)]
    n = np.stack([np.take_along_axis(tap, which[None], 0)[0] for tap in taps], -1)
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    return shade.colours(data, d, met, p, n, which).reshape(height, width, 3)


@dataclass(frozen=True)
class Fidget(Peer):
    @property
    def program(self) -> Path:
        return common.HOME / self.name / "target" / "release" / "draw_fidget"

    def lacking(self) -> str | None:
        return None if self.program.exists() else "needs cargo, and fidget from crates.io: --install"

    def install(self) -> None:
        if not shutil.which("cargo"):
            raise StudyError("needs cargo (rustup, or Debian's package cargo)", CANNOT_RUN)
        home = common.HOME / self.name
        shutil.copytree(WORKER, home, dirs_exist_ok=True)
        done = child.run(["cargo", "build", "--release", "-q"], cwd=home, capture_output=True, text=True)
        if done.returncode:
            said = [line for line in done.stderr.splitlines() if line.startswith("error")]
            raise StudyError(f"fidget cannot be built ({(said or ['no message'])[0]})", CANNOT_RUN)

    def draw(self, job: Job) -> Drawn:
        data, (width, height) = job.scene.data, job.size
        (job.folder / "scene.vm").write_text(expression(data), encoding="utf-8")
        matrix = [repr(float(x)) for x in from_world(data, width, height).ravel()]
        words = [*map(str, (width, height, DEPTH, job.threads, job.frames)), "depths", *matrix]
        said, _ = run([self.program, "scene.vm", *words], job, self.title)
        depth = np.fromfile(job.folder / "depths", "<u4").reshape(height, width)
        version = re.search('"=([0-9.]+)"', (WORKER / "Cargo.toml").read_text(encoding="utf-8"))
        assert version
        return Drawn(json.loads(said)["ns"], version[1], shaded(data, depth) if job.picture else None)


PEER = Fidget(
    name="fidget",
    title="fidget",
    timed="compiling the expression and finding voxels; nothing is shaded",
    differs=f"hits are the middles of {DEPTH:,} voxels between {NEAR:g} and 100 units; shaded by NumPy",
    least_db={"scene0_plain": 33},
)
