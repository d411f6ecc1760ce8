"""Figures of a sweep: speed-up ladder, runtime and time per pixel against n, speed against error."""

import math
from collections.abc import Callable
from functools import partial

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import NullLocator

from study.core import machine, registry, show
from study.numbers import ladder
from study.numbers.analysis import Data
from study.pictures.draw import BAD, RING, Drawing, bars_of, legend, look, panels, plain_log

LEFT = 0.8  # of a logarithmic axis
SAME = 150  # dB; a difference below is less than what float holds of a colour near 1


def caption(data: Data, rows: pd.DataFrame) -> str:
    """Machine, compiler and flags of every phase, and what the points are."""
    context = data.context
    flags: dict[str, list[str]] = {}
    for spec, text in dict.fromkeys(zip(rows.phase, rows["flags"], strict=True)):
        flags.setdefault(registry.short(text), []).append(spec)
    built = "; ".join(f"{', '.join(specs)}: {text}" for text, specs in flags.items())
    launches = " to ".join(str(n) for n in dict.fromkeys((rows.launches.min(), rows.launches.max())))
    cpu = machine.name(context)
    compiler = context.compiler or rows.compiler.iloc[0]
    clock = f"core {rows.core_hz.median() / 1e9:.2f} GHz, timer {rows.tsc_hz.median() / 1e9:.3f} GHz"
    return (
        f"{cpu}, {clock}; {compiler}. Median over {launches} process launches; whiskers: 95 % "
        f"interval (none where launches are fewer than 3).\n{built}"
    )


def against_n(rows: pd.DataFrame, name: str, unit: str, title: str) -> Figure:
    """One panel per scene, log-log, a line per phase; `name`: column with _low and _high."""
    figure, grid = panels(rows, 3.6)
    figure.suptitle(title, x=0.01, ha="left", fontsize=12)
    looks = look(rows)
    for scene, axes in grid.items():
        for key, group in rows[rows.scene == scene].groupby(["phase", "threads"], sort=False):
            style, group = looks[key], group.sort_values("height")
            axes.errorbar(
                group.height,
                group[name],
                yerr=bars_of(group, name),
                capsize=3,
                markersize=6 if group.height.nunique() <= 10 else 4,
                **{key: style[key] for key in ("color", "marker", "markerfacecolor", "linestyle", "label")},
            )
        axes.set(title=scene, xscale="log", yscale="log", xlabel="n: picture height, pixels", ylabel=unit)
        heights = sorted(rows[rows.scene == scene].height.unique())
        axes.set_xlim(heights[0] / 1.2, heights[-1] * 1.2)
        if len(heights) <= 6:
            axes.set_xticks(heights, map(str, heights))
        else:
            plain_log(axes.xaxis)
        axes.xaxis.set_minor_locator(NullLocator())
        plain_log(axes.yaxis)
    legend(figure, grid)
    return figure


def runtime(rows: pd.DataFrame) -> Figure:
    seconds = rows.assign(**{f"s{end}": rows[f"ms{end}"] / 1e3 for end in ("", "_low", "_high")})
    return against_n(seconds, "s", "runtime of a frame, s", "Runtime against picture height")


