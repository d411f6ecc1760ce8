"""A ray cut by a shape and its repetitions, in certified arithmetic."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from fractions import Fraction

from flint import arb, ctx, fmpq

from study.truth.algebra import (
    EXACT,
    Interval,
    Root,
    compare,
    earlier,
    later,
    line_root,
    meet,
    not_positive,
    sign,
)
from study.truth.solids import Balls, Shape, distance, radius_of, solids, square_of

MOST_CELLS = 5_000  # of a repeated shape that one ray may cross
Vector = Sequence[float | Fraction]


class Ray:
    """origin + s·direction at one precision, made dyadic: lengths times `scale`, s divided by `stretch`."""

    def __init__(self, origin: Vector, direction: Vector, bounds_radius: float, prec: int) -> None:
        if all(type(x) is float for x in (*origin, *direction)):
            self.scale = self.stretch = 1
            self.o, self.d = [arb(x) for x in origin], [arb(x) for x in direction]
        else:
            o, d = ([Fraction(x) for x in v] for v in (origin, direction))
            self.scale = math.lcm(*(_odd(x.denominator) for x in o))
            self.stretch = math.lcm(*(_odd(x.denominator) for x in d))
            self.o = [_ball(x * self.scale) for x in o]
            self.d = [_ball(x * self.stretch) * self.scale for x in d]
        self.prec = prec
        self.zero = line_root(arb(0), arb(1), prec)
        bounds = arb(bounds_radius) * self.scale
        square = square_of(self.o, self.d)
        self.bounds = [square[0] - bounds * bounds, *square[1:]]
        ctx.prec = 64
        self.reach = ((square[0].sqrt() + bounds) / square[2].sqrt()).upper()
        ctx.prec = EXACT

    def local(self, shape: Shape) -> tuple[Balls, Balls]:
        """Origin and direction in the shape's frame, before any wrapping."""
        p = [x - arb(c) * self.scale for x, c in zip(self.o, shape.position, strict=True)]
        d = list(self.d)
        for angle, (i, j) in zip(shape.rotation, ((1, 2), (0, 2), (0, 1)), strict=True):
            if angle:
                s, c = arb.sin_cos_pi_fmpq(_fmpq(Fraction(angle) / 180))
                for v in (p, d):
                    v[i], v[j] = c * v[i] - s * v[j], s * v[i] + c * v[j]
        return p, d

    def pieces(self, shape: Shape, a: Balls, b: Balls) -> list[Interval]:
        """Where a + s·b lies in one copy of the shape."""
        radius = radius_of(shape)
        around = 0.0
        if math.isfinite(radius):
            square = square_of(a, b)
            radius_ball = arb(radius) * self.scale
            # (a·b)² < b²·(a² − r²): the sphere around the shape is missed.
            half = square[1] / 2
            if half * half < square[2] * (square[0] - radius_ball * radius_ball):
                return []
            around = -float(half) / float(square[2]) if shape.kind == "torus" else 0.0
        found: list[Interval] = []
        for solid in solids(shape, self.scale, a, b):
            flat = any(all(c == 0 for c in poly) for poly in solid)
            part: list[Interval] = [(None, None)]
            for poly in solid:
                part = meet(part, not_positive(poly, self.prec, self.reach, around)) if part else part
            if flat:  # the ray runs along a face: f is zero from where it begins, and nothing lies inside
                part = [self.first_touch(low, high) for low, high in part]
            found = _union(found, part) if found else part
        return found

    def first_touch(self, low: Root | None, high: Root | None) -> Interval:
        """The beginning of an interval, s = 0 where it began before."""
        if (low is None or compare(low, self.zero) < 0) and (high is None or compare(high, self.zero) >= 0):
            return self.zero, self.zero
        return (high, high) if low is None else (low, low)

    def intervals(self, shape: Shape) -> Iterator[Interval]:
        """Where the ray lies in the shape and its repetitions, s ≥ 0, in order."""
        ctx.prec = self.prec if shape.turned else EXACT
        try:
            a, b = self.local(shape)
            found = _cells(self, shape, a, b) if any(shape.repeat) else iter(self.pieces(shape, a, b))
            ctx.prec = EXACT
            for low, high in found:
                if high is None or compare(high, self.zero) >= 0:
                    yield low, high
                ctx.prec = self.prec if shape.turned else EXACT
        finally:
            ctx.prec = EXACT

    def first_step(self, shapes: Sequence[Shape]) -> list[arb]:
        """Where a march stands after its first step, the least distance of all shapes."""
        ctx.prec = self.prec
        try:
            least = arb.pos_inf()
            for shape in shapes:
                p, _ = self.local(shape)
                wrapped = [
                    x - (_cell(x, arb(c) * self.scale) * arb(c) * self.scale if c > 0 else 0)
                    for x, c in zip(p, shape.repeat, strict=True)
                ]
                least = least.min(distance(shape, self.scale, wrapped))
            s = least / square_of(self.o, self.d)[2].sqrt()
            return [x + s * y for x, y in zip(self.o, self.d, strict=True)]
        finally:
            ctx.prec = EXACT


