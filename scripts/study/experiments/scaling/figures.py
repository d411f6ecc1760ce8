"""The figures of how cost grows, made from scaling.json and the thumbnails beside it alone."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from study.core import machine, registry, show
from study.experiments.scaling.series import LAW, Row
from study.numbers import power_laws as scaling_fit
from study.pictures.draw import Drawing, legend, look, panels, plain_log, thumbnails
from study.pictures.hover import tell

APART = 0.052  # of a panel's height: labels that are nearer would overlap
TOP = 120  # dB: what is nearer is drawn here
SHEET = "scaling-scenes"
PAPERS = {"color": "#999999", "linestyle": (0, (1, 2)), "linewidth": 1.5, "zorder": 1}


def milliseconds(row: Row) -> float:
    return float(np.median(row["ns"])) * 1e-6


def _places(values: Sequence[float]) -> list[float]:
    """Heights in 0 to 1 moved apart so that no two labels overlap, in their order."""
    order = sorted(range(len(values)), key=lambda i: values[i])
    moved = list(values)
    for before, after in itertools.pairwise(order):
        moved[after] = max(moved[after], moved[before] + APART)
    over = max(0.0, max(moved, default=0) - 1)  # a stack that grew over the top moves down as one
    return [place - over for place in moved] if over else moved


def _labels(axes: Axes, ends: list[tuple[float, float, str, str]]) -> None:
    """The exponents at the right ends of the lines: x, y, text, colour."""
    low, high = (math.log(y) for y in axes.get_ylim())
    heights = [(math.log(y) - low) / (high - low) for _, y, _, _ in ends]
    for (_, _, text, colour), place in zip(ends, _places(heights), strict=True):
        where = {"xycoords": "axes fraction", "textcoords": "offset points", "annotation_clip": False}
        axes.annotate(text, (1.0, place), (3, 0), color=colour, fontsize=8, va="center", **where)


def _law(fit: Row, x: np.ndarray) -> np.ndarray:
    return fit["factor"] * x ** fit["exponent"]["value"]


def _several(rows: Iterable[Row]) -> set[str]:
    """Series of which some program has two points: one point shows no growth."""
    found: dict[tuple[str, str], set[float]] = {}
    for row in rows:
        found.setdefault((row["series"], row["phase"]), set()).add(row["x"])
    return {series for (series, _), across in found.items() if len(across) > 1}


def _lines(rows: Sequence[Row], value: Callable[[Row], float | None]) -> list[Row]:
    """Rows with a value, of the series in which it can be seen to grow."""
    several = _several(row for row in rows if value(row))
    return [row for row in rows if value(row) and row["series"] in several]


def _grown(
    result: dict[str, Any], value: Callable[[Row], float | None], kind: str, title: str, axis: str
) -> Figure:
    """A panel per series that has a line, log-log: each program's points, fitted law (dashed), exponent."""
    rows = _lines(result["rows"], value)
    named = [row | {"scene": result["titles"][row["series"]]} for row in rows]
    frame = pd.DataFrame([{"scene": r["scene"], "phase": r["phase"], "threads": 1} for r in named])
    figure, grid = panels(frame, 3.1, 4.3)
    figure.suptitle(title, x=0.01, ha="left", fontsize=12)
    looks = look(frame)
    for name, axes in grid.items():
        mine = [row for row in named if row["scene"] == name]
        axes.set(
            title=name, xscale="log", yscale="log", ylabel=axis, xlabel=result["axes"][mine[0]["series"]]
        )
        axes.title.set_fontsize(10)
        ends = []
        for phase in dict.fromkeys(row["phase"] for row in mine):
            style = looks[phase, 1]
            points = [(row["x"], value(row)) for row in mine if row["phase"] == phase]
            marks = {"marker": style["marker"], "markersize": 4.5, "color": style["color"]}
            drawn = axes.plot(*zip(*points, strict=True), **marks, linewidth=0.8, label=phase, zorder=3)
            across = result["axes"][mine[0]["series"]]
            tell(drawn, [f"{phase}, {across} {x:g}: {show.number(y)} {axis}" for x, y in points])
            fits = [f for f in result["fits"] if (f["title"], f["phase"]) == (name, phase)]
            fit = fits[0][kind] if fits else None
            if fit:
                across = np.array([fit["first_x"], fit["last_x"]])
                scale = 1e-6 if kind == "time" else 1
                axes.plot(
                    across, scale * _law(fit, across), "--", color=style["color"], linewidth=1.4, alpha=0.75
                )
                star = "*" if fit["holds"] is False else ""
                ends.append((*points[-1], f"x^{fit['exponent']['value']:.2f}{star}", style["color"]))
        if kind == "time" and (paper := _papers(result, name)) is not None:
            across = np.array([min(r["x"] for r in mine), max(r["x"] for r in mine)], float)
            start = value(next(r for r in mine if r["x"] == across[0]))
            limits = axes.get_ylim()
            axes.plot(across, start * (across / across[0]) ** paper, **PAPERS, label=f"the paper's {LAW}")
            axes.set_ylim(limits[0], max(limits[1], 2 * max(value(r) for r in mine)))
        low, high = axes.get_ylim()
        wide = max(
            1.0, math.sqrt(4.5 * low / high)
        )  # at least 4.5 from end to end: a tenth of a step is nothing
        axes.set_ylim(low / wide, high * wide)
        plain_log(axes.xaxis)
        plain_log(axes.yaxis)
        _labels(axes, ends)
    legend(figure, grid)
    return figure


