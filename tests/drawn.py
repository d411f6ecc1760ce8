"""How many examples hypothesis draws for a test."""

from __future__ import annotations

from hypothesis import settings

WHOLE = 100  # of the profile `whole`


def examples(count: int) -> int:
    """`count` of them, or the profile's share of it (conftest.py)."""
    return max(1, round(count * settings.default.max_examples / WHOLE))
