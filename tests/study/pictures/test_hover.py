"""What marks say under the pointer: titles in the SVG, each in its mark, and the SVG made short."""

from __future__ import annotations

import io
from pathlib import Path
from xml.etree import ElementTree

import matplotlib
import numpy as np
import pytest
from matplotlib.figure import Figure

from study.pictures import hover
from study.pictures.draw import STYLE, save

SVG = "{http://www.w3.org/2000/svg}"


def drawn(figure: Figure) -> str:
    with matplotlib.rc_context(STYLE):
        told, made = hover.numbered(figure), io.StringIO()
        figure.savefig(made, format="svg", metadata={"Date": None})
        return hover.titled(made.getvalue(), told)


def titles(svg: str) -> list[tuple[str, float | None]]:
    """Text of each title and the abscissa of its mark, where the mark has one."""
    root = ElementTree.fromstring(svg)
    found = []
    for parent in root.iter():
        for title in parent.findall(f"{SVG}title"):
            found.append((title.text, float(parent.get("x")) if parent.get("x") else None))
    return found


@pytest.mark.parametrize("count", [2, 40])
@pytest.mark.parametrize("kind", ["plot", "errorbar", "scatter", "colours"])
def test_each_mark_has_its_own_title(kind: str, count: int) -> None:
    """From left to right as told, whether Matplotlib draws marks as uses of one shape or each by itself."""
    figure = Figure()
    axes = figure.subplots()
    x, y = np.arange(count), np.arange(count)[::-1]
    if kind == "plot":
        made = axes.plot(x, y, "o-")
    elif kind == "errorbar":
        made = axes.errorbar(x, y, yerr=np.ones(count), marker="s", capsize=3)
    else:
        many = {"c": [f"C{i % 3}" for i in x]} if kind == "colours" else {"color": "red"}
        made = axes.scatter(x, y, marker="s", **many)
    hover.tell(made, [f"mark {i}" for i in x])
    assert not hover.untold(figure)
    found = titles(drawn(figure))
    assert [text for text, _ in found] == [f"mark {i}" for i in x]
    places = [at for _, at in found]
    assert all(at is None for at in places) or places == sorted(places)


def test_a_mark_without_a_place_takes_its_text_with_it() -> None:
    figure = Figure()
    axes = figure.subplots()
    hover.tell(axes.plot([0, 1, 2], [1, np.nan, 3], "o"), ["a", "b", "c"])
    hover.tell(axes.scatter([0, np.nan, 2, 3], [1, 2, 3, 4]), ["d", "e", "f", "g"])
    assert [text for text, _ in titles(drawn(figure))] == ["d", "f", "g", "a", "c"]


def test_bars_one_text_for_many_and_what_only_sets_off_another() -> None:
    figure = Figure()
    axes = figure.subplots()
    hover.tell(axes.barh([0, 1], [2, 3]), ["two", "three"])
    hover.tell(axes.scatter(range(30), range(30)), "thirty < marks & more")
    ring = axes.plot(1, 1, "o")
    assert hover.untold(figure) == ring
    hover.tell(ring)
    assert not hover.untold(figure)
    svg = drawn(figure)
    assert sorted(text for text, _ in titles(svg)) == ["thirty < marks & more", "three", "two"]


def test_a_mark_that_was_told_nothing_is_found() -> None:
    figure = Figure()
    axes = figure.subplots()
    line = axes.plot([1, 2], [1, 2])
    marks = [*axes.plot([1], [1], "s"), axes.scatter([1], [2]), *axes.bar([1], [2])]
    axes.errorbar([1], [1], yerr=[1], capsize=3, linestyle="none")
    assert hover.untold(figure) == marks and line


def test_powers_of_ten_are_formulas_and_names_are_not(tmp_path: Path) -> None:
    figure = Figure(layout="constrained")
    axes = figure.subplots()
    axes.plot([1, 2], [0, 1e6])
    axes.set_yscale("symlog", linthresh=10)
    axes.set_xticks([1, 2], ["$a$", "b"])
    with matplotlib.rc_context(STYLE):
        svg, _ = save(figure, tmp_path / "figure", "costs $1, not $2")
    root = ElementTree.parse(svg).getroot()
    texts = ["".join("".join(one.itertext()).split()) for one in root.iter(f"{SVG}text")]
    assert {"$a$", "b", "costs$1,not$2", "106"} <= set(texts)
    assert not any("mathdefault" in text for text in texts)


def test_a_short_svg_is_whole_and_has_ids_of_its_own() -> None:
    figure = Figure()
    axes = figure.subplots()
    axes.set_title("0.123456 &  two blanks")
    hover.tell(axes.plot([0, 1, 2], [1, 2, 3], "o-"), ["0.123456", "b", "c"])
    svg = drawn(figure)
    page = hover.short(svg, "name")
    root = ElementTree.fromstring(page)
    assert len(page) < 0.6 * len(svg) and "font-family" not in page and "<!--" not in page
    assert [text for text, _ in titles(page)] == ["0.123456", "b", "c"]
    assert "0.123456 &  two blanks" in [one.text for one in root.iter(f"{SVG}text")]
    own = {one.get("id") for one in root.iter()} - {None}
    assert own and all(one.startswith("name-") for one in own)
    places = [at for _, at in titles(page)]
    assert places == pytest.approx([at for _, at in titles(svg)], abs=0.006)
