"""The chapter of speed against error to ground truth: tables, figures, a chart that answers the mouse."""

import math
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator

from study.core import cli, machine, registry, show
from study.core.show import Column
from study.experiments.pareto import fronts
from study.experiments.pareto.schema import FILE, TRUTHS, Pareto, Row, Winner
from study.experiments.section import Found, chapters, part
from study.numbers import paper
from study.pictures import charts, draw
from study.pictures.draw import Drawing, legend, look, panels, plain_log

TOP = 120  # dB: what is nearer is drawn here; floats of a colour near 1 hold no more than 150
PAPER = {"marker": "*", "s": 170, "color": "#d62728", "edgecolor": "black", "zorder": 6}
# Names of the files and captions; the first is the headline.
FIGURES = {
    "psnr_db": ("pareto", "Speed against error to ground truth; the front is the line"),
    "psnr_ideal_db": ("pareto-ideal", "The same with the ideal shadow"),
    "false_ppm": ("pareto-hits", "Speed against false hits and misses"),
    "dt_p99": ("pareto-distance", "Speed against |Δt|"),
}
FIRST = next(iter(FIGURES))


def paper_point(scene: str, rows: Sequence[Row]) -> tuple[float, float] | None:
    """(ns/pixel, dB) of the paper's opt4: baseline's time here over its program's speed-up, run again. Its
    error is against its own baseline at n = 720, of linear values as the axis."""
    base = [r for r in rows if r.phase == registry.BASE and r.own_parameters]
    theirs = paper.ladder().set_index(["scene", "phase"])
    if not base or (scene, "opt4") not in theirs.index:
        return None
    row = theirs.loc[(scene, "opt4")]
    return base[0].pace / row.rerun, row.rerun_psnr_db


def drawn_at(row: Row, measure: str) -> float:
    """Where a row is drawn: decibels no higher than TOP, other errors as they are."""
    bad = row.badness(measure)
    return min(-bad, TOP) if measure in TRUTHS else bad


def _scatter(axes: Axes, rows: Sequence[Row], measure: str, **style: Any) -> None:
    axes.scatter([r.pace for r in rows], [drawn_at(r, measure) for r in rows], **style)


def _points(axes: Axes, rows: Sequence[Row], measure: str, name: str, style: dict[str, Any]) -> None:
    """One program's: its mark with the scene's own parameters, dots of its colour with others. Dots are faint
    where launched once. A mark that is hollow has a word beside it: which root."""
    hollow = "+" in name
    once = [r for r in rows if not r.timed]
    full = [r for r in rows if r.timed and not r.own_parameters]
    mine = [r for r in rows if r.timed and r.own_parameters]
    colour, marker = style["color"], style["marker"]
    dot = {"marker": "o", "s": 12, "linewidth": 0.0, "color": colour}
    _scatter(axes, once, measure, alpha=0.25, zorder=2, **dot)
    _scatter(axes, full, measure, alpha=0.9, zorder=4, **dot)
    faces = ("white", colour) if hollow else (colour, "black")
    mark = {"marker": marker, "facecolor": faces[0], "edgecolor": faces[1]}
    base, _, word = name.partition("+")
    # Two switches of a phase have one mark, and one line of the legend: a word beside each.
    label = f"{base} with an approximated root" if hollow else name
    _scatter(axes, mine, measure, s=75, linewidth=1.2, zorder=5, label=label, **mark)
    for row in mine if hollow and measure == FIRST else ():
        draw.label(axes, row.pace, drawn_at(row, measure), word, colour, 7)


def _by_ideal(axes: Axes, rows: Sequence[Row], looks: dict) -> None:
    """A second, hollow mark of a phase that draws the ideal shadow: its error to that picture."""
    able = {name for name, phase in registry.phases().items() if phase.draws_ideal}
    for row in rows:
        at = drawn_at(row, "psnr_ideal_db")
        if not row.own_parameters or row.phase.partition("+")[0] not in able or math.isnan(at):
            continue
        style = looks[row.phase, 1]
        mark = {"marker": style["marker"], "facecolor": "white", "edgecolor": style["color"]}
        _scatter(axes, [row], "psnr_ideal_db", s=75, linewidth=1.2, zorder=5, **mark)
        draw.label(axes, row.pace, at, "ideal", style["color"], 7)


def _vertical(axes: Axes, measure: str, rows: Sequence[Row]) -> None:
    """Up is nearer: an error that is better when smaller goes down the axis; zeros have a place."""
    if measure in TRUTHS:
        axes.yaxis.set_major_locator(FixedLocator(range(0, TOP + 1, 20)))
        axes.set_ylim(0, TOP + 6)
        return
    least = min((drawn_at(r, measure) for r in rows if drawn_at(r, measure) > 0), default=1.0)
    decade = 10.0 ** math.floor(math.log10(least))  # from here down to 0 the axis is linear
    axes.set_yscale("symlog", linthresh=decade)
    axes.set_ylim(2 * max([decade, *(drawn_at(r, measure) for r in rows)]), -decade / 2)