def speedups(rows: pd.DataFrame) -> Figure:
    """Points over baseline at each scene's headline size, the paper's values beside them, and its errors."""
    rows = rows[rows.headline & rows.speedup.notna()]
    figure, grid = panels(rows, 0.5 * rows.groupby("scene").size().max() + 1.0, 6.2, 2)
    figure.suptitle("Speed-up over baseline in one interleaved run, and its error", x=0.01, ha="left")
    figure.get_layout_engine().set(rect=(0, 0, 0.975, 1), wspace=0.04)  # room right of the last column
    looks = look(rows)
    for scene, axes in grid.items():
        group = rows[rows.scene == scene].reset_index(drop=True)
        styles = [looks[key] for key in zip(group.phase, group.threads, strict=True)]
        ends = bars_of(group, "speedup")
        for (i, row), style in zip(group.iterrows(), styles, strict=True):
            axes.plot([LEFT, row.speedup], [i, i], ":", color="#999999", linewidth=1, zorder=1)
            axes.errorbar(
                row.speedup,
                i,
                xerr=ends[:, [i]],
                capsize=3,
                markersize=8,
                **{key: style[key] for key in ("color", "marker", "markerfacecolor")},
            )
            beside = {"transform": axes.get_yaxis_transform(), "va": "center", "fontsize": 9}
            axes.text(1.17, i, f"{show.number(row['speedup'])}×", **beside, ha="right")
            colour = BAD if show.gate_mark(row) == "bad" else "#222222"
            axes.text(1.21, i, error_text(row), **beside, color=colour)
            axes.text(1.49, i, truth_text(row), **beside)
        paper_marks(axes, group)
        axes.set_yticks(range(len(group)), [style["label"] for style in styles])
        axes.set(xscale="log", xlim=(LEFT, None), ylim=(len(group) - 0.4, -0.6))
        axes.set_xlabel("speed-up over baseline (logarithmic), ×")
        plain_log(axes.xaxis)
        axes.set_title(f"{scene}, {group['width'][0]}×{group['height'][0]}", loc="left")
        heads = {"transform": axes.transAxes, "fontsize": 8, "va": "bottom", "color": "#444444"}
        axes.text(1.21, 1.0, "PSNR to\nbaseline", **heads)
        axes.text(1.49, 1.0, "to ground\ntruth", **heads)
        axes.grid(False, axis="y")
        if group.implied.notna().any():
            axes.legend(loc="upper right", fontsize=8, title="the paper, over its baseline", title_fontsize=8)
    return figure


def paper_marks(axes: Axes, group: pd.DataFrame) -> None:
    """The paper's own speed-ups above and below the point, outlined so that they show on it."""
    for name, marker, size, face, shift, label in (
        ("implied", "D", 30, "black", -0.2, "by its tables"),
        ("stated", "*", 90, "black", -0.2, "by its text"),
        ("rerun", "o", 30, "white", 0.2, "its program, run again"),
    ):
        there = group[group[name].notna() & (group.phase != ladder.BASE)]
        at = there[name], there.index + shift
        axes.scatter(*at, marker=marker, s=size + 40, color="white", zorder=3)
        style = {"marker": marker, "s": size, "color": face, "edgecolor": "black", "zorder": 4}
        axes.scatter(*at, **style, label=label if len(there) else None)


def truth_text(row: pd.Series) -> str:
    """PSNR to ground truth, a fractal's of 4×4 means (“march” where its exact surface is not held beside),
    "ideal" with the ideal shadow; – if not measured."""
    found = row.get("truth_own_db")
    if found is None or pd.isna(found):
        return show.NOTHING
    of = ["4×4"] * show.yes(row.get("truth_converged_only"))
    of += ["march"] * (bool(of) and pd.isna(row.get("truth_surface_db", math.nan)))
    of += ["ideal"] * show.yes(row.get("truth_draws_ideal"))
    return f"{show.number(found)} dB{' (' * bool(of)}{', '.join(of)}{')' * bool(of)}"


def error_text(row: pd.Series) -> str:
    """The error beside a speed: PSNR to baseline (– if not measured), and whether it is too much."""
    text = show.psnr(row, "psnr_db")
    if text not in (show.NOTHING, "reference", "identical"):
        text += " dB"
    return text + (", OUTSIDE" if show.gate_mark(row) == "bad" else "")


