"""Values at the edges: what C's Annex F (C17, F.10) asks of each function, and what an implementation gives.

1/sqrt is IEEE 754-2019's rSqrt (clause 9.2). A value is right if NaN, infinities and zeros are what is asked,
with their sign, and any other finite value is within 5 % or 1 ulp: how near it is, is another table's matter.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from mpmath import acos, cos, exp, log, mp, mpf, pi, power, sin, sqrt

from study.experiments.functions.schema import Edge

TYPES = {"float": np.float32, "double": np.float64}
NEAR = 0.05
INF, NAN = math.inf, math.nan


def arguments(function: str, precision: str) -> Sequence[tuple[float, ...]]:
    """Edge arguments; each a tuple of the function's arguments, exactly representable."""
    info = np.finfo(TYPES[precision])
    least, huge = float(info.smallest_subnormal), float(info.max)
    normal = float(info.smallest_normal)
    if function == "atan2":
        return [pair for pair, _ in ATAN2] + [(least, 1.0), (huge, huge), (NAN, 1.0), (1.0, NAN)]
    if function == "pow":
        return [pair for pair, _ in POW] + [(least, 1.0), (huge, 1.0), (0.5, huge)]
    return [
        (v,) for v in (0.0, -0.0, least, -least, normal - least, normal, -1.0, huge, -huge, INF, -INF, NAN)
    ]


# In units of π; the sign of the first argument is the sign of the result (F.10.1.4).
ATAN2 = [
    ((0.0, -0.0), 1.0),
    ((-0.0, -0.0), -1.0),
    ((0.0, 0.0), 0.0),
    ((-0.0, 0.0), -0.0),
    ((0.0, -1.0), 1.0),
    ((-0.0, 1.0), -0.0),
    ((1.0, 0.0), 0.5),
    ((-1.0, -0.0), -0.5),
    ((1.0, -INF), 1.0),
    ((1.0, INF), 0.0),
    ((INF, 1.0), 0.5),
    ((INF, -INF), 0.75),
    ((INF, INF), 0.25),
]
POW = [  # F.10.4.4
    ((0.0, -1.0), INF),
    ((-0.0, -1.0), -INF),
    ((0.0, 2.0), 0.0),
    ((-0.0, 3.0), -0.0),
    ((-1.0, INF), 1.0),
    ((1.0, NAN), 1.0),
    ((NAN, 0.0), 1.0),
    ((-2.0, 0.5), NAN),
    ((-2.0, 3.0), -8.0),
    ((0.5, -INF), INF),
    ((2.0, -INF), 0.0),
    ((INF, 2.0), INF),
    ((INF, -1.0), 0.0),
    ((-INF, 3.0), -INF),
    ((2.0, 20000.0), INF),
]


def _same(a: tuple[float, ...], b: tuple[float, ...]) -> bool:
    """Equal as keys: NaN is NaN, −0 is not 0."""
    return [float(x).hex() for x in a] == [float(x).hex() for x in b]


def _one(function: str, a: float) -> mpf | float:
    if math.isnan(a):
        return NAN
    if function in ("sqrt", "rsqrt"):
        if a < 0:
            return NAN
        if function == "sqrt":
            return a if a in (0, INF) else sqrt(mpf(a))
        return math.copysign(INF, a) if a == 0 else 0.0 if a == INF else 1 / sqrt(mpf(a))
    if function == "exp":
        return {INF: INF, -INF: 0.0}.get(a) if math.isinf(a) else exp(mpf(a)) if abs(a) < 1e6 else _far(a)
    if function == "log":
        return -INF if a == 0 else NAN if a < 0 else INF if a == INF else log(mpf(a))
    if function == "acos":
        return NAN if abs(a) > 1 else acos(mpf(a))
    if math.isinf(a):
        return NAN
    return a if function == "sin" and a == 0 else {"sin": sin, "cos": cos}[function](mpf(a))


def _far(a: float) -> float:
    return INF if a > 0 else 0.0


def expected(function: str, arguments: tuple[float, ...]) -> mpf | float:
    """The value C and IEEE 754 ask for; an mpf where it is to be rounded to the format."""
    with mp.workdps(400):  # sin of the largest double: reduction needs 1024 bits and more
        if function == "atan2":
            known = next((v for k, v in ATAN2 if _same(k, arguments)), None)
            if known is not None:
                return known * pi if known else known
            y, x = arguments
            return NAN if math.isnan(y) or math.isnan(x) else mp.atan2(mpf(y), mpf(x))
        if function == "pow":
            known = next((v for k, v in POW if _same(k, arguments)), None)
            if known is not None:
                return known
            a, b = arguments
            return power(mpf(a), mpf(b)) if abs(b) < 1e6 else _far(b if a > 1 else -b)
        return _one(function, *arguments)


def right(value: float, exact: mpf | float, precision: str) -> bool:
    """Whether `value` is what was asked, as the head of this file says."""
    info = np.finfo(TYPES[precision])
    if math.isnan(value) or (isinstance(exact, float) and math.isnan(exact)):
        return math.isnan(value) and isinstance(exact, float) and math.isnan(exact)
    least = mpf(float(info.smallest_subnormal))
    if isinstance(exact, mpf) and abs(exact) > float(info.max):
        exact = INF if exact > 0 else -INF
    elif isinstance(exact, mpf) and 0 < abs(exact) < least / 2:
        exact = math.copysign(0.0, exact)
    if exact == 0 or abs(exact) == INF or value == 0 or math.isinf(value):
        near = isinstance(exact, mpf) and abs(exact) <= least and abs(value - exact) <= least
        return near or (value == exact and math.copysign(1, value) == math.copysign(1, exact))
    return abs(value - exact) <= max(NEAR * abs(exact), least)


def judge(
    function: str, precision: str, evaluate: Callable[[np.ndarray, np.ndarray | None], np.ndarray]
) -> list[Edge]:
    """One row per edge argument. `evaluate`: arrays to results."""
    cases = arguments(function, precision)
    kind = TYPES[precision]
    padded = np.array(([*cases] + [cases[-1]] * (-len(cases) % 16)), kind)
    with np.errstate(all="ignore"):
        values = evaluate(padded[:, 0], padded[:, 1] if padded.shape[1] == 2 else None)
    rows = []
    for case, value in zip(cases, values[: len(cases)].tolist(), strict=True):
        exact = expected(function, case)
        rows.append(
            Edge(
                argument=", ".join(_name(a, precision) for a in case),
                value=text(value),
                exact=text(float(exact) if abs(exact) < float(np.finfo(kind).max) else exact),
                right=right(value, exact, precision),
            )
        )
    return rows


def _name(value: float, precision: str) -> str:
    """An argument in words where digits would not tell it from its neighbours."""
    info = np.finfo(TYPES[precision])
    least, normal = float(info.smallest_subnormal), float(info.smallest_normal)
    known = {least: "least denormal", normal - least: "largest denormal", normal: "least normal"}
    known[float(info.max)] = "largest"
    name = known.get(abs(value))
    return ("−" if value < 0 else "") + name if name else text(value)


def text(value: mpf | float) -> str:
    """A value in few words: −0 and the infinities by their sign."""
    value = float(value)
    if math.isnan(value):
        return "NaN"
    sign = "−" if math.copysign(1, value) < 0 else ""
    return sign + ("∞" if math.isinf(value) else f"{abs(value):.5g}")
