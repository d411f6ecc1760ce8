"""Truth of a disc: what its rows count to is known by Pythagoras."""

from __future__ import annotations

import math

import numpy as np

from study.pictures.images import Picture

HEIGHT, WIDTH, RADIUS = 40, 60, 11.5


def made_truth(picture: Picture) -> Picture:
    """A picture as truth's: without any shadow, every ray proved."""
    truth = Picture({name: plane.copy() for name, plane in picture.items()})
    for prefix in ("ideal.", "none."):
        truth |= {prefix + name: picture[name].copy() for name in "RGB"}
    for name, value in {"shadow": 1, "shadow.ideal": 1, "status": 2, "status.all": 2}.items():
        truth[name] = np.full(picture["R"].shape, value, np.float32)
    return truth


def lengths() -> list[int]:
    """Pixels of each row of the disc, by Pythagoras."""
    rows = range(-11, 12)
    return [2 * math.floor(math.sqrt(RADIUS**2 - y * y)) + 1 for y in rows]
