"""Derives the polynomials of opt3 (double) and opt4 (float): log, exp and sin.

Chebyshev interpolation in 50 digits (mpmath.chebyfit), which is within a factor of about two of the minimax
error; prints coefficients, highest power first, with the error of the polynomial itself (before rounding in
the phase). log(m) for m in [√½, √2]: s = (m−1)/(m+1), log m = 2s + s·u·P(u), u = s². exp(r) for |r| ≤ ln2/2:
1 + r + r²·Q(r). sin(r) for |r| ≤ π/2: r + r·u·S(u), u = r². Range reduction after W. J. Cody and W. Waite,
"Software manual for the elementary functions" (1980).
"""

import argparse

from mpmath import atanh, chebyfit, exp, log, mp, mpf, nstr, pi, sin, sqrt

from study.core.cli import Outcome

mp.dps = 50


def log_tail(u: mpf) -> mpf:
    """P(u) = (2·atanh(s) − 2s)/(s·u), u = s²; its limit at 0 is 2/3."""
    s = sqrt(u)
    return (2 * atanh(s) - 2 * s) / (s * u) if u > mpf(10) ** -20 else mpf(2) / 3


def exp_tail(r: mpf) -> mpf:
    """Q(r) = (exp(r) − 1 − r)/r²; its limit at 0 is 1/2."""
    return (exp(r) - 1 - r) / (r * r) if abs(r) > mpf(10) ** -15 else mpf(1) / 2


def sin_tail(u: mpf) -> mpf:
    """S(u) = (sin(r) − r)/(r·u), u = r²; its limit at 0 is −1/6."""
    r = sqrt(u)
    return (sin(r) - r) / (r * u) if u > mpf(10) ** -20 else -mpf(1) / 6


def options(parser: argparse.ArgumentParser) -> None:
    del parser  # it has no option of its own


def run(args: argparse.Namespace) -> Outcome:
    s = (sqrt(mpf(2)) - 1) / (sqrt(mpf(2)) + 1)
    half = log(mpf(2)) / 2
    found, lines = {}, []
    for name, log_terms, exp_terms, sin_terms, digits in (("double", 7, 10, 8, 20), ("float", 3, 5, 4, 11)):
        for function, tail, terms, low, high in (
            ("log", log_tail, log_terms, mpf(0), s * s),
            ("exp", exp_tail, exp_terms, -half, half),
            ("sin", sin_tail, sin_terms, mpf(0), (pi / 2) ** 2),
        ):
            coefficients, error = chebyfit(tail, [low, high], terms, error=True)
            texts, title = [nstr(one, digits) for one in coefficients], f"{function}, {name}"
            found[title] = {"coefficients": texts, "largest_error": nstr(error, 3)}
            lines += [f"{title}: largest error {nstr(error, 3)}", *(f"    {text}" for text in texts)]
    return Outcome(found, lines)
