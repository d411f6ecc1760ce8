"""The tables and figures of the errors to ground truth, made from accuracy.json alone."""

import math
from collections.abc import Callable, Sequence
from functools import partial
from operator import attrgetter
from typing import Any

import pandas as pd
from matplotlib.figure import Figure

from study.core import show
from study.core.show import Column
from study.numbers.accuracy import Accuracy, Row
from study.pictures.draw import ON_PAPER, Drawing, legend, panels
from study.truth import where

MARK = "▼"  # worse than baseline
Text = Callable[[Row], str]


def _cell(name: str, text: Callable[[float], str] = show.number) -> Text:
    """The cell with a sign where baseline is nearer to ground truth: colour alone does not tell all."""

    def shown(row: Row) -> str:
        try:
            value = attrgetter(name)(row)
        except AttributeError:  # of what a row has not: antialiased.psnr_db
            value = math.nan
        return f"{text(value)} {MARK}" if name in row.worse else text(value)

    return shown


def _decibels(value: float) -> str:
    return "identical" if value == math.inf else show.number(value)


def _five(value: float) -> str:
    return show.number(value, 5)


def _column(group: str, head: str, name: str, text: Callable[[float], str] = show.number) -> Column:
    return Column(group, head, _cell(name, text), lambda row: "bad" if name in row.worse else "")


def _verdict(row: Row) -> str:
    if row.phase == "baseline":
        return "baseline"
    if not row.gated:
        return f"{MARK} further than baseline" if row.worse else "no further than baseline"
    if row.judged_by == "ideal":
        return "✗ FAR from the ideal picture" if row.failed else "✓ at the ideal picture"
    return "✗ FURTHER than baseline" if row.failed else "✓ no further than baseline"


def _proved(row: Row) -> str:
    return show.share(row.proved_fraction) + "; rest marched" * row.converged_only


SHADOWS = (("_none", "no shadow"), ("", "estimator"), ("_ideal", "ideal"))
SPACES = (("linear", ""), ("display", "_display"))
HEAD = [Column("", "scene", show.picture), Column("", "phase", lambda r: r.phase)]
ERRORS = [
    *HEAD,
    Column("", "precision", lambda r: r.precision),
    _column("hits, ppm", "false", "false_hits_ppm"),
    _column("hits, ppm", "missed", "false_misses_ppm"),
    _column("hits, ppm", "wrong shape", "wrong_shape_ppm"),
    _column("|Δt|", "p99", "dt_p99"),
    _column("|Δt|", "max", "dt_max"),
    _column("", "normal p99, °", "normal_p99_degrees"),
    Column("", "shadow RMSE", lambda r: show.number(r.shadow_ideal_rmse if r.to_ideal else r.shadow_rmse)),
    *(
        _column(f"PSNR dB, {space}", head, f"psnr{which}{infix}_db", _decibels)
        for space, infix in SPACES
        for which, head in SHADOWS
    ),
    Column("", "FLIP mean", _cell("flip_mean")),
    Column("", "pixels off > 1/255", lambda r: show.percent(r.fraction_over_1_255)),
    Column("", "rays proved", _proved),
    Column("", "against baseline", _verdict, lambda r: "bad" if r.failed else ""),
]
AVERAGED = [
    *HEAD,
    _column("", "depth agrees, share", "depth_agree_fraction", _five),
    *(
        _column(f"4×4 averaged PSNR dB, {space}", head, f"antialiased.psnr{which}{infix}_db", _decibels)
        for space, infix in SPACES
        for which, head in SHADOWS
    ),
]


SURFACE = [
    *HEAD,
    Column("", "rays proved", lambda r: show.share(r.surface.proved_fraction)),
    Column("", "hits proved", lambda r: f"{r.surface.proved_hits:,}"),
    _column("of all rays, ppm", "lost", "surface.lost_ppm"),
    _column("of all rays, ppm", "wrong", "surface.wrong_ppm"),
    _column("", "normal p50, °", "surface.normal_p50_degrees"),
    *(
        _column(f"PSNR dB, {of}", head, f"surface.{infix}psnr{which}_db", _decibels)
        for of, infix in (("4×4 means", "antialiased."), ("single samples", ""))
        for which, head in SHADOWS[1:]
    ),
    _column("PSNR dB, 4×4 means", "estimator, to the march", "antialiased.psnr_db", _decibels),
]


def _share(kind: str) -> Text:
    return lambda row: show.percent(getattr(row, f"bad_{kind}")) if row.bad_pixels else show.NOTHING