class TooLong(Exception):
    """A ray that crosses more cells than anyone can wait for."""


def _odd(n: int) -> int:
    return n // (n & -n)


def _fmpq(x: Fraction) -> fmpq:
    return fmpq(x.numerator, x.denominator)


def _ball(x: Fraction) -> arb:
    """Exact: the denominator is a power of two."""
    return arb((x.numerator, 1 - x.denominator.bit_length()))


def _union(p: list[Interval], q: list[Interval]) -> list[Interval]:
    """Of two lists of intervals, those that touch made one (both are of the same solid)."""
    out: list[Interval] = []
    rest = [*p, *q]
    while rest:
        first = 0
        for i in range(1, len(rest)):
            if later(rest[i][0], rest[first][0]) is not rest[i][0]:
                first = i
        low, high = rest.pop(first)
        if out and (out[-1][1] is None or low is None or compare(low, out[-1][1]) <= 0):
            before = out.pop()
            low = before[0]
            high = None if high is None or before[1] is None else later(high, before[1])
        out.append((low, high))
    return out


def _cells(ray: Ray, shape: Shape, a: Balls, b: Balls) -> Iterator[Interval]:
    """As `pieces`, of a repeated shape, cell by cell. A solid that goes on through a wall is one interval."""
    cell = [arb(c) * ray.scale for c in shape.repeat]
    at = [_cell(x, c) if c > 0 else 0 for x, c in zip(a, cell, strict=True)]
    turn = [sign(d) if c > 0 else 0 for d, c in zip(b, cell, strict=True)]
    enter, pending, limit = ray.zero, None, ray.reach
    for _ in range(MOST_CELLS):
        walls = {
            k: line_root((at[k] + arb(turn[k]) / 2) * cell[k] - a[k], b[k], ray.prec)
            for k in range(3)
            if turn[k]
        }
        leave = None
        for wall in walls.values():
            leave = earlier(leave, wall)
        moved = [x - n * c for x, n, c in zip(a, at, cell, strict=True)]
        first = True
        for low, high in ray.pieces(shape, moved, b):
            if (high is not None and compare(high, enter) < 0) or (
                low is not None and leave is not None and compare(low, leave) > 0
            ):
                continue
            through = low is None or compare(low, enter) < 0  # solid already at the wall behind
            if pending is not None:
                if first and through:
                    low = pending[0]
                else:
                    yield pending
                    low = enter if through else low
                pending = None
            elif through and enter is not ray.zero:
                low = enter
            first = False
            if leave is not None and (high is None or compare(high, leave) > 0):
                pending = (low, leave)  # solid still at the wall ahead
            else:
                yield low, high
        if first and pending is not None:
            yield pending
            pending = None
        if leave is None:
            return
        if leave.ball > limit:
            if pending is not None:
                yield pending
            return
        for k, wall in walls.items():
            if compare(wall, leave) == 0:
                at[k] += turn[k]
        enter = leave
    raise TooLong


def _cell(x: arb, cell: arb) -> int:
    """Number of the cell that x is in: floor(x/cell + ½), decided without division."""
    n = math.floor(float(x) / float(cell) + 0.5)
    while sign(x - (arb(n) - 0.5) * cell) < 0:
        n -= 1
    while sign(x - (arb(n) + 0.5) * cell) >= 0:
        n += 1
    return n
