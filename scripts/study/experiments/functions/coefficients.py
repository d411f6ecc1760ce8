"""Coefficients of the bench's own sin, cos, arctangent and arcsine: common/functions/coefficients.h.

Chebyshev interpolation in 50 digits on the reduced ranges, as stepwise polynomials does for the phases' log
and exp, which the bench has copies of. Lowest power first, u = the reduced argument squared:

    sin r  = r + r·u·P(u)            |r| ≤ π/4
    cos r  = 1 − u/2 + u²·P(u)       |r| ≤ π/4
    atan t = t + t·u·P(u)            |t| ≤ tan π/8
    asin s = s + s·u·P(u)            |s| ≤ 1/2

π/2 is split in three for the reduction after W. J. Cody and W. Waite, "Software manual for the elementary
functions" (1980): with a fused multiply-add each part may fill its format.
"""

from __future__ import annotations

import textwrap
from collections.abc import Callable

from mpmath import asin, atan, chebyfit, cos, factorial, mp, mpf, nstr, pi, sin, sqrt, tan

from study.core.registry import ROOT

FILE = ROOT / "common" / "functions" / "coefficients.h"
TERMS = {"SIN": (3, 6), "COS": (3, 6), "ATAN": (5, 12), "ASIN": (5, 12)}  # float, double
DIGITS = (11, 20)
BITS = (24, 53)
SMALL = mpf(10) ** -16  # below it the quotients lose their digits: the limit and its slope are exact enough


def _tail(near: Callable[[mpf], mpf], quotient: Callable[[mpf, mpf], mpf]) -> Callable[[mpf], mpf]:
    """P(u) by its quotient of r = √u and u, and by `near`(u) at 0."""
    return lambda u: quotient(sqrt(u), u) if u > SMALL else near(u)


def _kinds() -> dict[str, tuple[Callable[[mpf], mpf], mpf]]:
    """Name → P and the end of its range, in u."""
    return {
        "SIN": (_tail(lambda u: -mpf(1) / 6 + u / 120, lambda r, u: (sin(r) - r) / (r * u)), (pi / 4) ** 2),
        "COS": (
            _tail(lambda u: 1 / factorial(4) - u / 720, lambda r, u: (cos(r) - 1 + u / 2) / (u * u)),
            (pi / 4) ** 2,
        ),
        "ATAN": (
            _tail(lambda u: -mpf(1) / 3 + u / 5, lambda r, u: (atan(r) - r) / (r * u)),
            tan(pi / 8) ** 2,
        ),
        "ASIN": (
            _tail(lambda u: mpf(1) / 6 + 3 * u / 40, lambda r, u: (asin(r) - r) / (r * u)),
            mpf(1) / 4,
        ),
    }


def derive(precision: int) -> dict[str, tuple[list[str], str]]:
    """Name → coefficients as text, and the polynomial's largest error. `precision`: 0 float, 1 double."""
    with mp.workdps(70):
        found = {}
        for name, (tail, end) in _kinds().items():
            values, error = chebyfit(tail, [0, end], TERMS[name][precision], error=True)
            found[name] = ([nstr(c, DIGITS[precision]) for c in reversed(values)], nstr(error, 3))
        return found


def split_half_pi(precision: int) -> list[str]:
    """π/2 as three numbers of the format, largest first, in hexadecimal."""
    with mp.workdps(70):
        rest, parts = pi / 2, []
        for _ in range(3):
            with mp.workprec(BITS[precision]):
                part = +rest
            parts.append(float(part).hex())
            rest -= part
        return parts


def _wrapped(numbers: list[str]) -> list[str]:
    return textwrap.wrap(", ".join(numbers) + ",", 96, initial_indent=" " * 4, subsequent_indent=" " * 4)


def header() -> str:
    """The text of coefficients.h."""
    lines = [
        "// Made by `scripts/stepwise functions --derive` (experiments/functions/coefficients.py says how).",
        "// Lowest power first.",
        "// clang-format off",
        '#include "simd.h"',
        "",
    ]
    for precision, guard in ((0, "#if !DOUBLE"), (1, "#else")):
        lines.append(guard)
        suffix = "" if precision else "f"
        for name, (values, error) in derive(precision).items():
            texts = [v + suffix for v in values]
            lines.append(f"// polynomial's own error {error}")
            lines.append(f"static const elem {name}[] = {{")
            lines += [*_wrapped(texts), "};"]
        parts = [v + suffix for v in split_half_pi(precision)]
        lines.append("static const elem HALF_PI[] = {")
        lines += [*_wrapped(parts), "};"]
    return "\n".join([*lines, "#endif", ""])
