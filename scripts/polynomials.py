#!/usr/bin/env python3
"""Derive the polynomials of phases opt3 (double) and opt4 (float): log and exp on their reduced ranges.

Chebyshev interpolation in 50 digits (mpmath.chebyfit), which is within a factor of about two of the minimax error;
prints coefficients, highest power first, with the error of the polynomial itself (before rounding in the phase).
log(m) for m in [√½, √2]: s = (m−1)/(m+1), log m = 2s + s·u·P(u), u = s². exp(r) for |r| ≤ ln2/2: 1 + r + r²·Q(r).
Range reduction after W. J. Cody and W. Waite, "Software manual for the elementary functions" (1980).
"""

from mpmath import atanh, chebyfit, exp, log, mp, mpf, nstr, sqrt

mp.dps = 50


def log_tail(u: mpf) -> mpf:
    """P(u) = (2·atanh(s) − 2s)/(s·u), u = s²; its limit at 0 is 2/3."""
    s = sqrt(u)
    return (2 * atanh(s) - 2 * s) / (s * u) if u > mpf(10) ** -20 else mpf(2) / 3


def exp_tail(r: mpf) -> mpf:
    """Q(r) = (exp(r) − 1 − r)/r²; its limit at 0 is 1/2."""
    return (exp(r) - 1 - r) / (r * r) if abs(r) > mpf(10) ** -15 else mpf(1) / 2


def show(title: str, function, terms: int, low: mpf, high: mpf, digits: int) -> None:
    coefficients, error = chebyfit(function, [low, high], terms, error=True)
    print(f"{title}: {terms} coefficients, largest error {nstr(error, 3)}")
    for c in coefficients:
        print(f"    {nstr(c, digits)}")


def main() -> None:
    s = (sqrt(mpf(2)) - 1) / (sqrt(mpf(2)) + 1)
    half = log(mpf(2)) / 2
    for name, log_terms, exp_terms, digits in (("double", 7, 10, 20), ("float", 3, 5, 11)):
        show(f"log, {name}", log_tail, log_terms, mpf(0), s * s, digits)
        show(f"exp, {name}", exp_tail, exp_terms, -half, half, digits)


if __name__ == "__main__":
    main()