def _papers(result: dict[str, Any], title: str) -> float | None:
    return next((f["paper"] for f in result["fits"] if f["title"] == title), None)


def level(row: Row) -> float | None:
    """PSNR in dB to the row's reference, at most TOP; None without one."""
    if row.get("rmse") is None:
        return None
    return TOP if row["psnr_db"] is None else min(row["psnr_db"], TOP)


def _decibels(row: Row) -> str:
    reference = "ground truth" if row["reference"] == "truth" else row["reference"]
    return f"{'≥ ' * (level(row) == TOP)}{show.number(level(row))} dB to {reference}"


def errors(result: dict[str, Any]) -> Figure:
    """A panel per series: PSNR to ground truth (filled) or to the finest picture there is (hollow)."""
    rows = [r | {"scene": result["titles"][r["series"]]} for r in result["rows"] if level(r) is not None]
    frame = pd.DataFrame([{"scene": r["scene"], "phase": r["phase"], "threads": 1} for r in rows])
    figure, grid = panels(frame, 3.1, 4.3)
    title = f"Error: up is nearer to the reference ({TOP} dB: that or nearer)"
    figure.suptitle(title, x=0.01, ha="left", fontsize=12)
    looks, order = look(frame), list(dict.fromkeys(frame["phase"]))
    for name, axes in grid.items():
        mine = [row for row in rows if row["scene"] == name]
        for phase in dict.fromkeys(row["phase"] for row in mine):
            style = looks[phase, 1]
            points = [row for row in mine if row["phase"] == phase]
            size = max(24, 80 - 32 * order.index(phase))  # what lies below others looks out from under them
            at = [row["x"] for row in points], [level(row) for row in points]
            for one in dict.fromkeys(
                row["reference"] for row in points
            ):  # no line from one reference to another
                same = [(row["x"], level(row)) for row in points if row["reference"] == one]
                axes.plot(*zip(*same, strict=True), color=style["color"], linewidth=0.8, zorder=2)
            fill = [style["color"] if row["reference"] == "truth" else "white" for row in points]
            marks = {"marker": style["marker"], "s": size, "edgecolor": style["color"], "zorder": 3}
            drawn = axes.scatter(*at, c=fill, **marks)
            across = result["axes"][mine[0]["series"]]
            tell(drawn, [f"{phase}, {across} {row['x']:g}: {_decibels(row)}" for row in points])
            axes.plot([], [], marker=style["marker"], color=style["color"], linewidth=0.8, label=phase)
        axes.set(
            title=name, xscale="log", xlabel=result["axes"][mine[0]["series"]], ylabel="PSNR, dB (linear)"
        )
        axes.title.set_fontsize(10)
        plain_log(axes.xaxis)
        axes.set_ylim(0, TOP + 8)  # one scale: a tenth of a dB is nothing
        across = [row["x"] for row in mine]
        axes.set_xlim(min(across) / 1.3, max(across) * 1.3)
    legend(figure, grid)
    return figure


