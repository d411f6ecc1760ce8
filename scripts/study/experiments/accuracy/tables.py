"""The tables and figures of the errors to ground truth, made from accuracy.json alone."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import pandas as pd
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from study.core import show
from study.core.show import Column, Row
from study.experiments.accuracy import converge
from study.pictures.draw import legend, look, panels
from study.pictures.hover import tell
from study.truth import where

MARK = "▼"  # worse than baseline


def _worse(*names: str):
    return lambda row: "bad" if set(names) & set(row["worse"]) else ""


def _marked(text: str, row: Row, name: str) -> str:
    """The cell with a sign where baseline is nearer to ground truth: colour alone does not tell all."""
    return f"{text} {MARK}" if name in row["worse"] else text


def _number(name: str, digits: int = 3):
    return lambda row: _marked(show.number(_value(row, name), digits), row, name)


def _value(row: Row, name: str) -> Any:
    for key in name.split("."):
        row = row.get(key, math.nan) if isinstance(row, dict) else math.nan
    return row


def _decibels(name: str):
    def text(row: Row) -> str:
        value = _value(row, name)
        return _marked("identical" if value == math.inf else show.number(value), row, name)

    return text


def _column(group: str, head: str, name: str, text=_number) -> Column:
    return Column(group, head, text(name), _worse(name))


def _verdict(row: Row) -> str:
    if row["phase"] == "baseline":
        return "baseline"
    if not row["gated"]:
        return f"{MARK} further than baseline" if row["worse"] else "no further than baseline"
    if row.get("judged_by") == "ideal":
        return "✗ FAR from the ideal picture" if row["failed"] else "✓ at the ideal picture"
    return "✗ FURTHER than baseline" if row["failed"] else "✓ no further than baseline"


def _proved(row: Row) -> str:
    text = show.share(row["proved_fraction"])
    return f"{text}; rest converged only" if row["converged_only"] else text


HEAD = [Column("", "scene", show.picture), Column("", "phase", lambda r: r["phase"])]
ERRORS = [
    *HEAD,
    Column("", "precision", lambda r: r["precision"]),
    _column("hits, ppm", "false", "false_hits_ppm"),
    _column("hits, ppm", "missed", "false_misses_ppm"),
    _column("hits, ppm", "wrong shape", "wrong_shape_ppm"),
    _column("|Δt|", "p99", "dt_p99"),
    _column("|Δt|", "max", "dt_max"),
    _column("", "normal p99, °", "normal_p99_degrees"),
    _column("", "shadow RMSE", "shadow_rmse"),
    _column("PSNR dB, linear", "no shadow", "psnr_none_db", _decibels),
    _column("PSNR dB, linear", "estimator", "psnr_db", _decibels),
    _column("PSNR dB, linear", "ideal", "psnr_ideal_db", _decibels),
    _column("PSNR dB, display", "no shadow", "psnr_none_display_db", _decibels),
    _column("PSNR dB, display", "estimator", "psnr_display_db", _decibels),
    _column("PSNR dB, display", "ideal", "psnr_ideal_display_db", _decibels),
    Column("", "FLIP mean", _number("flip_mean")),
    Column("", "pixels off > 1/255", lambda r: show.percent(r["fraction_over_1_255"])),
    Column("", "rays proved", _proved),
    Column("", "against baseline", _verdict, lambda r: "bad" if r["failed"] else ""),
]
AVERAGED = [
    *HEAD,
    _column("", "depth agrees, share", "depth_agree_fraction", lambda name: _number(name, 5)),
    *(
        _column(f"4×4 averaged PSNR dB, {space}", head, f"antialiased.psnr{which}{infix}_db", _decibels)
        for space, infix in (("linear", ""), ("display", "_display"))
        for which, head in (("_none", "no shadow"), ("", "estimator"), ("_ideal", "ideal"))
    ),
]


def _share(name: str):
    return lambda row: show.NOTHING if not row["bad_pixels"] else show.percent(row[f"bad_{name}"])


PLACES = [
    *HEAD,
    Column("", "bad pixels", lambda r: f"{r['bad_pixels']:,}"),
    Column("", "of all", lambda r: show.percent(r["bad_pixels"] / (r["width"] * r["height"]))),
    *(Column("of these", name.replace("_", " "), _share(name)) for name in where.CLASSES),
]


def _against(other: str, name: str):
    def text(row: Row) -> str:
        value = _value(row, f"{other}.{name}")
        if value == math.inf:
            return "identical"
        return show.number(value, 5 if name.startswith("depth") else 3)

    return text


CONVERGENCE = [
    Column("", "hit distance", lambda r: f"{r['hit_distance']:g}"),
    Column("", "precision", lambda r: converge.WORDS.get(r["precision"], r["precision"])),
    Column("", "phase", lambda r: r["phase"]),
    Column("", "evaluations per ray", lambda r: show.number(r["evals_per_ray"])),
    *(
        Column(f"against {about}", head, _against(other, name))
        for other, about in (
            ("quad", "double-double, same hit distance"),
            ("double", "double, same hit distance"),
            ("finest", "double-double, least hit distance"),
        )
        for head, name in (
            ("depth agrees, share", "depth_agree_fraction"),
            ("|Δt| p99", "dt_p99"),
            ("4×4 averaged, dB", "psnr_db"),
        )
    ),
]
WORSE = (
    f"{MARK}: further from ground truth than baseline's picture by a digit that is shown, and by more than "
    "the phase grants itself."
)
BAD = (
    "Bad: off by more than 1/255 in any channel (linear), or a wrong hit. Each bad pixel counts once, in the "
    f"first of: {'; '.join(where.MEANING[name] for name in where.CLASSES)}."
)
CONVERGED = (
    "Ground truth is double-double here (104 bits). Its plane is hit exactly and has its own normal: against "
    "it that is compared too, float against double is arithmetic alone.\n"
    "A hit distance no less than the scene's surface offset ends shadow rays where they start."
)
FEET = {"accuracy": WORSE, "accuracy-where": BAD, "accuracy-convergence": CONVERGED}


def tables(result: dict[str, Any]) -> list[tuple[str, str, list[Row], list[Column]]]:
    """Name, caption, rows and columns of every table that has rows."""
    rows = result["rows"]
    fractal = [row for row in rows if row["converged_only"]]
    converged = (result.get("convergence") or {}).get("rows", [])
    heights = " and ".join(map(str, sorted({row["height"] for row in rows})))
    made = [
        ("accuracy", f"Error to ground truth, at n = {heights}", rows, ERRORS),
        (
            "accuracy-averaged",
            "Where ground truth is converged only: depth and averaged pictures",
            fractal,
            AVERAGED,
        ),
        ("accuracy-where", "Where the bad pixels lie", rows, PLACES),
        ("accuracy-convergence", "The Mandelbulb by precision and hit distance", converged, CONVERGENCE),
    ]
    return [one for one in made if one[2]]


def _spread(groups: Sequence[str], widths: Sequence[int]) -> str:
    """The line above the heads: each group's name where its columns begin."""
    line, place = "", 0
    for group, width in zip(groups, widths, strict=True):
        if group:
            line = f"{line.ljust(place)}{group} "
        place += width + 2
    return line.rstrip()


