"""The angle between a known normal and one of a picture: one of no length is no right one."""

import math

import numpy as np
import pytest

from study.experiments.stability.cases.scenes import angle_degrees


@pytest.mark.parametrize(
    ("normal", "degrees"),
    [
        ([0, 0, 1], 0),
        ([0, 1, 0], 90),
        ([0, 0, -1], 180),
        ([0, 0, 1.0009], 0),
        ([0, 0, 1.002], 180),
        ([0, 0, 0], 180),
        ([0, 0, math.nan], 180),
    ],
)
def test_a_normal_of_no_length_is_at_180_degrees(normal: list[float], degrees: float) -> None:
    up = np.array([0, 0, 1.0])
    assert angle_degrees(np.array(normal, float), up) == degrees
    both = angle_degrees(np.array([[0, 0, 1.0], normal]), up)
    assert both.tolist() == [0, degrees]