def sheet(result: dict[str, Any], folder: Path) -> Figure | None:
    """The generated scenes as they were rendered, a row per series."""
    lines: dict[str, dict[Path, str]] = {}
    for one in result["thumbnails"]:
        about = f"{one['scene']}: {100 * one['coverage']:.1f} % hit"
        lines.setdefault(one["series"], {})[folder / one["picture"]] = about
    return thumbnails("The generated scenes", [*lines.values()], (0.6, 0.9))


def _evaluations(row: dict[str, Any]) -> float | None:
    """Of a camera ray; none of a program with closed forms, where an older file has a 1 for each."""
    return None if registry.is_exact(row["phase"]) else row.get("evals_per_ray")


CAPTIONS = {
    "scaling-time": "Time of a frame against what it depends on, with fitted power laws",
    "scaling-evals": "Evaluations of a camera ray's march against the same",
    "scaling-error": "Error against the same",
    SHEET: "The generated scenes: the same share of the picture covered by any number",
}


def drawings(result: dict[str, Any], folder: Path) -> dict[str, Drawing]:
    """What scaling.json suffices for, and the sheet where the run's folder has its thumbnails."""
    time, evals = "Time of a frame, log-log", "Evaluations of the whole scene by a camera ray, log-log"
    able = {
        "scaling-time": lambda: _grown(result, milliseconds, "time", time, "ms a frame"),
        "scaling-evals": lambda: _grown(result, _evaluations, "evals", evals, "evaluations per ray"),
        "scaling-error": lambda: errors(result),
        SHEET: lambda: sheet(result, folder),
    }
    there = {
        "scaling-time": bool(_lines(result["rows"], milliseconds)),
        "scaling-evals": bool(_lines(result["rows"], _evaluations)),
        "scaling-error": any(level(row) is not None for row in result["rows"]),
        SHEET: any((folder / one["picture"]).is_file() for one in result["thumbnails"]),
    }
    return {
        name: Drawing(CAPTIONS[name], note(result), make, name == SHEET)
        for name, make in able.items()
        if there[name]
    }


def figures(result: dict[str, Any], folder: Path) -> dict[str, Figure]:
    """Every figure that there is something for. `folder`: of the run, where the thumbnails are."""
    return {name: drawing.make() for name, drawing in drawings(result, folder).items()}


def without(result: dict[str, Any]) -> str | None:
    """What was left out, a clause a series: from which x on of which programs; None: nothing."""
    found: dict[str, dict[tuple[int, str], list[str]]] = {}
    first: dict[tuple[str, str], Row] = {}
    for row in result["left_out"]:
        if row["series"] not in ("memory", "all"):
            key = row["series"], row["phase"]
            first[key] = min(first.get(key, row), row, key=lambda r: r["x"])
    for (series, phase), row in first.items():
        how = "all" if is_all(result, row) else "some"
        found.setdefault(series, {}).setdefault((row["x"], how), []).append(phase)
    clauses = [
        f"{series}: "
        + ", ".join(
            f"{' and '.join(phases)} {f'from {x:,} on' if how == 'all' else f'some from {x:,} on'}"
            for (x, how), phases in sorted(some.items())
        )
        for series, some in found.items()
    ]
    return f"Left out, as the seconds were over (see the table): {'; '.join(clauses)}." if clauses else None


def is_all(result: dict[str, Any], row: Row) -> bool:
    """Whether nothing of that series and program was measured beyond the row's x."""
    same = (r for r in result["rows"] if (r["series"], r["phase"]) == (row["series"], row["phase"]))
    return all(r["x"] < row["x"] for r in same)


def note(result: dict[str, Any]) -> str:
    cpu = machine.name(result.get("context"))
    return (
        f"{cpu}; median of {result['launches']} interleaved launches; n = {result['n']} where it is not what "
        "varies (twice that in threads; 720 in crowd). Dashed: least squares in log-log; "
        f"*: some point is over "
        f"{100 * (scaling_fit.OFF - 1):.0f} % off the law, beyond its launches' noise: the exponent is then "
        "a mean slope and no law. Dotted: the paper's law from the first program's first point on. Filled "
        "marks: error to ground truth; hollow: to the finest picture there is, which the table names."
    )
