"""Hard cases of groups: their known answers, against the fields of groups in NumPy (conformance)."""

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


@pytest.mark.parametrize("number", ANSWERS)
def test_the_field_is_zero_there_and_not_before(number: int) -> None:
    for strength in of(number).strengths:
        whole, t = ANSWERS[number](strength)
        first_hit_holds(whole, (t.shape[1], t.shape[0]), t, scale=max(strength, 1) if number == 41 else 1)


def test_a_blend_at_a_wall() -> None:
    """Its copies are whole: away from the cells' walls the field of each is that of the repeated group."""
    whole, t = groups.walled(of(42).strengths[0])
    first_hit_holds(whole, groups.SIZE, t, reach=8)
    assert np.isfinite(t).any()
    for strength in of(42).strengths[1:]:
        hit = np.isfinite(groups.walled(strength)[1])
        assert hit.any() and not hit.all()
