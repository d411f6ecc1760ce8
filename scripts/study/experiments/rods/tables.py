"""Rod marching as tables and a figure, from rods.json alone."""

from __future__ import annotations

from pathlib import Path

from matplotlib.figure import Figure

from study.core import show
from study.core.show import Column
from study.experiments.rods import measure as rods
from study.experiments.rods.pictures import CAPTION, PICTURES
from study.experiments.rods.schema import FILE, Rods, Row
from study.experiments.section import Claim, System, part
from study.measuring.hit_tables import depth_error, gain, ms, ppm, to_truth, within
from study.pictures.draw import COLOURS, Drawing, plain_log

TRADE = "rods-trade"
ALONE = "ms, the march alone [95 %]"
EVALUATIONS = "evaluations a pixel"
SCENES = [
    Column("", "scene", lambda r: show.picture(r)),
    *within("pixels", [Column(ALONE, "per pixel", ms)]),
    *within("rods", [Column(ALONE, "rods", ms)]),
    Column("", "rods over per pixel [95 %]", gain),
    *within("pixels", [Column(EVALUATIONS, "per pixel", show.plain("evaluations"))]),
    *within("rods", [Column(EVALUATIONS, "rods", show.plain("evaluations"))]),
    Column(EVALUATIONS, "fewer", lambda r: show.number(r.fewer) + "×"),
    *within(
        "rods",
        to_truth(
            *("false hits", "false misses", "wrong shape", "dt 50", "dt 99", "psnr"),
            group="rods to ground truth",
        ),
    ),
    *within("pixels", to_truth("wrong hits", "psnr", group="per pixel to ground truth")),
]
TRADES = [
    Column("", "starting rods down", lambda r: str(r.down)),
    Column("", "step cap", lambda r: str(r.max_steps)),
    Column("", "smallest rod, pixels", lambda r: str(r.least)),
    Column("", "step", lambda r: "distance" if r.step == "whole" else "distance − radius"),
    Column("", "ms [95 %]", ms),
    Column("", "over per pixel [95 %]", gain),
    Column("", EVALUATIONS, show.plain("evaluations")),
    *to_truth("wrong hits", "dt 50", "dt 99"),
]
NOTE = (
    "The article marches two spheres without perspective, and says neither its camera nor their sizes: our "
    "scene has its size in pixels, its number of spheres and its step cap. Times are of the march alone, "
    "which its pictures show; PSNR is of pictures shaded as every phase's are."
)


def sentence(row: Row) -> str:
    """For a terminal."""
    wrong, theirs = (ppm(one, form="{:.4g} ppm".format) for one in (row.rods, row.pixels))
    return (
        f"{show.picture(row)}: per pixel {ms(row.pixels)} ms, rods {ms(row.rods)} ms, {gain(row)}; "
        f"{row.fewer:.3g}× fewer evaluations; wrong hits {wrong}, per pixel {theirs}; "
        f"|Δt| 99 % {show.number(row.rods.dt_p99, 2)}"
    )


def claims(result: Rods) -> list[Claim]:
    """The article's four figures beside ours."""
    own, said = result.own, result.article
    size = f"{rods.SCENE} {own.width}×{own.n}"
    rows = [
        (f"{size}, per pixel, ms", f"{said.pixels_ms:g}", ms(own.pixels), said.pixels_ms, own.pixels),
        (f"{size}, rods, ms", f"under {said.rods_ms:g}", ms(own.rods), said.rods_ms, own.rods),
    ]
    found = [
        Claim(
            "rod marching (P4)",
            what,
            article,
            ours,
            f"{show.number(theirs / one.ms)}×",
            depth_error(one),
            theirs / one.ms,
        )
        for what, article, ours, theirs, one in rows
    ]
    times = said.pixels_ms / said.rods_ms
    for what, article, ours, ratio in (
        ("rods over per pixel, time", f"over {times:.0f}×", gain(own), (own.gain or 0) / times),
        (
            "evaluations, per pixel over rods",
            f"{said.evaluations:g}×",
            f"{show.number(own.fewer)}×",
            own.fewer / said.evaluations,
        ),
    ):
        found.append(
            Claim("rod marching (P4)", what, article, ours, f"{show.number(ratio)}×", depth_error(own.rods))
        )
    return found


def system(run: Path) -> System | None:
    """What a run has of it."""
    result = Rods.load_if_there(run / FILE)
    if result is None:
        return None
    caption = "Rod marching against per-pixel marching: time, evaluations, error"
    parts = part("rods", caption, result.rows, SCENES, NOTE)
    trade = result.trade_pixels
    foot = f"The march per pixel between these launches: {ms(trade)} ms."
    parts += part(TRADE, "Rod marching: starting rods × step cap on two_spheres", result.trade, TRADES, foot)
    note = f"P4: {result.article.cpu}; its evaluations are fewer by “two orders of magnitude”."
    images = {run / "images" / f"{PICTURES}.png": CAPTION}
    return System(claims(result), parts, note, drawings(result), images)


def draw(result: Rods) -> Figure:
    """Time against wrong hits and |Δt|, a line for each number of starting rods along the step caps."""
    figure = Figure(figsize=(11, 4.6), layout="constrained")
    labels = {
        "wrong_ppm": "wrong hits to ground truth, ppm",
        "dt_p99": "|Δt| to ground truth, 99 %, scene units",
    }
    own = result.own.pixels
    lines = [*((down, "whole") for down in rods.DOWN), (rods.ARTICLE.down, "safe")]
    panels = figure.subplots(1, 2)
    for panel, (key, label) in zip(panels, labels.items(), strict=True):
        for number, (down, step) in enumerate(lines):
            mine = [r for r in result.trade if (r.down, r.step, r.least) == (down, step, 1)]
            mine = sorted((r for r in mine if getattr(r, key)), key=lambda r: r.max_steps)
            panel.plot(
                [r.ms for r in mine],
                [getattr(r, key) for r in mine],
                color=COLOURS[number],
                linestyle="--" if step == "safe" else "-",
                marker="o",
                markersize=4,
                label=f"{down} down" + (", step less the radius" if step == "safe" else ""),
            )
            for r in mine if (down, step) == (rods.ARTICLE.down, "whole") and panel is panels[0] else []:
                at = (r.ms, getattr(r, key))
                panel.annotate(
                    f"{r.max_steps} steps", at, fontsize=8, xytext=(4, 4), textcoords="offset points"
                )
        panel.plot([own.ms], [getattr(own, key)], "k*", markersize=11, label="per pixel, 20 steps")
        panel.set(xscale="log", yscale="log", xlabel="ms, the march alone", ylabel=label)
        plain_log(panel.xaxis)
    handles, names = panels[0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside upper center", ncols=4, frameon=False, fontsize=9)
    return figure


def drawings(result: Rods) -> dict[str, Drawing]:
    caption = "Starting rods × step cap: time against error (lower left is better)"
    note = f"{rods.SCENE}, {result.own.width}×{result.own.n}; along a line the step cap grows."
    return {TRADE: Drawing(caption, note, lambda: draw(result))}
