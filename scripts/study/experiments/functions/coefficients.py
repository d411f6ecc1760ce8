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

import textwrap

from mpmath import asin, atan, chebyfit, cos, mp, mpf, nstr, pi, sin, sqrt, tan

from study.core.registry import ROOT

FILE = ROOT / "common" / "functions" / "coefficients.h"
SMALL = mpf(10) ** -16  # below it the quotients lose their digits: the limit and its slope are exact enough
KINDS = {  # P by its quotient of r = √u and u; its limit at 0 and slope; the range's end in u; terms
    "SIN": (lambda r, u: (sin(r) - r) / (r * u), (-6, 120), lambda: (pi / 4) ** 2, (3, 6)),
    "COS": (lambda r, u: (cos(r) - 1 + u / 2) / (u * u), (24, -720), lambda: (pi / 4) ** 2, (3, 6)),
    "ATAN": (lambda r, u: (atan(r) - r) / (r * u), (-3, 5), lambda: tan(pi / 8) ** 2, (5, 12)),
    "ASIN": (lambda r, u: (asin(r) - r) / (r * u), (6, mpf(40) / 3), lambda: mpf(1) / 4, (5, 12)),
}
FORMATS = (("#if !DOUBLE", "f", 11, 24), ("#else", "", 20, 53))  # guard, suffix, digits, bits


def _array(name: str, numbers: list[str]) -> list[str]:
    text = ", ".join(numbers) + ","
    return [f"static const elem {name}[] = {{", *textwrap.wrap(text, 96, initial_indent=" " * 4,
            subsequent_indent=" " * 4), "};"]  # fmt: skip


def header() -> str:
    about = (
        "// Made by `scripts/stepwise functions --derive` (experiments/functions/coefficients.py says how)."
    )
    lines = [about, "// Lowest power first.", "// clang-format off", '#include "simd.h"', ""]
    with mp.workdps(70):
        for i, (guard, suffix, digits, bits) in enumerate(FORMATS):
            lines.append(guard)
            for name, (quotient, (limit, slope), end, terms) in KINDS.items():
                tail = lambda u: quotient(sqrt(u), u) if u > SMALL else mpf(1) / limit + u / slope  # noqa: B023, E731
                values, error = chebyfit(tail, [0, end()], terms[i], error=True)
                lines.append(f"// polynomial's own error {nstr(error, 3)}")
                lines += _array(name, [nstr(c, digits) + suffix for c in reversed(values)])
            rest, parts = pi / 2, []
            for _ in range(3):
                with mp.workprec(bits):
                    part = +rest
                parts.append(float(part).hex() + suffix)
                rest -= part
            lines += _array("HALF_PI", parts)
    return "\n".join([*lines, "#endif", ""])
