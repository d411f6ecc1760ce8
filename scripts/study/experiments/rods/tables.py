"""Rod marching as tables, from rods.json alone."""

from __future__ import annotations

from pathlib import Path

from study.core import show
from study.core.show import Column
from study.experiments.rods import measure
from study.experiments.rods.pictures import CAPTION, PICTURES
from study.experiments.rods.schema import FILE, Rods, Way
from study.experiments.section import Claim, Part, System, part
from study.measuring.hit_tables import gain, ms, ppm, to_truth, within, wrong

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
LARGER = (2, 4)  # pixels on a side of the smallest rod, in the lesson
LESSON = [
    Column("", "march", lambda r: r[0]),
    Column("", "ms [95 %]", lambda r: ms(r[1])),
    Column("", EVALUATIONS, lambda r: show.number(r[1].evaluations)),
    Column("", "fewer", lambda r: f"{show.number(r[2] / r[1].evaluations)}×"),
    Column("", "wrong hits, ppm", lambda r: ppm(r[1])),
]
NOTE = (
    "The article says neither its camera nor its spheres' sizes: our scene has its size in pixels, its "
    "number of spheres and its step cap. Times are of the march alone; PSNR is of pictures shaded as "
    "every phase's."
)


def claims(result: Rods) -> list[Claim]:
    """The article's four figures beside ours."""
    own, said = result.own, result.article
    size, times = f"{measure.SCENE} {own.width}×{own.n}", said.pixels_ms / said.rods_ms
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
        Claim("rod marching (P4)", what, limit, ours, f"{show.number(ratio)}×", wrong(one), speed)
        for what, limit, ours, ratio, one, speed in found
    ]


def lessons(result: Rods) -> list[Part]:
    """The march per pixel, rods down to a pixel, and rods that end earlier."""
    own, said = result.own, result.article
    at = (said.down, said.max_steps, "whole")
    ways: list[tuple[str, Way]] = [("per pixel", own.pixels), ("rods down to a pixel", own.rods)]
    for row in result.trade:
        if (k := row.least) in LARGER and (row.down, row.max_steps, row.step) == at:
            ways.append((f"rods down to {k} × {k} pixels", row))
    rows = [(*way, own.pixels.evaluations) for way in ways]
    about = f"{show.picture(own)}, at most {said.max_steps} steps; {result.launches} interleaved launches"
    foot = (
        f"Times are of the march alone; the article says {said.pixels_ms:g} ms, under {said.rods_ms:g} by "
        f"rods. It says {said.evaluations:g}× fewer evaluations."
    )
    return part("rods", about, rows, LESSON, foot)


def parts(result: Rods) -> list[Part]:
    caption = "Rod marching against per-pixel marching: time, evaluations, error"
    foot = f"The march per pixel between these launches: {ms(result.trade_pixels)} ms."
    title = "Rod marching: starting rods × step cap on two_spheres"
    return [
        *part("rods", caption, result.rows, SCENES, NOTE),
        *part("rods-trade", title, result.trade, TRADES, foot),
    ]


def system(run: Path) -> System | None:
    """What a run has of it."""
    result = Rods.load_if_there(run / FILE)
    if result is None:
        return None
    note = f"P4: {result.article.cpu}; its evaluations are fewer by “two orders of magnitude”."
    images = {run / "images" / f"{PICTURES}.png": CAPTION}
    return System(claims(result), parts(result), note, images=images, lessons=lambda: lessons(result))
