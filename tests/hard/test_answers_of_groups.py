"""Hard cases of groups: their known answers, against the fields of groups in NumPy (conformance)."""

from collections.abc import Callable

import numpy as np
import pytest

from hard.known import first_hit_holds, of
from study.experiments.stability.cases import groups

ANSWERS = {
    35: groups.carved,
    36: groups.sheet,
    37: groups.stacked,
    38: groups.displaced,
    39: groups.twisted,
    40: groups.nested,
    41: groups.hollow,
}


@pytest.mark.parametrize(("number", "known"), ANSWERS.items())
def test_the_field_is_zero_there_and_not_before(number: int, known: Callable[[float], groups.Known]) -> None:
    for strength in of(number).few():
        if number == 37 and strength > 100:  # NumPy takes seconds for more, and sums them no better
            continue
        whole, t = known(strength)
        # Lengths of a hollow are its radius; sums of equal numbers round each time.
        scale = {37: strength, 41: max(strength, 1)}.get(number, 1)
        first_hit_holds(whole, (t.shape[1], t.shape[0]), t, scale, reach=8)


def test_a_blend_at_a_wall() -> None:
    """In the middle of its cell the repeated group's field is that of all its copies."""
    first_hit_holds(*_with_size(groups.walled(of(42).strengths[0])), reach=8)
    for strength in of(42).strengths[1:]:
        hit = np.isfinite(groups.walled(strength)[1])
        assert hit.any() and not hit.all()


def _with_size(known: groups.Known) -> tuple[dict, tuple[int, int], np.ndarray]:
    whole, t = known
    return whole, (t.shape[1], t.shape[0]), t
