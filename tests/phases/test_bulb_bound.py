"""Proof by intervals of what opt9_convex takes for a Mandelbulb's distance: BULB_SHARE·(|p| − bound).

The estimate after n iterations is r_n·ln(r_n)/(2·d_n), d_1 = 12·r⁷ + 1, d_(k+1) = 8·r_k⁷·d_k + 1, r = |p|.
The map without its addition takes |w| to |w|⁸, so r_(k+1) lies in r_k⁸ ± r whatever the direction: one
dimension is left. n = 1 and 2 by subdivision up to FAR; from there on, and from each later n to the next, by
what stands at the asserts.
"""

from __future__ import annotations

import re
from pathlib import Path

from flint import arb

from study.core import registry

FAR = 1000.0
PHASE = "opt9_convex"  # opt10_scene derives from it


def constant(file: Path, pattern: str) -> arb:
    """A number of the source, exactly as written."""
    return arb(re.search(pattern, file.read_text())[1])


def between(low: arb, high: arb) -> arb:
    return low.union(high)


def estimates(r: arb) -> tuple[arb, arb, arb]:
    """Enclosures of the least estimates after one and two iterations for |p| in r, and of the least r_1."""
    derivative = 12 * r**7 + 1
    # x·ln x rises from 1/e on, and what it is divided by does not depend on r_1: the least r_1 is the worst.
    first = r**8 - r
    one = first * first.log() / (2 * derivative)
    # r_2·ln(r_2)/(2·(8·r_1⁷·d_1 + 1)) with r_2 ≥ r_1⁸ − r; over r_1⁷: it rises with r_1, as ln r_2 does.
    share = (first - r / first**7) * (first**8 - r).log()
    two = share / (2 * (8 * derivative + 1 / first**7))
    return one, two, first


def least_share(low: str, high: float, bound: arb, share: arb) -> float:
    """The least proved quotient of estimate and |p| − bound. AssertionError where none can be proved."""
    parts, least = [(arb(low), arb(high))], float("inf")
    while parts:
        a, b = parts.pop()
        one, two, first = estimates(between(a, b))
        assert float(b - a) > 1e-7, f"not proved at {a}"
        room = between(a, b) - bound
        if not (first > 1 and one > share * room and two > share * room):
            parts += [(a, (a + b) / 2), ((a + b) / 2, b)]
        elif a > bound + arb("0.01"):
            least = min(least, float((one / room).lower()), float((two / room).lower()))
    return least


def test_estimate_exceeds_the_share_of_the_distance_to_the_bounding_sphere() -> None:
    share = constant(registry.find_phase(PHASE).file("core/prepared.h"), r"#define BULB_SHARE ([0-9.]+)f")
    bounds = registry.ROOT / "common/scene/shadow_bounds.h"
    bound = constant(bounds, r"case SHAPE_MANDELBULB:\s*return ([0-9.]+);")
    assert share > 0 and float(bound) == 1.15
    assert least_share("1.15", FAR, bound, share) > float(share)
    # From FAR on: r_1 ≥ r⁸·(1 − r⁻⁷), d_1 ≤ 12·r⁷·(1 + r⁻⁷): the estimate is r·ln(r)/3 but for 4·r⁻⁷ of it.
    far = arb(FAR)
    assert far.log() / 3 * (1 - 4 / far**7) > share
    # From n = 2 on: r_(n+1)·ln r_(n+1) ≥ 8·r_n⁸·ln(r_n)·(1 − 2·r/r_n⁸), and d_(n+1) is 8·r_n⁷·d_n but for
    # 1/(8·r_n⁷·d_n) of it: a step takes 2·r/r_n⁸ + r_n⁻⁷ of the estimate at most, and since r_n goes up by
    # eighth powers, all steps together twice what the first takes.
    first = bound**8 - bound
    second = first**8 - bound
    loss = 2 * (2 * bound / second**8 + 1 / second**7)
    assert first > 1 and loss < arb("1e-13")


def test_a_larger_share_is_not_proved() -> None:
    try:
        least_share("1.15", 4.0, arb("1.15"), arb("0.54"))
    except AssertionError:
        return
    raise AssertionError("0.54 is more than the estimate has near 1.65")
