"""The first hit of a ray with a scene, decided exactly: the oracle that truth and its tests rest on.

The shapes are polynomials of the ray's parameter s (truth.solids), whose roots are isolated and ordered in
certified arithmetic (truth.algebra): without rotation in exact numbers, with it in balls around the sines and
cosines of the angles, at rising precision. A tie that no precision decides is said to be one.

What is hit: f, the least signed distance of all shapes, is followed from s = 0. Outside (f > 0) the hit is
the first s with f ≤ 0, a tangency too; inside it is the first zero, where the ray leaves the union. A
repeated shape is cut off at its cell's walls; where f jumps through zero at a wall, the wall is hit. A hit
beyond bounds_radius is a miss; so is a ray from outside that a march's first step does not bring inside. The
shape is the one whose surface it is, the first of equals.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from flint import arb, ctx

from study.core.cli import StudyError
from study.truth.algebra import EXACT, Root, Unsure, compare, sign, sign_at
from study.truth.rays import Ray, TooLong, Vector
from study.truth.solids import Shape, radius_of, shape_of, square_of

PRECISIONS = (128, 512, 2048, 8192)  # bits


@dataclass(frozen=True)
class First:
    """status hit, miss or undecided; shape −1 unless hit; low ≤ s ≤ high in units of the direction given."""

    status: str
    shape: int = -1
    low: Fraction | None = None
    high: Fraction | None = None


@dataclass(frozen=True)
class Scene:
    """Shapes and camera of a scene's JSON (which the driver has checked)."""

    shapes: tuple[Shape, ...]
    bounds_radius: float
    camera: dict[str, Any]

    @classmethod
    def of(cls, data: dict[str, Any]) -> Scene:
        """Raises StudyError where a shape has no exact truth (a fractal)."""
        shapes = tuple(shape_of(shape) for shape in data["shapes"])
        return cls(shapes, float(data["march"]["bounds_radius"]), data["camera"])

    def camera_ray(
        self, column: int, row: int, width: int, height: int
    ) -> tuple[list[float], list[Fraction]]:
        """Origin and direction, exact and not normalised, of a pixel's ray: t = s·|direction|."""
        position, right, up, forward, tangent = _view(self)
        x = Fraction(2 * column + 1 - width, height) * tangent
        y = Fraction(height - 2 * row - 1, height) * tangent
        axes = zip(forward, right, up, strict=True)
        return list(position), [Fraction(f) + Fraction(r) * x + Fraction(u) * y for f, r, u in axes]


def _unit(v: list[float]) -> list[float]:
    length = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    if length < 1e-140:  # as the reader does it
        v = [x * 2.0**600 for x in v]
        length = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    return [x / length for x in v]


def _cross(a: list[float], b: list[float]) -> list[float]:
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def _view(scene: Scene) -> tuple[list[float], list[float], list[float], list[float], Fraction]:
    """Position, right, up, forward, tan of half the field of view: the doubles of common/scene/scene.c."""
    position, look_at, up = ([float(x) for x in scene.camera[k]] for k in ("position", "look_at", "up"))
    forward = _unit([a - b for a, b in zip(look_at, position, strict=True)])
    right = _unit(_cross(_unit(up), forward))
    tangent = math.tan(float(scene.camera["vertical_fov_degrees"]) * (math.pi / 180.0) / 2.0)
    return position, right, _cross(forward, right), forward, Fraction(tangent)


def _entry(ray: Ray, shape: Shape) -> arb | None:
    """No point of the shape comes before this s; None where there is no bound."""
    radius = radius_of(shape)
    if any(shape.repeat) or not math.isfinite(radius):
        return None
    ctx.prec = 64
    try:
        a = [x - arb(c) * ray.scale for x, c in zip(ray.o, shape.position, strict=True)]
        square = square_of(a, ray.d)
        half, outside = square[1] / 2, square[0] - (arb(radius) * ray.scale) ** 2
        under = half * half - square[2] * outside
        if under < 0:
            return arb.pos_inf()
        return (-half - under.nonnegative_part().sqrt()) / square[2] if outside > 0 else None
    finally:
        ctx.prec = EXACT


