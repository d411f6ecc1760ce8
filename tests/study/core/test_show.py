"""Numbers as tables print them."""

import math

import pytest

from study.core import show


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (1, "100\u00a0%"),
        (0.99999711, "99.9997\u00a0%"),
        (1 - 1e-9, "99.9999999\u00a0%"),
        (0.5, "50\u00a0%"),
        (None, "–"),
    ],
)
def test_only_all_of_it_is_100_percent(value, text) -> None:
    assert show.share(value) == text


@pytest.mark.parametrize(
    ("value", "text"),
    [
        *((0, "0"), (12.345, "12.3"), (1234.5, "1,234"), (0.00123, "0.00123"), (1e-4, "1.00e-04")),
        *((math.inf, "∞"), (None, "–"), (math.nan, "–"), (-2.5, "-2.50"), ("word", "word")),
    ],
)
def test_numbers_keep_three_digits(value: object, text: str) -> None:
    assert show.number(value) == text


def test_an_interval_has_the_digits_of_its_value() -> None:
    assert show.interval({"x": 12.5, "x_low": 9.99, "x_high": 13}, "x", 3) == "12.5 [10.0,\u00a013.0]"
