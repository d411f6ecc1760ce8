"""Rod marching as tables and a figure, from rods.json alone."""

from __future__ import annotations

from pathlib import Path

from matplotlib.figure import Figure

from study.core import show
from study.core.show import Column
from study.experiments.rods import measure as rods
from study.experiments.rods.pictures import CAPTION, PICTURES
from study.experiments.rods.schema import FILE, Rods
from study.experiments.section import Claim, Part, System, part
from study.measuring.hit_tables import depth_error, gain, ms, to_truth, within
from study.pictures.draw import COLOURS, Drawing, plain_log

TRADE = "rods-trade"
ALONE = "ms, the march alone [95 %]"
EVALUATIONS = "evaluations a pixel"
HITS = ("false hits", "false misses", "wrong shape")
SCENES = [
    Column("", "scene", lambda r: show.picture(r)),
    *within("pixels", [Column(ALONE, "per pixel", ms)]),
    *within("rods", [Column(ALONE, "rods", ms)]),
    Column("", "rods over per pixel [95 %]", gain),
    *within("pixels", [Column(EVALUATIONS, "per pixel", show.plain("evaluations"))]),
    *within("rods", [Column(EVALUATIONS, "rods", show.plain("evaluations"))]),
    Column(EVALUATIONS, "fewer", lambda r: show.number(r.fewer) + "×"),
    *within("rods", to_truth(*HITS, "dt 50", "dt 99", "psnr", group="rods to ground truth")),
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


def claims(result: Rods) -> list[Claim]:
    """The article's four figures beside ours."""
    own, said = result.own, result.article
    size, times = f"{rods.SCENE} {own.width}×{own.n}", said.pixels_ms / said.rods_ms
    found = []
    for what, limit, theirs, one in (
        ("per pixel", "", said.pixels_ms, own.pixels),
        ("rods", "under ", said.rods_ms, own.rods),
    ):
        ratio, limit = theirs / (one.ms or 1), f"{limit}{theirs:g}"
        found.append((f"{size}, {what}, ms", limit, ms(one), ratio, one, ratio))
    fewer = "evaluations, per pixel over rods"
    gained = (own.gain or 0) / times
    found.append(("rods over per pixel, time", f"over {times:.0f}×", gain(own), gained, own.rods, None))
    many, ours = f"{said.evaluations:g}×", f"{show.number(own.fewer)}×"
    found.append((fewer, many, ours, own.fewer / said.evaluations, own.rods, None))
    return [
        Claim("rod marching (P4)", what, limit, ours, f"{show.number(ratio)}×", depth_error(one), speed)
        for what, limit, ours, ratio, one, speed in found
    ]


def parts(result: Rods) -> list[Part]:
    caption = "Rod marching against per-pixel marching: time, evaluations, error"
    foot = f"The march per pixel between these launches: {ms(result.trade_pixels)} ms."
    title = "Rod marching: starting rods × step cap on two_spheres"
    return [
        *part("rods", caption, result.rows, SCENES, NOTE),
        *part(TRADE, title, result.trade, TRADES, foot),
    ]


def system(run: Path) -> System | None:
    """What a run has of it."""
    result = Rods.load_if_there(run / FILE)
    if result is None:
        return None
    note = f"P4: {result.article.cpu}; its evaluations are fewer by “two orders of magnitude”."
    images = {run / "images" / f"{PICTURES}.png": CAPTION}
    return System(claims(result), parts(result), note, drawings(result), images)


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
            style = {"color": COLOURS[number], "linestyle": "--" if step == "safe" else "-", "marker": "o"}
            about = f"{down} down" + (", step less the radius" if step == "safe" else "")
            points = [r.ms for r in mine], [getattr(r, key) for r in mine]
            panel.plot(*points, markersize=4, label=about, **style)
            place = {"xytext": (4, 4), "textcoords": "offset points", "fontsize": 8}
            for r in mine if (down, step) == (rods.ARTICLE.down, "whole") and panel is panels[0] else []:
                panel.annotate(f"{r.max_steps} steps", (r.ms, getattr(r, key)), **place)
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
