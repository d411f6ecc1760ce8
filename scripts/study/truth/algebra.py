"""Real roots of polynomials in certified arithmetic: where they lie, which of two comes first.

A polynomial is a list of FLINT balls (F. Johansson, "Arb: efficient arbitrary-precision midpoint-radius
interval arithmetic", IEEE Trans. Computers 66 (2017)), lowest power first. Sums and products of doubles are
exact in it, so a polynomial whose coefficients come from doubles alone has balls of radius zero, and even a
double root or two equal roots of unlike polynomials are decided. What cannot be told raises `Unsure`: the
caller tries again at a higher precision.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

from flint import acb_poly, arb, arb_poly, ctx, fmpq_poly, fmpz, fmpz_poly

EXACT = 16384  # bits in which sums and products of doubles of any use are not rounded

Poly = list[arb]
Interval = tuple["Root | None", "Root | None"]  # closed; None: without end


class Unsure(Exception):
    """A sign that this precision cannot tell."""


def sign(x: arb) -> int:
    """−1, 0 or 1, never a guess. Raises Unsure."""
    if x > 0:
        return 1
    if x < 0:
        return -1
    if x == 0:
        return 0
    raise Unsure


@dataclass(eq=False, slots=True)
class Root:
    """A real root: `ball` holds it. Of a line, numerator/denominator (> 0) are kept, exact where they can be.

    `siblings`: balls of all real roots of `poly`, this one's too. Without a polynomial it is one of two roots
    too near to tell which, and known by its ball alone.
    """

    ball: arb
    poly: Poly
    numerator: arb | None = None
    denominator: arb | None = None
    siblings: list[arb] = field(default_factory=list)

    @property
    def linear(self) -> bool:
        return self.numerator is not None


def line_root(numerator: arb, denominator: arb, prec: int) -> Root:
    """numerator/denominator; the denominator's sign must be certain and not zero."""
    if sign(denominator) < 0:
        numerator, denominator = -numerator, -denominator
    work, ctx.prec = ctx.prec, prec
    try:
        ball = numerator / denominator
    finally:
        ctx.prec = work
    return Root(ball, [-numerator, denominator], numerator, denominator, [ball])


def _at_line(poly: Poly, root: Root) -> arb:
    """Value of poly at numerator/denominator, times a positive power of the denominator: no division."""
    value, power = poly[-1], root.denominator
    for coefficient in poly[-2::-1]:
        value = value * root.numerator + coefficient * power
        power = power * root.denominator
    return value


def _integers(poly: Poly) -> fmpz_poly | None:
    """A positive multiple of poly with whole coefficients; None if one is not known exactly."""
    if not all(c.is_exact() for c in poly):
        return None
    parts = [c.man_exp() for c in poly]
    least = min((int(exponent) for mantissa, exponent in parts if mantissa != 0), default=0)
    return fmpz_poly([m << (int(e) - least) if m != 0 else fmpz(0) for m, e in parts])


def _is_root(poly: Poly, root: Root) -> bool:
    """Whether `root` is a root of `poly` as well, by the greatest common divisor. Raises Unsure."""
    mine, other = _integers(root.poly) if root.poly else None, _integers(poly)
    if mine is None or other is None:
        return False
    common = fmpq_poly(mine).gcd(fmpq_poly(other))
    if common.degree() < 1:
        return False
    work, ctx.prec = ctx.prec, 256
    roots: Any  # with multiplicities, which flint's hints leave out
    try:
        roots = common.numer().complex_roots()
    finally:
        ctx.prec = work
    for z, _ in roots:
        if z.imag == 0 and z.real.overlaps(root.ball):
            if sum(z.real.overlaps(ball) for ball in root.siblings) > 1:
                raise Unsure
            return True
    return False


def sign_at(poly: Poly, root: Root) -> int:
    """Sign of poly at a root of another one. Raises Unsure."""
    if root.linear:
        return sign(_at_line(poly, root))
    value = arb_poly(poly)(root.ball)
    if value > 0:
        return 1
    if value < 0:
        return -1
    if _is_root(poly, root):
        return 0
    raise Unsure


def compare(a: Root, b: Root) -> int:
    """−1, 0, 1 as a lies before, on or after b. Raises Unsure."""
    if a is b:
        return 0
    if a.linear and b.linear:
        return sign(a.numerator * b.denominator - b.numerator * a.denominator)
    if a.ball < b.ball:
        return -1
    if a.ball > b.ball:
        return 1
    if b.linear:
        a, b = b, a
    if not (a.poly and b.poly):
        raise Unsure
    if sign_at(b.poly, a) == 0 and sum(a.ball.overlaps(ball) for ball in b.siblings) == 1:
        return 0
    raise Unsure


def _quadratic(poly: Poly, prec: int) -> list[tuple[Root, int]]:
    c, b, a = poly
    discriminant = b * b - 4 * a * c
    which = sign(discriminant)
    if which < 0:
        return []
    if which == 0:
        return [(line_root(-b, 2 * a, prec), 2)]
    work, ctx.prec = ctx.prec, prec
    try:
        # The larger root in magnitude first: no cancellation; the other by the product of both.
        far = b + discriminant.sqrt() if b > 0 else b - discriminant.sqrt()
        balls = [far / (-2 * a), 2 * c / -far]
    finally:
        ctx.prec = work
    if not balls[0] < balls[1]:
        balls.reverse()
    if not balls[0] < balls[1]:
        raise Unsure
    return [(Root(ball, poly, siblings=balls), 1) for ball in balls]