def _leave(ray: Ray, shapes: tuple[Shape, ...]) -> tuple[Root, int] | None:
    """The first zero of f on a ray that starts inside: where no shape has it inside any more."""
    streams = [ray.intervals(shape) for shape in shapes]
    heads = [next(stream, None) for stream in streams]
    now, owner, moved = ray.zero, -1, True
    while moved:
        moved = False
        for i, stream in enumerate(streams):
            while (head := heads[i]) and head[1] is not None and (order := compare(head[1], now)) <= 0:
                owner = min(owner, i) if order == 0 else owner  # its surface as well
                heads[i] = next(stream, None)
            if head and (head[0] is None or compare(head[0], now) < 0):
                if head[1] is None:
                    return None
                now, owner, moved = head[1], i, True
    for i, head in enumerate(heads[:owner]):
        if head and head[0] is not None and compare(head[0], now) == 0:
            return now, i
    return now, owner


def _decide(scene: Scene, ray: Ray) -> tuple[Root, int] | None:
    """The first zero of f and whose it is, wherever it lies; None: there is none. Raises Unsure."""
    order = []
    for index, shape in enumerate(scene.shapes):
        entry = _entry(ray, shape) if len(scene.shapes) > 1 else None
        if entry is None or not entry > ray.reach:
            order.append((-math.inf if entry is None else float(entry.lower()), index, entry))
    best: tuple[Root, int] | None = None
    for _, index, entry in sorted(order, key=lambda item: item[:2]):
        if best is not None and entry is not None and entry > best[0].ball:
            continue
        interval = next(ray.intervals(scene.shapes[index]), None)
        if interval is None:
            continue
        low, high = interval
        begins = -1 if low is None else compare(low, ray.zero)
        if begins < 0 and high is not None and compare(high, ray.zero) == 0:
            low, begins = ray.zero, 0
        if begins < 0:
            return _leave(ray, scene.shapes)
        which = -1 if best is None else compare(low, best[0])
        if which < 0 or (which == 0 and index < best[1]):
            best = low, index
    return best


def _fraction(x: arb) -> Fraction:
    mantissa, exponent = (int(part) for part in x.man_exp())
    return Fraction(mantissa) * Fraction(2) ** exponent


def _gets_inside(scene: Scene, ray: Ray) -> bool:
    """Whether a march from outside the bounds is inside after its first step; if not, it is over."""
    p = ray.first_step(scene.shapes)
    bounds = arb(scene.bounds_radius) * ray.scale
    return sign(p[0] * p[0] + p[1] * p[1] + p[2] * p[2] - bounds * bounds) < 0


def find(
    scene: Scene, origin: Vector, direction: Vector, width: float = 1e-15
) -> tuple[str, int, arb | None, int]:
    """As `first_hit`: status, shape, a ball, and the whole number that times the ball is s."""
    if not all(math.isfinite(x) for x in (*origin, *direction)) or not any(direction):
        raise StudyError("a ray needs finite numbers and a direction that is not zero")
    before = ctx.prec
    try:
        for prec in PRECISIONS:
            ctx.prec = EXACT
            try:
                ray = Ray(origin, direction, scene.bounds_radius, prec)
                if sign(ray.bounds[0]) > 0 and not _gets_inside(scene, ray):
                    return "miss", -1, None, 1
                found = _decide(scene, ray)
                if found is None or sign_at(ray.bounds, found[0]) > 0:
                    return "miss", -1, None, 1
                ball = found[0].ball
                if ball.is_exact() or 2 * ball.rad() < width * ball.abs_lower():
                    return "hit", found[1], ball, ray.stretch
            except Unsure:
                continue
            except TooLong:
                break
    finally:
        ctx.prec = before
    return "undecided", -1, None, 1


def first_hit(scene: Scene, origin: Vector, direction: Vector, width: float = 1e-15) -> First:
    """The first hit, its s enclosed to `width` (relative). Origin and direction are taken as exact numbers.

    Raises StudyError if the direction is zero or a number is not finite.
    """
    status, shape, ball, stretch = find(scene, origin, direction, width)
    if ball is None:
        return First(status)
    middle, radius = _fraction(ball.mid()), _fraction(ball.rad())
    return First(status, shape, max(middle - radius, Fraction(0)) * stretch, (middle + radius) * stretch)