PLACES = [
    *HEAD,
    Column("", "bad pixels", lambda r: f"{r.bad_pixels:,}"),
    Column("", "of all", lambda r: show.percent(r.bad_pixels / (r.width * r.height))),
    *(Column("of these", name.replace("_", " "), _share(name)) for name in where.CLASSES),
]


FEET = {
    "accuracy": f"{MARK}: further from ground truth than baseline's picture by a digit that is shown, and by "
    "more than the phase grants itself.",
    "accuracy-surface": "Exact surface: where n iterations end at |z| = 1, hit by proof and coloured by the "
    "scene's own rules. Lost: the picture has the hit over 1e-3 behind, or none: its march went through the "
    "surface. Wrong: over 1e-3 before. Normal: the median angle to the exact one. To the march: to "
    "baseline's in exact arithmetic; that tells rounding alone.",
    "accuracy-where": "Bad: off by more than 1/255 in any channel (linear), or a wrong hit. Each bad pixel "
    f"counts once, in the first of: {'; '.join(where.MEANING[name] for name in where.CLASSES)}.",
}


def tables(result: Accuracy) -> list[tuple[str, str, list[Any], list[Column]]]:
    """Name, caption, rows and columns of every table that has rows."""
    rows = result.rows
    fractal = [row for row in rows if row.converged_only]
    averaged = "Fractals, to baseline's march in exact arithmetic: depth and averaged pictures"
    proved = [row for row in rows if row.surface]
    heights = " and ".join(map(str, sorted({row.height for row in rows})))
    ideal = ", ".join(dict.fromkeys(row.phase for row in rows if row.to_ideal))
    to = f" ({ideal}: pixels, FLIP and shadow to the ideal picture)" if ideal else ""
    made = [
        ("accuracy", f"Error to ground truth, at n = {heights}{to}", rows, ERRORS),
        ("accuracy-surface", f"Mandelbulbs, to the exact surface, at n = {heights}", proved, SURFACE),
        ("accuracy-averaged", averaged, fractal, AVERAGED),
        ("accuracy-where", f"Where the bad pixels lie{to}", rows, PLACES),
    ]
    return [one for one in made if one[2]]


def lines(result: Accuracy) -> list[str]:
    made = []
    for name, caption, rows, columns in tables(result):
        made += [caption, show.markdown(show.table(rows, columns)), *FEET.get(name, "").splitlines(), ""]
    return made


def places(rows: Sequence[Row]) -> Figure:
    """Bad pixels of each phase by where they lie, in ppm of the picture: a panel per scene."""
    frame = pd.DataFrame({"scene": [row.scene for row in rows]})
    made, grid = panels(frame, 0.8 + 0.32 * len({row.phase for row in rows}))
    made.suptitle("Pixels that are wrong, and where they lie", x=0.01, ha="left", fontsize=12)
    for scene, axes in grid.items():
        mine = [row for row in rows if row.scene == scene]
        names = [row.phase for row in mine]
        left = [0.0] * len(mine)
        for kind in where.CLASSES:
            ppm = [1e6 * r.bad_pixels * getattr(r, f"bad_{kind}") / (r.width * r.height) for r in mine]
            style = {"color": where.COLOURS[kind], "edgecolor": "black", "lw": 0.4}
            axes.barh(names, ppm, left=left, label=kind.replace("_", " "), **style)
            left = [a + b for a, b in zip(left, ppm, strict=True)]
        for place, total in enumerate(left):
            axes.text(total, place, f" {total:,.0f}", va="center", fontsize=8)
        size = f"{mine[0].width}×{mine[0].height}" + ", to a march" * mine[0].converged_only
        axes.set(title=f"{scene} ({size})", xlabel="bad pixels, ppm", xlim=(0, 1.18 * max(*left, 1.0)))
        axes.invert_yaxis()
        axes.locator_params(axis="x", nbins=1 if ON_PAPER.get() else 3)
        axes.xaxis.set_major_formatter(lambda value, _: f"{value:,.10g}")
    legend(made, grid)
    return made


def drawings(result: Accuracy) -> dict[str, Drawing]:
    heights = ", ".join(map(str, sorted({row.height for row in result.rows})))
    about = f"n = {heights}. A fractal's pixels are held against a march in double-double (104 bits)."
    caption = "Pixels that are wrong, and where they lie"
    return {"accuracy-where": Drawing(caption, about, partial(places, result.rows))} if result.rows else {}
