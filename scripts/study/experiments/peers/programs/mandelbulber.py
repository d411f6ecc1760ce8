"""Mandelbulber 2: a renderer of fractals, whose `iq_bulb` is our Mandelbulb with the same distance estimate.

Its colours are its own, so its picture is shaded here from the normal and place that it finds for each pixel.
Its settings files are described by `mandelbulber2 --list`.
"""

from __future__ import annotations

import re
import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio

from study.core.cli import CANNOT_RUN, StudyError
from study.experiments.peers import shade, shader
from study.experiments.peers.peer import Drawn, Job, Peer, from_debian, run

TIME = re.compile(r"Idle: 100% Done, total time: ([0-9.]+)s")
IQ_BULB = 83  # the formula's number
CHANNELS = ("normalWorld", "world", "zbuffer")
FULL = 65535  # of its PNGs' 16 bits, which stand for 1
MIRROR = np.array([-1.0, 1, 1])  # its coordinates are right-handed; the Mandelbulb is its own mirror image


def vector(v: Sequence[float]) -> str:
    """In its coordinates."""
    return " ".join(map(repr, (v * MIRROR).tolist()))


def parts(data: dict[str, Any]) -> tuple[int, int | None]:
    """Numbers of the Mandelbulb and of the floor. Raises StudyError for a scene that it cannot draw."""
    kinds = [shape["type"] for shape in data["shapes"]]
    if sorted(kinds) not in (["mandelbulb"], ["mandelbulb", "plane"]):
        raise StudyError("Mandelbulber gets one Mandelbulb, with or without a floor")
    floor = kinds.index("plane") if "plane" in kinds else None
    if floor is not None:
        x, y, z = data["shapes"][floor]["normal"]
        if x or z or y <= 0:
            raise StudyError("Mandelbulber gets a floor that faces up (+y)")
    if data["light"]["shadows"] != "none" or any(m["reflectivity"] for m in data["materials"].values()):
        raise StudyError("Mandelbulber has other soft shadows and mirrors")
    return kinds.index("mandelbulb"), floor


def settings(data: dict[str, Any], width: int, height: int, threads: int) -> str:
    """The scene for it. Its rays go through the upper left corners of pixels. A picture with a row and a
    column more has rays through the centres of ours everywhere but there."""
    bulb, floor = parts(data)
    shape, view, march = data["shapes"][bulb], shader.camera(data, width, height), data["march"]
    position = np.array(shape.get("position", (0, 0, 0)), float)
    eye = np.subtract(view["position"], position)
    half = float(np.linalg.norm(view["up"]))
    main = {
        "N": shape["iterations"],
        "bailout": shape["bailout"] ** 0.5,  # ours is of the square
        "use_default_bailout": "false",
        "formula_1": IQ_BULB,
        "camera": vector(eye),
        "target": vector(eye + view["ahead"]),
        "camera_top": vector(view["up"]),
        "camera_distance_to_target": 1,
        "fov": 2 * half * (height + 1) / height,
        "image_width": width + 1,
        "image_height": height + 1,
        "constant_DE_threshold": "true",
        "DE_thresh": march["hit_distance"],
        "view_distance_max": 2 * march["bounds_radius"],
        "shadows_enabled": "false",
        "glow_enabled": "false",
        "limit_CPU_cores": threads,
    }
    for name in CHANNELS:
        main |= {f"{name}_enabled": "true", f"{name}_quality": 1}
    if floor is not None:
        plane = data["shapes"][floor]
        at = [0, plane["offset"] / plane["normal"][1] - position[1], 0]
        main |= {"primitive_plane_1_enabled": "true", "primitive_plane_1_position": vector(at)}
        main |= {"primitive_plane_1_rotation": "90 0 0"}
    lines = [
        "# Mandelbulber settings file",
        "# version 2.20",
        "# only modified parameters",
        "[main_parameters]",
    ]
    lines += [f"{key} {value};" for key, value in main.items()]
    return "\n".join([*lines, "[fractal_1]", "transf_pwr_8 8;", "transf_pwr_8a 8;"]) + "\n"