def text(result: dict[str, Any]) -> str:
    """The tables for a terminal."""
    parts = []
    for _, caption, rows, columns in tables(result):
        table = show.table(rows, columns)
        before = [None, *table.columns]
        groups = [
            c.group if b is None or b.group != c.group else ""
            for b, c in zip(before, table.columns, strict=False)
        ]
        lines = [[c.name for c in table.columns], *([cell for cell, _ in row] for row in table.cells)]
        widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
        parts.append(caption)
        parts.append(_spread(groups, widths))
        parts += ["  ".join(c.ljust(w) for c, w in zip(line, widths, strict=True)).rstrip() for line in lines]
        parts.append("")
    return "\n".join([*parts, *(FEET[name] for name, *_ in tables(result) if name in FEET)])


def places(rows: Sequence[Row]) -> Figure:
    """Bad pixels of each phase by where they lie, in ppm of the picture: a panel per scene."""
    made, grid = panels(pd.DataFrame(rows), 0.8 + 0.32 * len({row["phase"] for row in rows}))
    made.suptitle("Pixels that are wrong, and where they lie", x=0.01, ha="left", fontsize=12)
    for scene, axes in grid.items():
        mine = [row for row in rows if row["scene"] == scene]
        names = [row["phase"] for row in mine]
        left = [0.0] * len(mine)
        for kind in where.CLASSES:
            ppm = [1e6 * r["bad_pixels"] * r[f"bad_{kind}"] / (r["width"] * r["height"]) for r in mine]
            label = kind.replace("_", " ")
            colour = where.COLOURS[kind]
            drawn = axes.barh(names, ppm, left=left, color=colour, edgecolor="black", lw=0.4, label=label)
            said = zip(names, ppm, strict=True)
            tell(drawn, [f"{name}, {scene}: {show.number(one)} ppm bad, {label}" for name, one in said])
            left = [a + b for a, b in zip(left, ppm, strict=True)]
        for place, total in enumerate(left):
            axes.text(total, place, f" {total:,.0f}", va="center", fontsize=8)
        size = f"{mine[0]['width']}×{mine[0]['height']}"
        only = ", converged only" if mine[0]["converged_only"] else ""
        axes.set(title=f"{scene} ({size}{only})", xlabel="bad pixels, ppm", xlim=(0, 1.18 * max(*left, 1.0)))
        axes.invert_yaxis()
        axes.xaxis.set_major_formatter(lambda value, _: f"{value:,.10g}")
    legend(made, grid)
    return made


