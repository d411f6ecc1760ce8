"""The phases' pictures of a verified run, embedded in the page to be compared pixel by pixel."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from study.core import html
from study.experiments.section import inside
from study.numbers.analysis import Data
from study.pictures import embed, images

WIDEST = (
    640  # pixels across; of a larger picture every second, third … pixel, so that each shown is one of its
)
MOST = 900_000  # bytes of all of them on the page


def _uri(pixels: np.ndarray) -> str:
    """Lossless, of 8-bit grey (height × width) or colour (… × 3)."""
    made = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(pixels)).save(made, format="png")
    return embed.exact(made.getvalue())


def _step(width: int) -> int:
    return -(-width // WIDEST)


def _picture(path: Path) -> np.ndarray | None:
    """The PNG's pixels, height × width × 3 bytes; None where the run has it no more."""
    return images.read_png(path) if path.is_file() else None


def _evaluations(path: Path) -> tuple[np.ndarray, int] | None:
    """Levels of 0 to 255 (height × width) and what 255 is, of an EXR with that channel."""
    plane = images.read(path).get("evals") if path.is_file() else None
    if plane is None or not np.isfinite(plane).all() or plane.max() <= 0:
        return None
    return np.round(255 * np.clip(plane / plane.max(), 0, 1)).astype(np.uint8), int(plane.max())


def _files(data: Data) -> list[tuple[str, str, Path]]:
    """Scene, phase and PNG: of each scene the reference, then its phases as verified."""
    found: dict[tuple[str, str], Path] = {}
    for scene in dict.fromkeys(pair["scene"] for pair in data.pairs):
        for pair in data.pairs:
            for who, name in ((pair["reference"], "reference_png"), (pair["phase"], "png")):
                if pair["scene"] == scene and name in pair:
                    found.setdefault((scene, who), inside(data.path, pair[name]))
    return [(*key, path) for key, path in found.items()]


def fragment(data: Data) -> str:
    """HTML of the pictures that the run still has; empty where it has none of two phases.

    What fits into MOST bytes, scenes in their order. The first picture that does not fit and all after it are
    left out, and a scene of which only one picture fits.
    """
    shown: dict[str, list[dict[str, Any]]] = {}
    heats: list[dict[str, Any]] = []
    left_out, used, step = 0, 0, 1
    for scene, phase, path in _files(data):
        if left_out:
            left_out += path.is_file()
            continue
        pixels = _picture(path)
        if pixels is None:
            continue
        every = _step(pixels.shape[1])
        uri = _uri(pixels[::every, ::every])
        if used + len(uri) > MOST:
            left_out = 1
            continue
        used, step = used + len(uri), max(step, every)
        shown.setdefault(scene, []).append({"scene": scene, "phase": phase, "uri": uri})
    pictures = [one for some in shown.values() if len(some) > 1 for one in some]
    for pair in data.pairs:
        scene = pair["scene"]
        if (
            len(shown.get(scene, ())) < 2
            or "reference_image" not in pair
            or scene in {h["scene"] for h in heats}
        ):
            continue
        if found := _evaluations(inside(data.path, pair["reference_image"])):
            levels, most = found
            every = _step(levels.shape[1])
            uri = _uri(levels[::every, ::every])
            used += len(uri)
            if used <= MOST:
                heats.append({"scene": scene, "phase": pair["reference"], "most": most, "uri": uri})
    if not pictures:
        return ""
    told = {"pictures": pictures, "evaluations": heats, "step": step, "left_out": left_out}
    return html.templates().get_template("pictures.html.j2").render(told)
