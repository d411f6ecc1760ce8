"""Hard cases of many shapes: repeated ones, and equal ones in one place."""

import itertools

import numpy as np

from study.experiments.stability.cases import Outcome, Phase, exact
from study.experiments.stability.cases.arithmetic import differing_bits
from study.experiments.stability.cases.exact import share
from study.experiments.stability.cases.scenes import ball, depths, eye, found, ids, rays, scene, shape, worst

# 9: repetition at cell 10² to 10⁶, and shapes that reach over their cell
CELL = 4.0  # a power of two: the places in a cell and the cells' own add up exactly
SIZE = (24, 18)
COUNT = 2000
# Three layers, repeated in x and y: the first fits its cell, the second reaches over it, and in the third the
# nearest copy may be the next cell's, since a cone's ends differ.
REPEAT = [CELL, CELL, 0]
LOW, HIGH, TALL, CONES = 1.5, 0.25, 1.75, [0, 0, 10]
LAYERS = (
    ball(1.0, repeat=REPEAT),
    ball(2.25, 2, 0, 5, repeat=REPEAT, material="other"),
    shape("cone", bottom_radius=LOW, top_radius=HIGH, half_height=TALL, position=CONES, repeat=REPEAT),
)


def lattice(cell: float, shapes: tuple[dict, ...] = LAYERS) -> dict:
    """The layers, seen from before the cell of that number in x and y."""
    x, y = cell * CELL + 1 + 5 / 1024, cell * CELL + 0.5 + 3 / 1024  # no float from cell 2¹² on
    march = {"bounds_radius": 64 + 2 * cell * CELL}
    return scene(shapes, camera=eye([x, y, -6], [x, y, 0]), march=march)


def points() -> np.ndarray:
    """Places in the centre cell in steps of 2⁻¹⁰, off the borders, where the two sides are equally right."""
    random = np.random.default_rng(9)
    return np.round(random.uniform([-1.99, -1.99, -3], [1.99, 1.99, 13], (COUNT, 3)) * 1024) / 1024


def to_cone(p: np.ndarray) -> np.ndarray:
    """Distance from outside of a layer's cone about the origin: to the nearest segment of its profile."""
    q = np.stack([np.hypot(p[:, 0], p[:, 2]), p[:, 1]], axis=-1)
    corners = np.array([[0, -TALL], [LOW, -TALL], [HIGH, TALL], [0, TALL]])
    nearest = []
    for a, b in itertools.pairwise(corners):
        part = np.clip((q - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
        nearest.append(np.linalg.norm(q - a - part[:, None] * (b - a), axis=-1))
    return np.min(nearest, axis=0)


def overstep(p: np.ndarray, f: np.ndarray) -> float:
    """How much a positive f goes beyond the nearest cone, those of the next cells among them."""
    shifts = [[i * CELL, j * CELL, 0] for i in (-1, 0, 1) for j in (-1, 0, 1)]
    true = np.min([to_cone(p - CONES - shift) for shift in shifts], axis=0)
    return float(np.max(np.where(f > 0, f - true, 0)))


def c09_repetition(phase: Phase, cell: float) -> Outcome:
    p, far = points(), [cell * CELL, cell * CELL, 0]
    off_f = 0.0
    for one in LAYERS:
        home, away = (phase.distances(lattice(0, (one,)), q) for q in (p, p + far))
        off_f = worst([off_f, worst(np.abs(away - home))])  # max() would drop a NaN
    over = overstep(p, away)  # of the cones, which come last
    a, b = phase.render(lattice(0), SIZE), phase.render(lattice(cell), SIZE)
    other = ids(a) != ids(b)
    same = found(a) & ~other
    off_t = float(np.abs(depths(a)[same] - depths(b)[same]).max(initial=0))
    note = f"|Δf| {off_f:.1e}, |Δt| {off_t:.1e}, {int(other.sum())} of {other.size} pixels with another shape"
    note += f"; between cones f is up to {over:.2f} too large (overstep)"
    return Outcome(worst([off_f, off_t]), note=note)


# 27: thousands of equal shapes in one place
TORUS = shape("torus", major_radius=1, minor_radius=0.4, rotation_degrees=[50, 10, 30])


def alike(count: float) -> dict:
    return scene([TORUS] * int(count), light={"shadows": "hard"}, camera=eye([0, 0, -5], [0, 0, 0], 40))


def c27_many_alike(phase: Phase, strength: float) -> Outcome:
    one, many = phase.render(alike(1), (16, 9)), phase.render(alike(strength), (16, 9))
    return Outcome(share(differing_bits(one, many)))


# 33: repetition of a shape that is not its own mirror image
STACK_SIZE, STACKED, BOTTOM, HALF = (48, 48), 1.4, 0.9, 0.5
COPIES = range(-8, 9)


def stack(ratio: float) -> dict:
    """A column of cones, each wide below and narrow above, seen slantwise from below."""
    cone = shape("cone", bottom_radius=BOTTOM, top_radius=BOTTOM / ratio, half_height=HALF)
    return scene([cone | {"repeat": [0, STACKED, 0]}], camera=eye([0, -3.3, -3], [0, 0, 0], 40))


def to_stack(ratio: float, size: tuple[int, int] = STACK_SIZE) -> np.ndarray:
    """t of each ray; ∞ beyond 12, where a cone is smaller than a pixel's care."""
    origin, directions = rays(stack(ratio), size)
    cones = (
        exact.cone(origin, directions, [0, STACKED * i, 0], BOTTOM, BOTTOM / ratio, HALF) for i in COPIES
    )
    t, _ = exact.nearest(*cones)
    return np.where(t < 12, t, np.inf)


def c33_lopsided_cells(phase: Phase, strength: float) -> Outcome:
    t, picture = to_stack(strength), phase.render(stack(strength), STACK_SIZE)
    seen = np.isfinite(t)
    missed = seen & ~found(picture)
    wrong = seen & ~(np.abs(depths(picture) - np.where(seen, t, 0).astype(float)) <= 1e-2)
    note = f"{int(missed.sum())} pixels see through a cone" if missed.any() else ""
    return Outcome(share(wrong[seen]), note=note)
