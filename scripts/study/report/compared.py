"""The phases' pictures of a verified run, embedded in the page to be compared pixel by pixel."""

from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from study.core import html
from study.numbers.analysis import Data
from study.pictures import embed, images

WIDEST = 640  # pixels across on the page
MOST = 900_000  # bytes of all of them on the page
KEPT, SCENES = 320, 2  # of a published run: pixels across, scenes
FIRST = ("scene0", "mandelbulb")  # the paper's scenes


def _thinned(pixels: np.ndarray, most: int) -> tuple[np.ndarray, int]:
    """Every second, third … pixel each way, at most `most` across; and which."""
    every = -(-pixels.shape[1] // most)
    return np.ascontiguousarray(pixels[::every, ::every]), every


def _evaluations(path: Path) -> tuple[np.ndarray, int] | None:
    """Levels of 0 to 255 (height × width) and what 255 is, of an EXR with that channel."""
    plane = images.read(path).get("evals") if path.is_file() else None
    if plane is None or not np.isfinite(plane).all() or plane.max() <= 0:
        return None
    return np.round(255 * np.clip(plane / plane.max(), 0, 1)).astype(np.uint8), int(plane.max())


def _files(data: Data) -> list[tuple[str, str, int, Path]]:
    """Scene, phase, pixels across as verified, and PNG: of each scene the reference, then its phases;
    what the run still has. Scenes that were given by a path come first."""
    found: dict[tuple[str, str], tuple[int, Path]] = {}
    scenes = {pair.scene for pair in data.pairs}
    first = [one for one in (*data.context.scenes, *FIRST) if one in scenes]
    for scene in [*first, *sorted(scenes - {*first})]:
        for pair in data.pairs:
            for who, png in ((pair.reference, pair.reference_png), (pair.phase, pair.png)):
                if pair.scene == scene and png and (data.path / png).is_file():
                    found.setdefault((scene, who or ""), (pair.width, data.path / png))
    return [(*key, *value) for key, value in found.items()]


def ends(data: Data) -> list[tuple[str, str, Path]]:
    """Scene, phase and PNG: of the first two scenes the reference's picture and the last phase's."""
    by_scene: dict[str, list[tuple[str, str, Path]]] = {}
    for scene, phase, _, path in _files(data):
        by_scene.setdefault(scene, []).append((scene, phase, path))
    several = [some for some in by_scene.values() if len(some) > 1][:SCENES]
    return [end for some in several for end in (some[0], some[-1])]


def kept(data: Data) -> dict[Path, np.ndarray]:
    """What a published run keeps for the slider, at most KEPT pixels across."""
    return {path: _thinned(images.read_png(path), KEPT)[0] for _, _, path in ends(data)}


def fragment(data: Data) -> str:
    """HTML of the pictures that the run still has; empty where it has none of two phases.

    What fits into MOST bytes, scenes in their order. The first picture that does not fit and all after it are
    left out, and a scene of which only one picture fits.
    """
    shown: dict[str, list[dict[str, Any]]] = {}
    heats: list[dict[str, Any]] = []
    left_out, used, step = 0, 0, 1
    for scene, phase, width, path in _files(data):
        if left_out:
            left_out += 1
            continue
        small, every = _thinned(images.read_png(path), WIDEST)
        uri = embed.exact(Image.fromarray(small))
        if used + len(uri) > MOST:
            left_out = 1
            continue
        used, step = used + len(uri), max(step, every, -(-width // small.shape[1]))
        shown.setdefault(scene, []).append({"scene": scene, "phase": phase, "uri": uri})
    pictures = [one for some in shown.values() if len(some) > 1 for one in some]
    for pair in data.pairs:
        scene = pair.scene
        if len(shown.get(scene, ())) < 2 or not pair.reference_image or scene in {h["scene"] for h in heats}:
            continue
        if found := _evaluations(data.path / pair.reference_image):
            levels, most = found
            uri = embed.exact(Image.fromarray(_thinned(levels, WIDEST)[0]))
            used += len(uri)
            if used <= MOST:
                heats.append({"scene": scene, "phase": pair.reference, "most": most, "uri": uri})
    if not pictures:
        return ""
    told = {"pictures": pictures, "evaluations": heats, "step": step, "left_out": left_out}
    return html.templates().get_template("pictures.html.j2").render(told)
