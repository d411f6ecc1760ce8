"""What conformance expects where the reference ran out of steps and a phase that starts late did not."""

from __future__ import annotations

import numpy as np
import pytest

from conformance.harness import Run, within_reach
from study.pictures.images import Picture
from study.truth.judging import PROVED

STEPS = 20


def hit(blank, **changed: float) -> Picture:
    """One pixel; `blank` is a hit of shape 0 at t = 10."""
    return blank(1, 1) | {name: np.full((1, 1), value, np.float32) for name, value in changed.items()}


def ran(picture: Picture) -> Run:
    return Run(["render"], 0, f'{{"max_steps": {STEPS}}}', "", picture=picture)


@pytest.fixture
def pictures(blank, miss) -> tuple[Picture, Picture, Picture]:
    """A reference without steps, a phase that starts late and hits, and truth, which has the hit nearby."""
    spent = hit(blank, evals=STEPS)
    miss(spent)
    return spent, hit(blank, start=9, R=0.7), hit(blank, Z=10.5, status=PROVED)


def test_a_hit_that_truth_has_is_expected_at_its_depth(pictures) -> None:
    spent, late, truth = pictures
    expected = within_reach(spent, ran(late), lambda: truth)
    assert expected["id"] == 0 and expected["Z"] == np.float32(10.5) and expected["N.z"] == -1
    assert expected["R"] == late["R"]  # not judged


def test_a_hit_where_there_is_no_surface_fails(pictures, miss) -> None:
    spent, late, truth = pictures
    miss(truth)
    with pytest.raises(AssertionError, match="1 hits where truth has no surface"):
        within_reach(spent, ran(late), lambda: truth)


@pytest.mark.parametrize("change", ["another shape", "not proved"])
def test_of_any_other_hit_a_miss_is_expected(pictures, miss, change: str) -> None:
    spent, late, truth = pictures
    if change == "not proved":
        miss(truth)
        truth["status"][:] = PROVED - 1
    else:
        truth["id"][:] = 1
    assert within_reach(spent, ran(late), lambda: truth)["id"] == -1


@pytest.mark.parametrize("change", ["steps left", "starts at the camera", "no start", "misses too"])
def test_elsewhere_the_reference_is_expected(pictures, miss, change: str) -> None:
    spent, late, _ = pictures
    if change == "steps left":
        spent["evals"][:] = STEPS - 1
    elif change == "starts at the camera":
        late["start"][:] = 0
    elif change == "no start":
        del late["start"]
    else:
        miss(late)
    assert within_reach(spent, ran(late), lambda: pytest.fail("truth was asked for")) == spent