LINES = {
    "quad": ("-", "to double-double"),
    "double": ("--", "to double"),
    "finest": (":", "to double-double, least hit distance"),
}


def convergence(table: dict[str, Any]) -> Figure:
    """Depth against ground truth's arithmetic, averaged pictures against double and the finest march."""
    made = Figure(figsize=(11, 4.6), layout="constrained")
    names = list(dict.fromkeys(row["precision"] for row in table["rows"]))
    looks = look(pd.DataFrame({"phase": names, "threads": 1}))
    lines: dict[str, Line2D] = {}
    for axes, metric, others, title in (
        (made.add_subplot(1, 2, 1), "dt_p99", ("quad", "finest"), "99 % of the depths agree within"),
        (made.add_subplot(1, 2, 2), "psnr_db", ("double", "finest"), "4×4 averaged pictures agree to, dB"),
    ):
        for size, name in zip((11, 8, 5), names, strict=False):  # those below stay seen
            style = {key: looks[name, 1][key] for key in ("color", "marker")}
            for other in others:
                mine = [r for r in table["rows"] if r["precision"] == name and other in r]
                if not mine:
                    continue
                label = f"{converge.WORDS.get(name, name)} {LINES[other][1]}"
                (lines[label],) = drawn = axes.plot(
                    [r["hit_distance"] for r in mine],
                    [r[other][metric] for r in mine],
                    LINES[other][0],
                    markersize=size,
                    mfc="none",
                    label=label,
                    **style,
                )
                unit = " dB" if metric == "psnr_db" else ""
                said = [(f"{r['hit_distance']:g}", show.number(r[other][metric])) for r in mine]
                tell(drawn, [f"{label}, hit distance {hit}: {value}{unit}" for hit, value in said])
        axes.set(xscale="log", xlabel="hit distance", title=title)
        if metric == "dt_p99":
            axes.set(yscale="log")
    size = f"{table['width']}×{table['height']}"
    made.suptitle(f"{table['scene']}, {size}: what arithmetic and hit distance cost", x=0.01, ha="left")
    made.legend(handles=lines.values(), loc="outside right upper", frameon=False, fontsize=9)
    return made


def drawings(result: dict[str, Any]) -> dict[str, Callable[[], Figure]]:
    """Name → what draws the figure, of what there is."""
    made = {"accuracy-where": partial(places, result["rows"])} if result["rows"] else {}
    if (result.get("convergence") or {}).get("rows"):
        made["accuracy-convergence"] = partial(convergence, result["convergence"])
    return made


def note(result: dict[str, Any]) -> str:
    """What stands under the figures."""
    heights = sorted({row["height"] for row in result["rows"]})
    return (
        f"n = {', '.join(map(str, heights))}. A fractal's ground truth is converged only, in "
        "double-double (104 bits)."
    )
