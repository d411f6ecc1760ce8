"""What a figure's marks say under the pointer: titles in its SVG, and that SVG made short for a page."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.collections import PathCollection
from matplotlib.container import BarContainer, ErrorbarContainer
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

ID = "told-{}"
Told = dict[str, list[str]]  # id of an element → a text for each of its marks, or one for all of them


def tell(drawn: Any, says: str | Sequence[str] = ()) -> None:
    """Has marks say something: a text each, or one for all of them; nothing for what only sets off another.

    `drawn`: what plot (of one line), scatter, errorbar, bar or barh of an axes gave.
    """
    if isinstance(drawn, BarContainer):
        for bar, text in zip(drawn, [says] * len(drawn) if isinstance(says, str) else says, strict=True):
            tell(bar, text)
        return
    if isinstance(drawn, ErrorbarContainer):
        drawn = drawn.lines[0]
    if isinstance(drawn, list):
        (drawn,) = drawn
    drawn.told = [says] if isinstance(says, str) else list(says)


def _of_marks(artist: Artist) -> list[str]:
    """Its texts without those of marks that have no place, which are not drawn."""
    if len(artist.told) < 2:
        return artist.told
    places = artist.get_xydata() if isinstance(artist, Line2D) else artist.get_offsets()
    there = np.isfinite(np.ma.filled(np.ma.asarray(places, float), np.nan)).all(axis=1)
    return [text for text, drawn in zip(artist.told, there, strict=True) if drawn]


def numbered(figure: Figure) -> Told:
    """Gives an id to everything that was told something. Call it before the figure is saved."""
    told: Told = {}
    for artist in figure.findobj(lambda one: hasattr(one, "told")):
        artist.set_gid(ID.format(len(told)))
        told[artist.get_gid()] = _of_marks(artist)
    return told


def untold(figure: Figure) -> list[Artist]:
    """Marks and bars of the figure's panels that say nothing: for tests."""
    whiskers = {
        cap
        for axes in figure.axes
        for container in axes.containers
        if isinstance(container, ErrorbarContainer)
        for cap in container.lines[1]
    }
    found: list[Artist] = []
    for axes in figure.axes:
        marked = [one for one in axes.lines if one.get_marker() not in ("None", "", None)]
        marked = [one for one in marked if len(one.get_xdata()) and one not in whiskers]
        clouds = [one for one in axes.collections if isinstance(one, PathCollection)]
        clouds = [one for one in clouds if len(one.get_offsets())]
        found += [one for one in (*marked, *clouds, *axes.patches) if not hasattr(one, "told")]
    return found


def _block(svg: str, gid: str) -> tuple[int, int] | None:
    """Where the content of the group of that id begins and ends."""
    head = f'<g id="{gid}">'
    start = svg.find(head)
    if start < 0:
        return None
    start += len(head)
    depth = 1
    for found in re.finditer(r"<g\b[^>]*?(/?)>|</g>", svg[start:]):
        depth += -1 if found[0] == "</g>" else not found[1]
        if not depth:
            return start, start + found.start()
    return None


def titled(svg: str, told: Mapping[str, Sequence[str]]) -> str:
    """The SVG with a <title> in each mark that was told something."""
    for gid, texts in told.items():
        if not texts or (place := _block(svg, gid)) is None:
            continue
        start, end = place
        inside = svg[start:end]
        titles = [f"<title>{escape(text, quote=False)}</title>" for text in texts]
        leaves = list(re.finditer(r"<use [^>]*?\bx=[^>]*/>", inside))
        leaves = leaves or list(re.finditer(r"<path (?![^>]*\bid=)[^>]*/>", inside))
        if len(texts) == len(leaves) > 1:
            kind = leaves[0][0][1:].split(None, 1)[0]
            parts, last = [], 0
            for leaf, title in zip(leaves, titles, strict=True):
                parts += [inside[last : leaf.start()], leaf[0].removesuffix("/>"), f">{title}</{kind}>"]
                last = leaf.end()
            inside = "".join([*parts, inside[last:]])
        else:
            whole = "\n".join(dict.fromkeys(texts))
            inside = f"<title>{escape(whole, quote=False)}</title>{inside}"
        svg = svg[:start] + inside + svg[end:]
    return svg


def _shorter(tag: re.Match[str]) -> str:
    """A tag with numbers to the hundredth, one blank for several, without the names of fonts."""
    text = re.sub(r"; font-family: (?:&apos;[^&]*&apos;|[^;\"])*", "", tag[0])
    text = re.sub(r"(?<![\w#])-?\d+\.\d{3,}", lambda one: f"{round(float(one[0]), 2):g}", text)
    text = re.sub(r"\s+", " ", text)
    return re.sub(r"(?<=[:;]) ", "", text) if ' style="' in text else text


def short(svg: str, name: str) -> str:
    """For use inside a page: no prolog, ids of its own (those that are used, after `name`), few bytes."""
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>|<!--.*?-->", "", svg, flags=re.DOTALL)
    svg = re.sub(r' xmlns:xlink="[^"]*"', "", svg).replace("xlink:href", "href")
    svg = re.sub(r"<[^>]+>", _shorter, svg)
    svg = re.sub(r">\s+<", "><", svg)
    used = set(re.findall(r'(?:url\(#|href="#)([^)"]+)', svg))
    svg = re.sub(r' id="([^"]*)"', lambda one: one[0] if one[1] in used else "", svg)
    for before in ('id="', "url(#", 'href="#'):
        svg = svg.replace(before, f"{before}{name}-")
    return svg.strip()
