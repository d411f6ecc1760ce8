"""Numbers as tables print them."""

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