def _panel(axes: Axes, scene: str, rows: Sequence[Row], measure: str, looks: dict) -> None:
    names = list(dict.fromkeys(r.phase for r in rows))
    for name in names:
        points = [r for r in rows if r.phase == name]
        _points(axes, points, measure, name, looks[name.partition("+")[0], 1])
    line = fronts.front(rows, measure)
    style = {"color": "#555555", "linewidth": 1.2, "drawstyle": "steps-post", "zorder": 3}
    label = "front: nothing is both faster and nearer"
    axes.plot([r.pace for r in line], [drawn_at(r, measure) for r in line], label=label, **style)
    if measure == FIRST:
        if there := paper_point(scene, rows):
            axes.scatter(*there, **PAPER, label="the paper's opt4, to its own baseline")
        _by_ideal(axes, rows, looks)
    fractal = any(r.converged_only for r in rows)
    axes.set_title(f"{scene} (4×4 means)" if fractal else scene)
    axes.set(xscale="log", xlabel="time, ns per pixel", ylabel=", ".join(fronts.MEASURES[measure]))
    plain_log(axes.xaxis)
    _vertical(axes, measure, rows)


def figure(rows: Sequence[Row], measure: str = FIRST) -> Figure:
    """A panel per scene, all of one scale: ns per pixel against an error to ground truth. Marks: the scene's
    own parameters; dots: others."""
    frame = pd.DataFrame([{"scene": r.scene, "phase": r.phase, "threads": 1} for r in rows])
    # A switch looks like its phase, drawn hollow: the shape says which phase it is of.
    looks = look(frame.assign(phase=frame.phase.str.partition("+")[0]))
    made, grid = panels(frame, 4.4, 5.4)
    title = "Speed against error: left is faster, up is nearer to the ground truth"
    if len(grid) == 1:  # it would go on into the legend beside it
        title = textwrap.fill(title, 60)
    made.suptitle(title, x=0.01, ha="left", fontsize=12)
    paces = [r.pace for r in rows if r.pace > 0]
    for scene, axes in grid.items():
        mine = [r for r in rows if r.scene == scene and not math.isnan(r.badness(measure))]
        if measure in TRUTHS:
            mine = [r for r in mine if drawn_at(r, measure) > 0]
        _panel(axes, scene, mine, measure, looks)
        axes.set_xlim(min(paces) / 1.5, max(paces) * 1.5)
    dots = {"marker": "o", "markersize": 4, "color": "#555555", "linestyle": "none"}
    kinds = {"a phase by other hit distances, step caps": 0.9, "the same, timed by one launch only": 0.25}
    legend(made, grid, tuple(Line2D([], [], label=text, alpha=one, **dots) for text, one in kinds.items()))
    return made


ABOUT = {  # of one figure alone
    "psnr_db": "A phase that draws the ideal shadow has a second, hollow mark: its PSNR with that shadow. "
    "Levels over 50 dB depend on single pixels at edges, and so on n (scene0, opt4: 105 dB at n = 90, 54.5 "
    "at n = 180). The star is the paper's program: baseline's time here over its speed-up, its PSNR to its "
    "own baseline at n = 720.",
    "dt_p99": "|Δt| is over the pixels that both pictures hit: a small step cap, which loses the hardest of "
    "them as false misses, looks near by it.",
}


def note(result: Pareto, measure: str = FIRST) -> str:
    left = ", ".join(result.unfinished)
    left = f"The run ended before {left}. " if left else ""
    named = ", named beside it" if measure == FIRST else ""
    return (
        f"{machine.name(cli.plain(result.context))}; n = {result.n}; medians of {result.launches} launches "
        "in turn, on one thread, also of phases that could use more. Marks: a phase with the scene's own "
        f"parameters. Dots: with other hit distances and step caps. Hollow: with an approximated root{named}."
        f" {fronts.left_out(result.rows)} {left}"
        "A fractal's figures are to a march in exact arithmetic, of 4×4 means "
        f"at n = {result.antialias_n or result.n}. {ABOUT.get(measure, '')}"
    ).strip()


def _decibels(row: Row, name: str) -> str:
    value = getattr(row, name)
    if row.non_finite and not math.isfinite(value):
        return "not finite"
    return "∞" if value == math.inf else show.number(value)


_ns = show.spread_of("ns_per_pixel", digits=4)


def _timed(row: Row) -> str:
    """How often a point was launched, and where once only, what beats it by the first of its measures."""
    if row.beaten_by is None:
        return f"{row.ns_per_pixel.launches} launches"
    by = next(iter(row.beaten_by.values()), None)
    return f"once: beaten by {by}" if by else "once: no figure to stand on a front with"


@dataclass(frozen=True)
class Place:
    scene: str
    truth: str
    levels: dict[float, Winner]


