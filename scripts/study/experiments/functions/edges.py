"""Values at the edges: what C's Annex F (C17, F.10) asks of each function, and what an implementation gives.

What is asked is what the C library gives in `long double`, which keeps to Annex F; 1/sqrt is IEEE 754-2019's
rSqrt (clause 9.2). A value is right if NaN, infinities and zeros are what is asked, with their sign, and any
other finite value is within 5 % or 1 ulp: how near it is, is another table's matter.
"""

import itertools
import math
from collections.abc import Callable
from typing import Any

import numpy as np

from study.experiments.functions.schema import Edge

TYPES: dict[str, Any] = {"float": np.float32, "double": np.float64}
NEAR = 0.05
EXACT: dict[str, Callable[..., np.longdouble]] = {
    "sqrt": np.sqrt,
    "rsqrt": lambda x: 1 / np.sqrt(x),
    "exp": np.exp,
    "log": np.log,
    "pow": np.power,
    "sin": np.sin,
    "cos": np.cos,
    "atan2": np.arctan2,
    "acos": np.arccos,
}
ATAN2 = "0 -0, -0 -0, 0 0, -0 0, 0 -1, -0 1, 1 0, -1 -0, 1 -inf, 1 inf, inf 1, inf -inf, inf inf"
POW = (
    "0 -1, -0 -1, 0 2, -0 3, -1 inf, 1 nan, nan 0, -2 0.5, -2 3, 0.5 -inf, 2 -inf, inf 2, inf -1, -inf 3, "
    "2 20000"
)


def arguments(function: str, precision: str) -> list[tuple[float, ...]]:
    """Edge arguments; each a tuple of the function's arguments, exactly representable."""
    info = np.finfo(TYPES[precision])
    least, huge = float(info.smallest_subnormal), float(info.max)
    normal = float(info.smallest_normal)
    if function not in ("atan2", "pow"):
        ends = (0.0, least, normal - least, normal, 1.0, huge, math.inf)
        signed = [sign * v for v, sign in itertools.product(ends, (1.0, -1.0))]
        left_out = (least - normal, -normal, 1.0)
        kept: list[tuple[float, ...]] = [(v,) for v in signed if v not in left_out]
        return [*kept, (math.nan,)]
    pairs = (ATAN2 if function == "atan2" else POW).split(", ")
    more = [(huge, huge), (math.nan, 1.0), (1.0, math.nan)]
    if function == "pow":
        more = [(huge, 1.0), (0.5, huge)]
    known = [(float(a), float(b)) for a, b in map(str.split, pairs)]
    return [*known, (least, 1.0), *more]


def right(value: float, exact: np.longdouble, precision: str) -> bool:
    """Whether `value` is what was asked, as the head of this file says."""
    kind = TYPES[precision]
    least = np.finfo(kind).smallest_subnormal
    with np.errstate(all="ignore"):
        rounded = kind(exact)
        if np.isnan(rounded) or math.isnan(value):
            return bool(np.isnan(rounded)) and math.isnan(value)
        near = abs(value - exact) <= max(NEAR * abs(exact), least)
    if rounded == 0 or np.isinf(rounded) or value == 0 or math.isinf(value):
        at_least = rounded != 0 and abs(exact) <= least and abs(value - exact) <= least
        return bool(at_least or (value == rounded and np.signbit(value) == np.signbit(rounded)))
    return bool(near)


def judge(
    function: str, precision: str, evaluate: Callable[[np.ndarray, np.ndarray | None], np.ndarray]
) -> list[Edge]:
    """One row per edge argument. `evaluate`: arrays to results."""
    cases = arguments(function, precision)
    padded = np.array([*cases] + [cases[-1]] * (-len(cases) % 16), TYPES[precision])
    with np.errstate(all="ignore"):
        values = evaluate(padded[:, 0], padded[:, 1] if padded.shape[1] == 2 else None).tolist()
        exact = [EXACT[function](*map(np.longdouble, case)) for case in cases]
        rounded = [TYPES[precision](one) if np.isinf(TYPES[precision](one)) else one for one in exact]
    return [
        Edge(
            argument=", ".join(_name(a, precision) for a in case),
            value=text(value),
            exact=text(shown),
            right=right(value, asked, precision),
        )
        for case, value, asked, shown in zip(cases, values, exact, rounded, strict=False)
    ]


def _name(value: float, precision: str) -> str:
    """An argument in words where digits would not tell it from its neighbours."""
    info = np.finfo(TYPES[precision])
    least, normal = float(info.smallest_subnormal), float(info.smallest_normal)
    known = {least: "least denormal", normal - least: "largest denormal", normal: "least normal"}
    known[float(info.max)] = "largest"
    name = known.get(abs(value))
    return ("−" if value < 0 else "") + name if name else text(value)


def text(value: float | np.floating) -> str:
    """A value in few words: −0 and the infinities by their sign."""
    value = float(value)
    if math.isnan(value):
        return "NaN"
    sign = "−" if math.copysign(1, value) < 0 else ""
    return sign + ("∞" if math.isinf(value) else f"{abs(value):.5g}")
