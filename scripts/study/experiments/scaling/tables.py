"""The tables and the figure of how cost grows, made from scaling.json alone."""

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from study.core import registry, show
from study.core.show import Column
from study.experiments.scaling.schema import Crowd, Fit, Row, Scaling
from study.experiments.scaling.series import LAW
from study.experiments.section import Found, Part, part
from study.numbers import power_laws
from study.numbers.power_laws import Law
from study.pictures.draw import Drawing, legend, look, panels, plain_log

CLOSED = "none: closed forms count 1 for every camera ray"
TOP = 120  # dB: what is nearer is drawn here


def level(row: Row) -> float | None:
    """PSNR in dB to the row's reference, at most TOP; None without one."""
    if row.rmse is None:
        return None
    return TOP if row.psnr_db is None else min(row.psnr_db, TOP)


def evaluations(row: Row) -> float | None:
    """Those of a camera ray; none of a program with closed forms, where an older file has a 1 for each."""
    return None if registry.is_exact(row.phase) else row.evals_per_ray


def _evals(row: Fit) -> str:
    if registry.is_exact(row.phase):
        return CLOSED
    return power_laws.text(row.evals.exponent) if row.evals else show.NOTHING


def _worst(law: Law) -> str:
    return show.NOTHING if law.points < power_laws.LEAST else f"{law.worst:.2f}× at {law.worst_x:,g}"


def _both(name: str, form: str) -> Callable[[Crowd], str]:
    """Nothing where one scene of each was timed: the ratio is then of medians."""

    def text(row: Crowd) -> str:
        some = getattr(row, name) if max(row.scenes or [1]) > 1 else None
        return " and ".join(form.format(one) for one in some) if some else show.NOTHING

    return text


def _covered(row: Crowd) -> str:
    return " and ".join(f"{share:.3f}" for share in row.coverage or () if share) or show.NOTHING


EXPONENTS = [
    Column("", "against", lambda r: r.title),
    Column("", "program", lambda r: r.phase),
    Column("", "from … to (points)", lambda r: f"{r.time.first_x:,g} … {r.time.last_x:,g} ({r.time.points})"),
    Column("exponent of time", "fitted [95 %]", lambda r: power_laws.text(r.time.exponent)),
    Column("exponent of time", f"the paper's {LAW}", show.plain("paper")),
    Column("exponent of time", "first two points [95 %]", lambda r: power_laws.text(r.time.first)),
    Column("exponent of time", "last two points [95 %]", lambda r: power_laws.text(r.time.last)),
    Column("does a law fit?", "largest residual", lambda r: _worst(r.time)),
    Column("does a law fit?", "verdict", lambda r: r.verdict),
    Column("", "exponent of evaluations per ray", _evals),
]
CROWDS = [
    Column("", "program", lambda r: r.phase),
    Column("shapes", "scattered, against 16", lambda r: f"{r.shapes:,}" if r.shapes else show.NOTHING),
    Column("shapes", "n", lambda r: str(r.n or show.NOTHING)),
    Column("shapes", "scenes, 16 and many", _both("scenes", "{:,}")),
    Column("shapes", "mean ms, 16 and many", _both("mean_ms", "{:.3g}")),
    Column("shapes", "time over that of 16 [95 %]", show.spread_of("ratio", "×")),
    Column("shapes", "by medians [95 %]", show.spread_of("by_medians", "×")),
    Column("shapes", "share of pixels hit, 16 and many", _covered),
]
POINTS = [
    Column("", "series", lambda r: r.series),
    Column("", "x", lambda r: f"{r.x:,g}"),
    Column("", "program", lambda r: r.phase),
    Column("", "ms a frame [95 %]", show.spread_of("ms", digits=4)),
    Column("", "ns/pixel [95 %]", show.spread_of("ns_per_pixel", digits=4)),
    Column("", "evaluations per ray", lambda r: show.number(evaluations(r))),
    Column("", "share of pixels hit", show.plain("coverage")),
    Column("error", "reference", lambda r: r.reference or r.why_none or "too large to be kept"),
    Column("error", "PSNR, dB", lambda r: show.number(level(r))),
    Column("error", "wrong hit, ppm", show.plain("wrong_ppm")),
]
LEFT_OUT = [
    Column("", "series", lambda r: r.series + (f" ({r.scene})" if r.scene else "")),
    Column("", "x", lambda r: f"{r.x:,g}"),
    Column("", "program", lambda r: r.phase),
    Column("", "one frame, foreseen, s", show.plain("foreseen_s")),
    Column("", "why", lambda r: r.reason),
]