def _isolated(poly: Poly) -> list[tuple[arb, int]]:
    """Balls of the real roots, in order, with multiplicities. Raises Unsure."""
    try:
        # Narrower than is quickest where a first try did not do: two near roots need it for Newton's steps.
        tolerance = None if ctx.prec <= 128 else 2.0 ** -min(ctx.prec // 2, 1000)
        found = [(z, 1) for z in acb_poly(poly).roots(tolerance, 4 * ctx.prec)]
    except ValueError:  # a multiple root, or nearly one
        whole = _integers(poly)
        if whole is None:
            raise Unsure from None
        several: Any = whole.complex_roots()
        return sorted(((z.real, n) for z, n in several if z.imag == 0), key=_middle)
    real = []
    for z, n in found:
        if z.imag > 0 or z.imag < 0:
            continue
        # Its conjugate is a root too; if no other ball can hold that, it is the root itself.
        for w, _ in found:
            if w is not z and w.real.overlaps(z.real) and w.imag.overlaps(-z.imag):
                raise Unsure
        real.append((z.real, n))
    return sorted(real, key=_middle)


def _middle(pair: tuple[arb, int]) -> float:
    return float(pair[0].mid())


def _narrowed(poly: Poly, ball: arb, steps: int = 8) -> arb:
    """Interval Newton steps within a ball that holds one simple root."""
    values = arb_poly(poly)
    slopes = values.derivative()
    for _ in range(steps):
        slope = slopes(ball)
        if not (slope > 0 or slope < 0):
            break
        middle = ball.mid()
        next_ball = middle - values(middle) / slope
        if not next_ball.rad() < ball.rad() * 0.5:
            break
        ball = next_ball
    return ball


def _quartic(poly: Poly, prec: int, around: float) -> list[tuple[Root, int]]:
    """Roots of degree above two; `around`: near where they lie, which keeps the digits of far rays."""
    shifted = arb_poly(poly)(arb_poly([arb(around), 1]))
    work, ctx.prec = ctx.prec, prec
    try:
        coefficients = [shifted[i] for i in range(len(poly))]
        found = [
            (around + (_narrowed(coefficients, ball) if n == 1 else ball), n)
            for ball, n in _isolated(coefficients)
        ]
    finally:
        ctx.prec = work
    balls = [ball for ball, _ in found]
    if any(not a < b for a, b in pairwise(balls)):
        raise Unsure
    return [(Root(ball, poly, siblings=balls), n) for ball, n in found]


def not_positive(poly: Poly, prec: int, reach: arb, around: float = 0.0) -> list[Interval]:
    """Where poly ≤ 0 holds in 0 ≤ s ≤ reach, as closed intervals in order (outside it they may be wrong).

    Intervals that touch (a double root between them) stay apart. Raises Unsure.
    """
    poly = list(poly)
    while len(poly) > 1 and poly[-1] == 0:
        poly.pop()
    if len(poly) == 1:
        return [(None, None)] if sign(poly[0]) <= 0 else []
    if not (poly[-1] > 0 or poly[-1] < 0):
        whole = arb_poly(poly)(arb(0).union(reach))
        return [(None, None)] if sign(whole) < 0 else []
    degree = len(poly) - 1
    if degree == 1:
        roots = [(line_root(-poly[0], poly[1], prec), 1)]
    else:
        roots = _quadratic(poly, prec) if degree == 2 else _quartic(poly, prec, around)
    # From the left: the sign at −∞, turned at every root of odd multiplicity.
    inside = (poly[-1] < 0) != (degree % 2 == 1)
    start: Root | None = None
    intervals: list[Interval] = []
    for root, multiplicity in roots:
        if inside:
            intervals.append((start, root))
        elif multiplicity % 2 == 0:
            intervals.append((root, root))
        inside, start = inside != (multiplicity % 2 == 1), root
    return intervals + ([(start, None)] if inside else [])


def later(a: Root | None, b: Root | None) -> Root | None:
    """The later of two beginnings, None being the earliest."""
    if a is None or b is None:
        return a or b
    try:
        return a if compare(a, b) >= 0 else b
    except Unsure:
        return Root(a.ball.max(b.ball), [])


def earlier(a: Root | None, b: Root | None) -> Root | None:
    """The earlier of two ends, None being the last."""
    if a is None or b is None:
        return a or b
    try:
        return a if compare(a, b) <= 0 else b
    except Unsure:
        return Root(a.ball.min(b.ball), [])


def meet(p: list[Interval], q: list[Interval]) -> list[Interval]:
    """What two lists of intervals have in common."""
    out = []
    for a, b in p:
        for c, d in q:
            low, high = later(a, c), earlier(b, d)
            if low is None or high is None or compare(low, high) <= 0:
                out.append((low, high))
    return out
