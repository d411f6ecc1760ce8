"""A NaN anywhere in a case's pictures is its answer, and a normal of no length is no right one."""

from __future__ import annotations

import math

import numpy as np
import pytest

from study.experiments.stability.cases import light, many, surfaces
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


class Fake:
    """Pictures with every plane right enough, NaN in `plane` of the picture of that number."""

    def __init__(self, plane: str, number: int) -> None:
        self.plane, self.number, self.made = plane, number, 0

    def render(self, whole: dict, size: tuple[int, int]) -> dict[str, np.ndarray]:
        planes = {name: np.ones(size[::-1]) for name in ("R", "G", "B", "Z", "N.z", "evals")}
        planes |= {name: np.zeros(size[::-1]) for name in ("id", "N.x", "N.y")}
        if self.made == self.number:
            planes[self.plane][-1, -1] = math.nan
        self.made += 1
        return planes

    def distances(self, whole: dict, p: np.ndarray) -> np.ndarray:
        found = np.zeros(len(p))
        if self.plane == "f" and self.made == self.number:
            found[-1] = math.nan
        self.made += 1
        return found


@pytest.mark.parametrize("number", range(6))
def test_repetition_keeps_a_distance_that_is_nan(number: int) -> None:
    assert math.isnan(many.c09_repetition(Fake("f", number), 10.0).error)


@pytest.mark.parametrize("number", range(2))
def test_mirrors_keep_a_colour_that_is_nan(number: int) -> None:
    assert math.isnan(light.c18_mirrors_and_inside(Fake("R", number), 1.0).error)


def test_edges_keep_a_normal_and_a_depth_that_are_nan(monkeypatch: pytest.MonkeyPatch) -> None:
    last = len(list(surfaces.spots(1e-3))) - 1
    for number in (0, last):
        assert "nan" in surfaces.c11_edges(Fake("Z", number), 1e-3).note
        assert surfaces.c11_edges(Fake("N.x", number), 1e-3).error == 180
    angles = iter([math.nan] + [1.0] * last)
    monkeypatch.setattr(surfaces, "angle_degrees", lambda a, b: next(angles))
    assert math.isnan(surfaces.c11_edges(Fake("", -1), 1e-3).error)