def error(rows: pd.DataFrame) -> Figure:
    """Each phase a point: ns/pixel against PSNR to baseline, in each space. Those from SAME up on a rail."""
    rows = rows[rows.headline & (rows.psnr_db.notna() | (rows.phase == ladder.BASE))]
    figure, grid = panels(rows, 3.8)
    title = (
        "Speed against error: down is faster, right is nearer to baseline's picture\n"
        "marker: linear RGB;  |: display;  +: linear, 4×4 averaged (fractals)"
    )
    figure.suptitle(title, x=0.01, ha="left", fontsize=11)
    looks = look(rows)
    spaces = ["psnr_db", "psnr_display_db", "antialiased_psnr_db"]
    finite = rows[spaces].to_numpy(float)
    finite = finite[finite < SAME]
    left, top = (finite.min() - 8, finite.max()) if finite.size else (40, 60)
    rail = top + 0.18 * (top - left) + 4
    for scene, axes in grid.items():
        for _, row in rows[rows.scene == scene].iterrows():
            style, pace = looks[row.phase, row.threads], row.ns_per_pixel
            places = row[spaces].to_numpy(float)
            places = [rail] * 3 if row.phase == ladder.BASE else np.where(places >= SAME, rail, places)
            low, high = (np.nan_to_num(abs(row[f"ns_per_pixel_{end}"] - pace)) for end in ("low", "high"))
            axes.plot(places, [pace] * 3, color=style["color"], linewidth=1)
            axes.plot(places[1], pace, "|", color=style["color"], markersize=10)
            axes.plot(places[2], pace, "+", color=style["color"], markersize=10)
            axes.errorbar(
                places[0],
                pace,
                yerr=[[low], [high]],
                capsize=3,
                markersize=8,
                linestyle="none",
                **{key: style[key] for key in ("color", "marker", "markerfacecolor", "label")},
            )
            if show.gate_mark(row) == "bad":
                axes.plot(places[0], pace, **RING)
        axes.axvline((top + rail) / 2, color="#999999", linewidth=0.8, linestyle=(0, (4, 3)))
        step = 10 if top - left < 80 else 20
        ticks = range(step * math.ceil(left / step), int(top) + 1, step)
        axes.set_xticks([*ticks, rail], [*map(str, ticks), f"> {SAME} or\nidentical"])
        axes.set(title=scene, yscale="log", xlim=(left, rail + 0.09 * (rail - left)))
        axes.set(xlabel="PSNR to baseline, dB", ylabel="ns per pixel")
        axes.margins(y=0.12)
        plain_log(axes.yaxis)
    failing = (rows.within_tolerance == False).any()  # noqa: E712 (None: not verified)
    legend(figure, grid, (Line2D([], [], **RING, label="outside its tolerance"),) if failing else ())
    return figure


FLAT = "Core cycles per pixel against picture height: flat where the work per pixel is the same"
PLOTS: dict[str, Callable[[pd.DataFrame], Figure]] = {
    "speedup-ladder": speedups,
    "runtime": runtime,
    "cycles-per-pixel": partial(
        against_n, name="core_cycles_per_pixel", unit="core cycles per pixel", title=FLAT
    ),
    "ns-per-pixel": partial(
        against_n, name="ns_per_pixel", unit="ns per pixel", title="Time per pixel against picture height"
    ),
    "speed-against-error": error,
}
CAPTIONS = {
    "speedup-ladder": "Speed-up over baseline, the paper's own values as marks, the error beside each",
    "runtime": "Runtime of a frame against picture height n, one line per phase (the paper's Fig. 7 in form)",
    "cycles-per-pixel": "Core cycles per pixel against picture height n",
    "ns-per-pixel": "Nanoseconds per pixel against picture height n",
    "speed-against-error": "Nanoseconds per pixel against PSNR to baseline: how much of the picture changed",
}


def drawings(data: Data, rows: pd.DataFrame) -> dict[str, Drawing]:
    """Each plot that the run has data for."""
    note, needed = caption(data, rows), {"speed-against-error": rows.psnr_db, "speedup-ladder": rows.speedup}
    there = [name for name in PLOTS if name not in needed or needed[name].notna().any()]
    return {name: Drawing(CAPTIONS[name], note, partial(PLOTS[name], rows)) for name in there}
