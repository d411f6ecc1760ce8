"""Figures drawn under an eye: none may have a mark that says nothing under the pointer."""

from __future__ import annotations

import pytest
from matplotlib.figure import Figure

from study.pictures import hover


def checked(patch: pytest.MonkeyPatch) -> None:
    """From here on a figure with such a mark is an AssertionError where it is saved."""
    numbered = hover.numbered

    def check(figure: Figure) -> hover.Told:
        assert not hover.untold(figure), f"marks of “{figure.get_suptitle()}” say nothing"
        return numbered(figure)

    patch.setattr(hover, "numbered", check)