def read(path: Path) -> np.ndarray:
    """A channel from 0 to 1, without the row and the column that are not ours."""
    file = oiio.ImageInput.open(str(path))
    if file is None:
        raise StudyError(f"Mandelbulber: wrote no readable {path.name}", CANNOT_RUN)
    try:
        return file.read_image("uint16")[1:, 1:].astype(float) / FULL
    finally:
        file.close()


def places(fraction: np.ndarray, eye: np.ndarray, d: np.ndarray) -> np.ndarray:
    """Points of the Mandelbulb on rays from `eye` in directions `d`, of which `fraction` are the coordinates
    modulo 1: of those within 2 of its middle, the nearest to the ray. All are pixels × 3."""
    whole = np.stack(np.meshgrid(*[np.arange(-2, 2)] * 3), -1).reshape(-1, 1, 3) * (FULL + 1) / FULL
    best, least = np.empty_like(fraction), np.full(len(fraction), np.inf)
    for more in whole:
        there = fraction + more
        along = ((there - eye) * d).sum(1, keepdims=True)
        off = np.linalg.norm(there - eye - along * d, axis=1)
        better = off < least
        best[better], least[better] = there[better], off[better]
    return best


def shaded(data: dict[str, Any], size: tuple[int, int], channels: dict[str, np.ndarray]) -> np.ndarray:
    """Linear colours by its channels, which are height × width × 3 or 1."""
    (width, height), (bulb, floor), view = size, parts(data), shader.camera(data, *size)
    y, x = ((1 - height + 2 * np.arange(height)) / -height, (1 - width + 2 * np.arange(width)) / width)
    d = view["ahead"] + np.multiply.outer(y, view["up"])[:, None] + np.multiply.outer(x, view["right"])[None]
    d = (d / np.linalg.norm(d, axis=-1, keepdims=True)).reshape(-1, 3)
    met = channels["zbuffer"].reshape(-1) < 1
    n = ((2 * channels["normalWorld"] - 1) * MIRROR).reshape(-1, 3)[met]
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    eye, position = np.array(view["position"], float), data["shapes"][bulb].get("position", (0, 0, 0))
    p = MIRROR * places(
        channels["world"].reshape(-1, 3)[met], MIRROR * (eye - position), MIRROR * d[met]
    ) + np.array(position)
    which = np.full(len(p), bulb)
    if floor is not None:
        plane = data["shapes"][floor]
        t = (plane["offset"] / plane["normal"][1] - eye[1]) / d[met, 1]
        flat = (n[:, 1] > 1 - 1e-6) & (t > 0)
        p[flat], which[flat] = (eye + t[:, None] * d[met])[flat], floor
    return shade.colours(data, d, met, p, n, which).reshape(height, width, 3).astype(np.float32)


@dataclass(frozen=True)
class Mandelbulber(Peer):
    """Timed with the channels and without their files, which are written afterwards."""

    def lacking(self) -> str | None:
        return from_debian("mandelbulber2", "mandelbulber2")

    def draw(self, job: Job) -> Drawn:
        text = settings(job.scene.data, *job.size, job.threads)
        (job.folder / "scene.fract").write_text(text, encoding="utf-8")
        command = [shutil.which("mandelbulber2") or "mandelbulber2", "--nogui", "--no-cli-color"]
        command += ["--format", "png", "--output", "picture", "scene.fract"]
        ns = []
        for _ in range(job.frames):
            said, more = run(command, job, self.title, HOME=str(job.folder))
            found = TIME.search(said + more)
            if not found:
                raise StudyError(f"{self.title}: says no time", CANNOT_RUN)
            ns.append(float(found[1]) * 1e9)
        version = re.search(r"^Mandelbulber (\S+)", said + more, re.MULTILINE)
        rgb = None
        if job.picture:
            channels = {name: read(job.folder / f"picture_{name}.png") for name in CHANNELS}
            rgb = shaded(job.scene.data, job.size, channels)
        return Drawn(ns, version[1] if version else "unknown", rgb)


PEER = Mandelbulber(
    name="mandelbulber",
    title="Mandelbulber",
    timed="its own time of a frame, to 0.1 s, with its shading",
    differs="its hits are coloured by NumPy, with its normals: differences over a shorter step, to 16 bits",
    least_db={"mandelbulb_plain": 35},
)
