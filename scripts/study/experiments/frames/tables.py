"""Frame rates as a table and a figure, made from frames.json alone."""

import math

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from study.core import registry, show
from study.core.show import Column
from study.experiments.frames.measure import HALF, PHASE
from study.experiments.frames.schema import Frames, Row
from study.experiments.section import Found, left_out, part
from study.pictures.draw import Drawing, plain_log

_rate = show.spread_of("frames_per_s")


def _p99(row: Row) -> str:
    if row.p99_ms is not None:
        return show.number(row.p99_ms)
    return f"{show.number(row.worst_ms)} (largest of {row.frames})"


def _presenting(row: Row) -> str:
    return "in the phase's tiles" if row.presented_by == PHASE else show.number(row.present_ms, 2)


COARSE = (
    "The reference marches planes and solids and stops short of them by up to the hit distance; closed forms "
    "put them where they are. A low PSNR with a coarse hit distance is the reference's."
)


def _hit(row: Row) -> str:
    return f"{row.hit}, {row.hit_distance:.2g}"


TIME, SAME, OWN = (
    "ms a frame, presenting included",
    "error by the same parameters",
    "to the scene's own parameters",
)
RATES = [
    Column("", "scene", show.picture),
    Column("", "hit distance", _hit),
    Column("", "phase", lambda r: r.phase),
    Column("", "threads", lambda r: str(r.threads)),
    Column("", "frames a second [95 %]", _rate),
    Column(TIME, "median", show.plain("median_ms")),
    Column(TIME, "99 %", _p99),
    Column(TIME, "of it presenting", _presenting),
    Column(SAME, "to", lambda r: r.reference),
    Column(SAME, "PSNR, dB", lambda r: r.psnr),
    Column(SAME, "pixels off > 1/255", lambda r: show.percent(r.fraction_over_1_255)),
    Column(SAME, "wrong hit, ppm", show.plain("wrong_ppm")),
    Column(SAME, "depth agrees", lambda r: show.share(r.depth_agree_fraction)),
    Column(OWN, "PSNR, dB ", lambda r: r.to_own.psnr if r.to_own else show.NOTHING),
    Column(OWN, "depth agrees ", lambda r: show.share(r.to_own and r.to_own.depth_agree_fraction)),
]


def draw(result: Frames) -> Figure:
    """A panel a scene and hit distance: every frame a dot, its median and 99 %."""
    kinds = list(dict.fromkeys((r.scene, r.hit) for r in result.rows))
    most = max(sum((r.scene, r.hit) == kind for r in result.rows) for kind in kinds)
    lines = math.ceil(len(kinds) / 2)
    figure = Figure(figsize=(11, lines * (0.5 * most + 1.5) + 1), layout="constrained")
    figure.suptitle("Time of every frame, presenting included", x=0.01, ha="left", fontsize=12)
    grid = figure.subplots(lines, 2, squeeze=False)
    for axes in grid.flat[len(kinds) :]:
        axes.set_axis_off()
    dice = np.random.default_rng(1)
    for kind, axes in zip(kinds, grid.flat, strict=False):
        mine = [r for r in result.rows if (r.scene, r.hit) == kind]
        for place, one in enumerate(mine):
            ms = np.concatenate([np.asarray(launch, float) for launch in one.ms])
            aside = place + 0.22 * (dice.random(len(ms)) * 2 - 1)
            axes.scatter(ms, aside, s=7, color="#56B4E9", linewidth=0, alpha=0.6, zorder=2)
            ends = [place - 0.34, place + 0.34]
            axes.plot([one.median_ms] * 2, ends, color="black", linewidth=2, zorder=3)
            if one.p99_ms is not None:
                axes.plot([one.p99_ms] * 2, ends, color="black", linewidth=1, linestyle=":", zorder=3)
        axes.set_yticks(range(len(mine)), [r.phase for r in mine], fontsize=9)
        title = f"{kind[0]}, {mine[0].width}×{mine[0].n}, hit distance {_hit(mine[0])}"
        axes.set(xscale="log", xlabel="ms a frame (left is faster)", ylim=(-0.6, len(mine) - 0.4))
        axes.set_title(title, fontsize=9)
        plain_log(axes.xaxis)
    marks = [
        Line2D([], [], marker="o", color="#56B4E9", linestyle="none", markersize=4, label="a frame"),
        Line2D([], [], color="black", linewidth=2, label="median"),
        Line2D([], [], color="black", linewidth=1, linestyle=":", label="99 %"),
    ]
    figure.legend(handles=marks, loc="outside upper right", ncols=3, frameon=False, fontsize=9)
    return figure


def note(result: Frames) -> str:
    tiles = (
        " (in its tiles where a phase can, before they leave the cache: to the byte what is displayed of the "
        "picture whose errors stand here)"
    ) * any(row.presented_by == PHASE for row in result.rows)
    return (
        f"{result.machine}; {result.threads} threads, {result.launches} interleaved launches. A frame is its "
        f"rendering, gamma and 8 bits{tiles}, all on all cores. Hit distance: {HALF} is half of what a pixel "
        f"covers at the mean distance of the shapes; secondary rays start {result.away} of "
        "them off the surface then. Errors are of these very pictures, in linear RGB, to the fastest double "
        f"phase. {COARSE}"
    )


def answer(result: Frames) -> str:
    """The highest rate of each scene by its own hit distance, with its error."""
    said = []
    own = [r for r in result.rows if r.to_own is None] or result.rows
    for scene in dict.fromkeys(r.scene for r in own):
        best = max((r for r in own if r.scene == scene), key=lambda r: r.frames_per_s.value)
        known = registry.phases().get(best.phase)
        other = " with another shadow, the estimator's" if known is not None and known.draws_ideal else ""
        said.append(
            f"{_rate(best)} frames a second of {scene} at {best.width}×{best.n} ({best.phase}, "
            f"{show.decibels(best.psnr)} to {best.reference}{other})"
        )
    return f"On {result.threads} threads, presenting included: {'; '.join(said)}." if said else ""


def drawings(result: Frames) -> dict[str, Drawing]:
    caption = "Time of every frame, by phase"
    return {"frames": Drawing(caption, note(result), lambda: draw(result))} if result.rows else {}


def found(result: Frames) -> Found:
    caption = "Finished frames a second on every core, gamma and 8 bits included"
    parts = part("frames", caption, result.rows, RATES, COARSE)
    parts += left_out("frames-left-out", result.left_out)
    return Found(parts, answer(result), drawings(result))
