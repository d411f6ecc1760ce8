"""What a figure says: its numbers and words, kept within its PNG file, whichever Matplotlib drew it.

Not where text stands, nor ticks, nor legends' places: these change with Matplotlib's versions.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import Collection
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle
from PIL import Image
from PIL.PngImagePlugin import PngInfo

from study.core.cli import StudyError
from study.core.json_files import parsed
from study.pictures import embed

KEY = "Contents"  # of the PNG's text chunk
DIGITS = 6


def of(figure: Figure) -> dict[str, Any]:
    """The figure's contents as JSON types. Numbers are in data coordinates; NaN and infinities as words."""
    words = [text.get_text() for text in figure.texts]  # the title and what is below are among them
    for legend in figure.legends:
        words += [text.get_text() for text in legend.get_texts()]
    return {"words": _words(words), "axes": [_axes(axes) for axes in figure.axes]}


def chunk(figure: Figure) -> PngInfo:
    """The contents, compressed, for PIL's `save(…, pnginfo=…)`."""
    made = PngInfo()
    made.add_text(KEY, json.dumps(of(figure), ensure_ascii=True), zip=True)
    return made


def read(path: Path) -> dict[str, Any]:
    """The contents that a PNG of draw.save keeps. StudyError for a picture without."""
    with embed.reading(path), Image.open(path) as picture:
        picture.load()
        text = getattr(picture, "text", {}).get(KEY)
    if text is None:
        raise StudyError(f"{path}: keeps no contents of a figure; draw it again with scripts/stepwise redraw")
    return parsed(text.encode("utf-8", "replace"), str(path))


def _axes(axes: Axes) -> dict[str, Any]:
    words = [axes.get_title(), axes.get_xlabel(), axes.get_ylabel()]
    words += [text.get_text() for text in axes.texts]
    if legend := axes.get_legend():
        words += [text.get_text() for text in legend.get_texts()]
    return {
        "words": _words(words),
        "scales": [axes.get_xscale(), axes.get_yscale()],
        "lines": [[to_hex(line.get_color()), _numbers(line.get_xydata())] for line in axes.lines],
        "marks": [[_colours(one), _numbers(_places(one))] for one in axes.collections],
        "patches": [[to_hex(one.get_facecolor()), _numbers(_outline(one))] for one in axes.patches],
    }


def _words(texts: list[str]) -> list[str]:
    """Without empty ones; on one line, since where a line breaks is a matter of the layout."""
    return [" ".join(text.split()) for text in texts if text.strip()]


def _colours(drawn: Collection) -> list[str]:
    both = [to_hex(c) for colours in (drawn.get_facecolor(), drawn.get_edgecolor()) for c in colours]
    return list(dict.fromkeys(both))


def _places(drawn: Collection) -> np.ndarray:
    """Of points their places, of lines and areas their corners."""
    places = np.asarray(drawn.get_offsets(), float).reshape(-1, 2)
    if len(places) and places.any():
        return places
    corners = [path.vertices for path in drawn.get_paths()]
    return np.concatenate(corners) if corners else np.empty((0, 2))


def _outline(patch: Patch) -> np.ndarray:
    if isinstance(patch, Rectangle):
        return np.array([[patch.get_x(), patch.get_y()], [patch.get_width(), patch.get_height()]])
    return np.asarray(patch.get_path().vertices, float)


def _numbers(values: Any) -> list[Any]:
    flat = np.asarray(values, float).ravel().tolist()
    return [float(f"{v:.{DIGITS}g}") if math.isfinite(v) else str(v) for v in flat]
