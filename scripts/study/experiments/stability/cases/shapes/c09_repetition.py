"""Repetition at cell 10² to 10⁶, and shapes that reach over their cell."""

from __future__ import annotations

import itertools

import numpy as np

from study.experiments.stability.cases import Outcome, Phase
from study.experiments.stability.cases.scenes import found, scene, shape, worst

CELL = 4.0  # a power of two: the places in a cell and the cells' own add up exactly
SIZE = (24, 18)
COUNT = 2000
# Three layers, repeated in x and y: the first fits its cell, the second reaches over it, and in the third the
# nearest copy may be the next cell's, since a cone's ends differ.
SHAPES = (
    shape("sphere", radius=1.0, repeat=[CELL, CELL, 0]),
    shape("sphere", radius=2.25, position=[2, 0, 5], repeat=[CELL, CELL, 0], material="other"),
    shape("cone", bottom_radius=1.5, top_radius=0.25, half_height=1.75, position=[0, 0, 10])
    | {"repeat": [CELL, CELL, 0]},
)


def lattice(cell: float, shapes: tuple[dict, ...] = SHAPES) -> dict:
    """The layers, seen from before the cell of that number in x and y."""
    x, y = cell * CELL + 1 + 5 / 1024, cell * CELL + 0.5 + 3 / 1024  # no float from cell 2¹² on
    return scene(
        list(shapes),
        camera={"position": [x, y, -6], "look_at": [x, y, 0]},
        march={"bounds_radius": 64 + 2 * cell * CELL},
    )


def points() -> np.ndarray:
    """Places in the centre cell in steps of 2⁻¹⁰, off the borders, where the two sides are equally right."""
    random = np.random.default_rng(9)
    return np.round(random.uniform([-1.99, -1.99, -3], [1.99, 1.99, 13], (COUNT, 3)) * 1024) / 1024


def cone_distance(p: np.ndarray, cone: dict) -> np.ndarray:
    """Outside of a capped cone at the origin, axis y: to the nearest segment of its profile."""
    q = np.stack([np.hypot(p[:, 0], p[:, 2]), p[:, 1]], axis=-1)
    r1, r2, h = cone["bottom_radius"], cone["top_radius"], cone["half_height"]
    corners = np.array([[0, -h], [r1, -h], [r2, h], [0, h]])
    nearest = []
    for a, b in itertools.pairwise(corners):
        share = np.clip((q - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
        nearest.append(np.linalg.norm(q - a - share[:, None] * (b - a), axis=-1))
    return np.min(nearest, axis=0)


def overstep(p: np.ndarray, f: np.ndarray) -> float:
    """By how much a positive f goes beyond the nearest cone, those of the next cells among them."""
    local = p - SHAPES[2]["position"]
    shifts = [[i * CELL, j * CELL, 0] for i in (-1, 0, 1) for j in (-1, 0, 1)]
    true = np.min([cone_distance(local - shift, SHAPES[2]) for shift in shifts], axis=0)
    return float(np.max(np.where(f > 0, f - true, 0)))


def run(phase: Phase, cell: float) -> Outcome:
    p, far = points(), [cell * CELL, cell * CELL, 0]
    off_f = 0.0
    for one in SHAPES:
        home, away = (phase.distances(lattice(0, (one,)), q) for q in (p, p + far))
        off_f = worst([off_f, worst(np.abs(away - home))])  # max() would drop a NaN
    over = overstep(p, away)  # of the cones, which come last
    a, b = phase.render(lattice(0), SIZE), phase.render(lattice(cell), SIZE)
    same = found(a) & (a["id"] == b["id"])
    off_t = float(np.abs(a["Z"][same].astype(float) - b["Z"][same]).max(initial=0))
    other = int((a["id"] != b["id"]).sum())
    note = f"|Δf| {off_f:.1e}, |Δt| {off_t:.1e}, {other} of {a['id'].size} pixels with another shape; "
    return Outcome(
        worst([off_f, off_t]), note=note + f"between cones f is up to {over:.2f} too large (overstep)"
    )