def _level(level: int) -> Column:
    def text(place: Place) -> str:
        winner = place.levels[level]
        if not winner.best:
            return "none"
        near = [name for name in winner.not_told_apart_from if "by other parameters" not in name]
        others = f"; or {', '.join(near)}" if near else ""
        return f"{winner.best.phase} {_ns(winner.best)}{others}"

    return Column("fastest of at least this PSNR, ns/pixel", f"{level} dB [95 %]", text)


def by_level(winners: Sequence[Winner]) -> list[Place]:
    found: dict[tuple[str, str], dict[float, Winner]] = {}
    for winner in winners:
        found.setdefault((winner.scene, TRUTHS[winner.metric]), {})[winner.level_db] = winner
    return [Place(*place, levels) for place, levels in found.items()]


LEVELS = [
    Column("", "scene", lambda r: r.scene),
    Column("", "against", lambda r: r.truth),
    *map(_level, fronts.LEVELS),
]


def _of_camera_rays(row: Row) -> str:
    """None of a program with closed forms: the 1 for each of its camera rays is no count."""
    return show.NOTHING if registry.is_exact(row.phase) else show.number(row.evals_per_ray)


def _counted(row: Row, value: float) -> str:
    """An older file has none of a Mandelbulb's own estimates: 0.1 a pixel beside 85 steps of a camera ray."""
    return show.number(value) if 10 * row.evals_per_pixel >= row.evals_per_ray else show.NOTHING


def _of_evaluations(row: Row) -> str:
    """Time per evaluation; none of a program with closed forms: evaluations are not all of its work."""
    return show.NOTHING if registry.is_exact(row.phase) else _counted(row, row.ns_per_eval)


POINTS = [
    Column("", "scene", lambda r: r.scene),
    Column("", "program", lambda r: r.phase),
    Column("", "hit distance", lambda r: f"{r.hit_distance:g}"),
    Column("", "step cap", lambda r: str(r.max_steps)),
    Column("", "ns/pixel [95 %]", _ns),
    Column("work", "evaluations per camera ray", _of_camera_rays),
    Column("work", "per pixel, all rays and normals", lambda r: _counted(r, r.evals_per_pixel)),
    Column("work", "ns per evaluation", _of_evaluations),
    Column("error to ground truth", "false hits, ppm", show.plain("false_hits_ppm")),
    Column("error to ground truth", "false misses, ppm", show.plain("false_misses_ppm")),
    Column("error to ground truth", "|Δt| p99", show.plain("dt_p99")),
    Column("error to ground truth", "PSNR dB, estimator", lambda r: _decibels(r, "psnr_db")),
    Column("error to ground truth", "PSNR dB, ideal", lambda r: _decibels(r, "psnr_ideal_db")),
    Column("error to ground truth", "exact surface", lambda r: _decibels(r, "surface_db")),
    Column("", "timed", _timed),
]


def _nearness(row: Row, measure: str) -> float | None:
    """Value of the printed figure; None where there is none."""
    value = drawn_at(row, measure)
    return float(f"{value:.6g}") if math.isfinite(value) else None


def _point(row: Row) -> charts.Point:
    how = "the scene's parameters"
    if not row.own_parameters:
        how = f"hit distance {row.hit_distance:g}, step cap {row.max_steps}"
    text = f"{show.spread(row.ns_per_pixel)}; {how}{'' if row.timed else '; launched once'}"
    errors = (_nearness(row, measure) for measure in TRUTHS)
    about = row.scene, row.phase, float(f"{row.pace:.6g}"), text
    return charts.Point(*about, *errors, row.own_parameters, row.timed)


def fragment(rows: Sequence[Row]) -> str:
    """The chart as HTML; empty without points."""
    points = [one for one in map(_point, rows) if one.paper is not None or one.ideal is not None]
    return charts.speed_and_error(points) if points else ""


def found(result: Pareto) -> Found:
    size, rows = f" (n = {result.n})", result.rows
    caption = "The fastest at a stated PSNR to ground truth; “or”: not told apart from it"
    parts = part("pareto", caption + size, by_level(result.winners), LEVELS)
    own = [row for row in rows if row.own_parameters]
    caption = "With each scene's own parameters: evaluations per pixel × ns per evaluation"
    parts += part("pareto-own", caption + size, own, POINTS)
    parts += part("pareto-points", "Every point of the grid" + size, rows, POINTS)
    return Found(parts, fronts.answer(result.winners), drawings(result), chart=fragment(rows))


section = chapters("pareto", "Speed against error", FILE, Pareto, found)


def drawings(result: Pareto) -> dict[str, Drawing]:
    made = {}
    for measure, (name, caption) in FIGURES.items():
        able = [row for row in result.rows if not math.isnan(row.badness(measure))]
        if able:
            made[name] = Drawing(caption, note(result, measure), partial(figure, able, measure))
    return made