def parts(result: Scaling) -> list[Part]:
    return [
        *part("scaling", f"Exponents of the time of a frame beside {LAW}", result.fits, EXPONENTS),
        *part("scaling-crowds", "Many shapes", result.goals, CROWDS),
        *part("scaling-points", "Every point", result.rows, POINTS),
        *part("scaling-left-out", "Points left out", result.left_out, LEFT_OUT),
    ]


def found(result: Scaling) -> Found:
    return Found(parts(result), answer(result), drawings(result))


def answer(result: Scaling) -> str:
    """The fastest program's exponents of picture height and of shapes, beside the paper's law."""
    said = []
    for series in ("n-scene0", "shapes-scattered"):
        title = result.titles.get(series)
        fits = [one for one in result.fits if one.title == title]
        if fits:
            last = fits[-1]
            law = f" (the paper's law: {show.number(last.paper, 1)})" if last.paper is not None else ""
            exponent = power_laws.text(last.time.exponent)
            said.append(f"{last.phase}'s time grows with {title} to the power {exponent}{law}")
    return f"{'; '.join(said)}." if said else f"{len(result.rows)} points were timed; no series has a fit."


# --- the figure

PAPERS: dict[str, Any] = {"color": "#999999", "linestyle": (0, (1, 2)), "linewidth": 1.5, "zorder": 1}


def milliseconds(row: Row) -> float:
    return float(np.median(row.ns)) * 1e-6


def _grown(result: Scaling) -> Figure:
    """A panel per series, log-log: each program's points, fitted law (dashed); the paper's law (dotted)."""
    shown = _lines(result.rows)
    frame = pd.DataFrame(
        [{"scene": result.titles[row.series], "phase": row.phase, "threads": 1} for row in shown]
    )
    figure, grid = panels(frame, 3.1, 4.3)
    figure.suptitle("Time of a frame, log-log", x=0.01, ha="left", fontsize=12)
    looks = look(frame)
    for title, axes in grid.items():
        mine = [row for row in shown if result.titles[row.series] == title]
        axes.set(title=title, xscale="log", xlabel=result.axes[mine[0].series], ylabel="ms a frame")
        axes.set(yscale="log")
        axes.title.set_fontsize(10)
        for phase in dict.fromkeys(row.phase for row in mine):
            rows, style = [row for row in mine if row.phase == phase], looks[phase, 1]
            ys, colour = [milliseconds(row) for row in rows], style["color"]
            marks = {"marker": style["marker"], "markersize": 4.5, "color": colour}
            axes.plot([row.x for row in rows], ys, **marks, linewidth=0.8, label=phase, zorder=3)
            for law in [one.time for one in result.fits if (one.title, one.phase) == (title, phase)]:
                across = np.array([law.first_x, law.last_x])
                line = 1e-6 * (law.factor or 0) * across ** (law.exponent.value or 0)
                axes.plot(across, line, "--", color=colour, linewidth=1.4, alpha=0.75)
        papers = [fit.paper for fit in result.fits if fit.title == title and fit.paper is not None]
        if papers:
            xs = [row.x for row in mine]
            across = np.array([min(xs), max(xs)])
            start = next(milliseconds(row) for row in mine if row.x == across[0])
            bottom, top = axes.get_ylim()
            axes.plot(across, start * (across / across[0]) ** papers[0], **PAPERS, label=f"the paper's {LAW}")
            axes.set_ylim(bottom, max(top, 2 * max(map(milliseconds, mine))))
        low, high = axes.get_ylim()
        wide = max(1.0, math.sqrt(4.5 * low / high))  # at least 4.5 from end to end: a tenth is nothing
        axes.set_ylim(low / wide, high * wide)
        plain_log(axes.xaxis)
        plain_log(axes.yaxis)
    legend(figure, grid)
    return figure


def _lines(rows: Sequence[Row]) -> list[Row]:
    """Rows of the series of which some program has two: one point shows no growth."""
    found: dict[tuple[str, str], set[float]] = {}
    for row in rows:
        found.setdefault((row.series, row.phase), set()).add(row.x)
    several = {series for (series, _), across in found.items() if len(across) > 1}
    return [row for row in rows if row.series in several]


def drawings(result: Scaling) -> dict[str, Drawing]:
    caption = "Time of a frame against what it depends on, with fitted power laws"
    drawn = Drawing(caption, note(result), lambda: _grown(result))
    return {"scaling-time": drawn} if _lines(result.rows) else {}


def note(result: Scaling) -> str:
    return (
        f"{result.machine}; median of {result.launches} interleaved launches; n = {result.n} where it is not "
        "what varies (twice that in threads; 720 in crowd). Dashed: least squares in log-log; where some "
        f"point is over {100 * (power_laws.OFF - 1):.0f} % off it, beyond its launches' noise, the table "
        "says that no law holds. Dotted: the paper's law from the first program's first point on."
    )
