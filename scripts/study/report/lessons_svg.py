"""Draws the data of `lessons.figure` as a small SVG: text as text, on a white ground, so that a light and a
dark page can both hold it."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any
from xml.sax.saxutils import escape

WIDTH, MARGIN = 720, 16
LEFT = 178  # where the plots begin, right of the labels
ROW, BAR = 19, 12  # height of a row of marks, of a bar
BEFORE, AFTER, OTHER, INK, PALE = "#8c8c8c", "#0072b2", "#c77700", "#1a1a1a", "#dddddd"
FONT = "system-ui,-apple-system,'Segoe UI',Helvetica,Arial,sans-serif"
Row = Mapping[str, Any]


def number(value: float) -> str:
    """Three digits that matter: 1,230 or 0.0123."""
    if abs(value) >= 100:
        return f"{value:,.0f}"
    return f"{value:.{max(0, 2 - math.floor(math.log10(abs(value))))}f}" if value else "0"


def _text(x: float, y: float, words: str, **more: Any) -> str:
    style = "".join(f' {key.replace("_", "-")}="{value}"' for key, value in more.items())
    return f'<text x="{x:.0f}" y="{y:.0f}"{style}>{escape(words)}</text>'


def _rect(x: float, y: float, width: float, height: float, fill: str) -> str:
    return f'<rect x="{x:.1f}" y="{y:.1f}" width="{width:.1f}" height="{height:.1f}" fill="{fill}"/>'


def _line(x: float, y: float, to_x: float, to_y: float, stroke: str, width: float = 1) -> str:
    ends = f'x1="{x:.1f}" y1="{y:.1f}" x2="{to_x:.1f}" y2="{to_y:.1f}"'
    return f'<line {ends} stroke="{stroke}" stroke-width="{width:g}"/>'


def _dot(x: float, y: float, colour: str, fill: str) -> str:
    return f'<circle cx="{x:.1f}" cy="{y:.1f}" r="4" fill="{fill}" stroke="{colour}" stroke-width="1.6"/>'


def _ticks(low: float, high: float) -> list[float]:
    """Of a logarithmic axis: 1, 2 and 5 of each power of ten, or the powers where these would be many."""
    powers = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    steps = (1, 2, 5) if high / low < 60 else (1,)
    return [step * 10.0**power for power in powers for step in steps if low <= step * 10.0**power <= high]


def _legend(y: float, names: Sequence[str], colours: Sequence[str], hollow: bool) -> list[str]:
    made, x = [], float(LEFT)
    for index, (name, colour) in enumerate(zip(names, colours, strict=False)):
        made.append(_dot(x + 4, y - 4, colour, "#fff" if hollow and index == 0 else colour))
        made.append(_text(x + 13, y, name))
        x += 34 + 6.6 * len(name)
    return made


def _pairs(panel: Row, top: float) -> tuple[list[str], float]:
    """Rows on a logarithmic axis: a hollow mark before, a full one after, both values and their ratio."""
    right, rows = WIDTH - MARGIN - 178, panel["rows"]
    values = [end for row in rows for value in row["values"] for end in value if end]
    low, high = min(values) / 1.15, max(values) * 1.15

    def x(value: float) -> float:
        return LEFT + (right - LEFT) * math.log(value / low) / math.log(high / low)

    bottom = top + ROW * len(rows)
    made = []
    for tick in _ticks(low, high):
        made += [_line(x(tick), top, x(tick), bottom, PALE)]
        made += [_text(x(tick), bottom + 13, f"{tick:,.10g}", text_anchor="middle", font_size=10)]
    for place, row in enumerate(rows):
        y = top + ROW * (place + 0.5)
        before, after = row["values"]
        made.append(_text(LEFT - 10, y + 4, row["label"], text_anchor="end"))
        made.append(_line(x(before[0]), y, x(after[0]), y, "#bbb", 1.5))
        for value, colour, fill in ((before, BEFORE, "#fff"), (after, AFTER, AFTER)):
            if value[1] is not None:
                made.append(_line(x(value[1]), y, x(value[2]), y, colour, 5))
            made.append(_dot(x(value[0]), y, colour, fill))
        ratio = before[0] / after[0] if panel["unit"] == "ms" else after[0] / before[0]
        made.append(_text(right + 14, y + 4, f"{number(before[0])} → {number(after[0])}"))
        made.append(_text(WIDTH - MARGIN, y + 4, f"{number(ratio)}×", text_anchor="end", font_weight="bold"))
    return made, bottom + 18


def _bars(panel: Row, top: float) -> tuple[list[str], float]:
    """A bar a row and series from 0 on, its value beside it."""
    right, series = WIDTH - MARGIN - 70, len(panel["series"])
    colours = (AFTER,) if series == 1 else (BEFORE, AFTER)
    most = max(end for row in panel["rows"] for value in row["values"] for end in value if end)
    made, y = [], top
    for row in panel["rows"]:
        high = BAR * series
        made.append(_text(LEFT - 10, y + high / 2 + 4, row["label"], text_anchor="end"))
        for index, (value, low, upper) in enumerate(row["values"]):
            at = y + BAR * index
            if value is None:
                made.append(_text(LEFT + 4, at + 10, "infinite", font_size=10))
                continue
            long = (right - LEFT) * value / most
            made.append(_rect(LEFT, at + 0.5, long, BAR - 1, colours[index]))
            end = long
            if low is not None:
                end = (right - LEFT) * upper / most
                middle = at + BAR / 2
                made.append(_line(LEFT + (right - LEFT) * low / most, middle, LEFT + end, middle, INK, 1.5))
            made.append(_text(LEFT + max(long, end) + 5, at + 10, number(value), font_size=11))
        y += high + 7
    made.append(_line(LEFT, top - 2, LEFT, y - 4, INK))
    return made, y + 2


def _lines(panel: Row, top: float) -> tuple[list[str], float]:
    """A curve a series over the rows' labels, which are numbers."""
    right, bottom = WIDTH - MARGIN - 20, top + 210
    across = [float(row["label"]) for row in panel["rows"]]
    most = max(value[0] for row in panel["rows"] for value in row["values"] if value[0] is not None)
    most = 20 * math.ceil(most / 20)

    def x(value: float) -> float:
        return LEFT + 10 + (right - LEFT - 20) * (value - across[0]) / (across[-1] - across[0])

    def y(value: float) -> float:
        return bottom - (bottom - top) * value / most

    made = []
    for tick in range(0, most + 1, 20):
        made += [_line(LEFT, y(tick), right, y(tick), PALE)]
        made += [_text(LEFT - 8, y(tick) + 4, str(tick), text_anchor="end", font_size=11)]
    made += [_text(x(at), bottom + 15, f"{at:g}", text_anchor="middle", font_size=11) for at in across]
    for index, colour in enumerate((BEFORE, OTHER, AFTER)[: len(panel["series"])]):
        points = [(x(at), row["values"][index][0]) for at, row in zip(across, panel["rows"], strict=True)]
        known = [(at, y(value)) for at, value in points if value is not None]
        path = " ".join(f"{at:.1f},{value:.1f}" for at, value in known)
        made.append(f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="2"/>')
        made += [_dot(at, value, colour, colour) for at, value in known]
    return made, bottom + 20


KINDS = {"pairs": _pairs, "bars": _bars, "lines": _lines}


def svg(data: Mapping[str, Any]) -> str:
    """The figure of that data, which is in it as its metadata."""
    made = [_text(MARGIN, 26, f"{data['phase']}: {data['title']}", font_size=16, font_weight="bold")]
    y = 34.0
    for panel in data["panels"]:
        names, hollow = panel["series"], panel["kind"] == "pairs"
        colours = (BEFORE, OTHER, AFTER) if panel["kind"] == "lines" else (BEFORE, AFTER)
        made.append(_text(MARGIN, y + 22, f"{panel['title']} ({panel['unit']})", font_weight="bold"))
        y += 30
        if len(names) > 1:
            made += _legend(y + 12, names, colours, hollow)
            y += 20
        drawn, y = KINDS[panel["kind"]](panel, y + 4)
        made += drawn
    made.append(_text(MARGIN, y + 18, data["caption"], font_size=11, fill="#555"))
    high = y + 30
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH}" height="{high:.0f}" '
        f'viewBox="0 0 {WIDTH} {high:.0f}" font-family="{FONT}" font-size="12" fill="{INK}">'
    )
    about = f"<metadata>{escape(json.dumps(data, ensure_ascii=False))}</metadata>"
    title = f"<title>{escape(data['phase'])}: {escape(data['title'])}</title>"
    ground = f'<rect width="{WIDTH}" height="{high:.0f}" rx="6" fill="#fff"/>'
    return "\n".join([head, title, about, ground, *made, "</svg>", ""])
