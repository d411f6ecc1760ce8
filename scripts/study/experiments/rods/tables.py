"""Rod marching as tables, pictures and a figure: from rods.json, throttle.json and the pictures they name."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from study.core import show
from study.core.show import Column
from study.experiments.rods import measure as rods
from study.experiments.rods.measure import Row
from study.pictures.draw import COLOURS, Drawing, plain_log

TRADE = "rods-trade"
JUDGED = 0.9995  # of the pixels: less is said


def _ms(row: Row) -> str:
    return show.interval(row, "ms", 3)


def _gain(row: Row) -> str:
    return show.interval(row, "gain", 3, "×")


def _of(name: str, key: str, digits: int = 3):
    return lambda row: show.number(row[name][key], digits)


def hits(row: Row, key: str = "wrong_ppm", form: Callable[[float], str] = show.number) -> str:
    """Wrong hits in ppm; where truth judges not all of the pixels (the air about a fractal, not its edges),
    of which share. Older files do not say it."""
    judged = row.get("judged", 1)
    return form(row[key]) + (f" (of {show.percent(judged)} of the pixels)" if judged < JUDGED else "")


def _hits(name: str, key: str):
    return lambda row: hits(row[name], key)


def _errors(name: str, group: str) -> list[Column]:
    return [
        Column(group, "false hits, ppm", _hits(name, "false_hits_ppm")),
        Column(group, "false misses, ppm", _hits(name, "false_misses_ppm")),
        Column(group, "wrong shape, ppm", _hits(name, "wrong_shape_ppm")),
        Column(group, "|Δt| 50 %", _of(name, "dt_p50", 2)),
        Column(group, "99 %", _of(name, "dt_p99", 2)),
        Column(group, "PSNR, dB", _of(name, "psnr_db")),
    ]


SCENES = [
    Column("", "scene", lambda r: f"{r['scene']}, {r['width']}×{r['n']}"),
    Column("ms, the march alone [95 %]", "per pixel", lambda r: _ms(r["pixels"])),
    Column("ms, the march alone [95 %]", "rods", lambda r: _ms(r["rods"])),
    Column("", "rods over per pixel [95 %]", _gain),
    Column("evaluations a pixel", "per pixel", _of("pixels", "evaluations")),
    Column("evaluations a pixel", "rods", _of("rods", "evaluations")),
    Column("evaluations a pixel", "fewer", lambda r: show.number(r["fewer"]) + "×"),
    *_errors("rods", "rods to ground truth"),
    Column("per pixel to ground truth", "wrong hits, ppm", _hits("pixels", "wrong_ppm")),
    Column("per pixel to ground truth", "PSNR, dB", _of("pixels", "psnr_db")),
]
TRADES = [
    Column("", "starting rods down", lambda r: str(r["down"])),
    Column("", "step cap", lambda r: str(r["max_steps"])),
    Column("", "smallest rod, pixels", lambda r: str(r["least"])),
    Column("", "step", lambda r: "distance" if r["step"] == "whole" else "distance − radius"),
    Column("", "ms [95 %]", _ms),
    Column("", "over per pixel [95 %]", lambda r: _gain(r) if "gain" in r else show.NOTHING),
    Column("", "evaluations a pixel", show.plain("evaluations")),
    Column("to ground truth", "wrong hits, ppm", hits),
    Column("to ground truth", "|Δt| 50 %", show.plain("dt_p50", 2)),
    Column("to ground truth", "99 %", show.plain("dt_p99", 2)),
]


def verdict(row: Row | None) -> str:
    """Whether a gain's interval has 1 outside; without an interval nothing can be told."""
    if row is None or row["gain"] is None:
        return show.NOTHING
    low, high = (np.nan if row[f"gain_{end}"] is None else row[f"gain_{end}"] for end in ("low", "high"))
    return "gain" if low > 1 else "loss" if high < 1 else "cannot be told"


def _large(text):
    return lambda row: show.NOTHING if row.get("large") is None else text(row["large"])


def apart(row: Row) -> str:
    """Two pictures of one scene."""
    psnr = "identical" if row["psnr_db"] is None else f"{show.number(row['psnr_db'])} dB"
    if row.get("non_finite", 0) != 0:  # a file has no NaN: null again. Older ones lack the number
        psnr = "not finite"
    return f"{psnr}, {row['other_ppm']:,.0f} ppm other hits"


def _chosen(key: str):
    return lambda row: show.NOTHING if row["chosen"] is None else show.number(row["chosen"][key])


THROTTLE = [
    Column("", "scene", lambda r: f"{r['scene']}, {r['width']}×{r['n']}"),
    Column("", "error allowed", lambda r: f"≥ {r['psnr_db']:.4g} dB, ≤ {r['wrong_ppm']:.4g} ppm"),
    Column("", "within it", lambda r: f"{r['within']} of {r['tried'] - 1}"),
    Column("", "the throttle's choice", lambda r: words_of(r["chosen"])),
    Column("ms a frame [95 %]", "rods first", lambda r: _ms(r["chosen"]) if r["chosen"] else show.NOTHING),
    Column("ms a frame [95 %]", "packets alone", lambda r: _ms(r["plain"])),
    Column("", "gain [95 %]", lambda r: _gain(r) if r["chosen"] else show.NOTHING),
    Column("", "verdict", verdict),
    Column("larger", "size", _large(lambda r: f"{r['width']}×{r['n']}")),
    Column("larger", "gain [95 %]", _large(lambda r: _gain(r))),
    Column("larger", "verdict", _large(verdict)),
    Column("larger", "against packets alone", _large(apart)),
    Column("evaluations a pixel", "rods first", _chosen("evaluations")),
    Column("evaluations a pixel", "packets alone", lambda r: show.number(r["plain"]["evaluations"])),
    Column("rods first, to ground truth", "PSNR, dB", _chosen("psnr_db")),
    Column(
        "rods first, to ground truth",
        "wrong hits, ppm",
        lambda r: hits(r["chosen"]) if r["chosen"] else show.NOTHING,
    ),
    Column("packets alone, to ground truth", "PSNR, dB ", lambda r: show.number(r["plain"]["psnr_db"])),
    Column("packets alone, to ground truth", "wrong hits, ppm ", lambda r: hits(r["plain"])),
]


def words_of(row: Row | None) -> str:
    """A setting for people."""
    if row is None:
        return "none is within the error"
    one = dict(word.split("=") for word in row["settings"].split())
    steps, finish = (
        f"at most {one[key]} steps" if one[key] != "0" else "the scene's cap of steps"
        for key in ("steps", "finish")
    )
    return f"rods of {one['size']} to {one['least']} pixels by {steps}, each pixel finished by {finish}"


def sentence(row: Row) -> str:
    """For a terminal."""
    wrong, theirs = (hits(row[name], form="{:.4g} ppm".format) for name in ("rods", "pixels"))
    return (
        f"{row['scene']}, {row['width']}×{row['n']}: per pixel {_ms(row['pixels'])} ms, "
        f"rods {_ms(row['rods'])} ms, {_gain(row)}; {row['fewer']:.3g}× fewer evaluations; "
        f"wrong hits {wrong}, per pixel {theirs}; "
        f"|Δt| 99 % {show.number(row['rods']['dt_p99'], 2)}"
    )


def choice(row: Row) -> str:
    """For a terminal."""
    best, others = row["chosen"], row["tried"] - 1
    if best is None:
        return f"{row['scene']}: none of {others} settings is within the error"
    return (
        f"{row['scene']}, {row['width']}×{row['n']}: {words_of(best)}: {_ms(best)} ms against "
        f"{_ms(row['plain'])} ms of packets alone, {_gain(row)}: {verdict(row)}; "
        f"{show.number(best['psnr_db'])} dB, "
        f"{hits(best, form='{:.4g} ppm wrong'.format)} ({row['within']} of {others} settings within)"
    )


def over_pixels(row: Row, pixels: Row, beside: Row | None) -> str:
    """How many times as fast as the march per pixel, and that base; an older file timed it in another run."""
    if "gain" in row:
        base = f" ({show.number(beside['ms'])} ms, above)" if beside else ""
        return f"{_gain(row)} over per pixel{base}"
    return show.number(pixels["ms"] / row["ms"]) + "× over per pixel (of another run: no interval)"


def trade_pixels(result: Row) -> Row | None:
    """The march per pixel that the trade's gains are over: of the same interleaved run, not the one beside
    the article's figures. An older file has its median alone, as what every row's gain times its ms is;
    one of before there was a gain, nothing."""
    if "trade_pixels" in result:
        return result["trade_pixels"]
    row = next((row for row in result["trade"] if row.get("gain")), None)
    return {"ms": row["gain"] * row["ms"]} if row else None


def system_rows(result: Row, throttled: Row) -> list[Row]:
    """Rows of the table of all systems: what the article says, what we measure, the ratio, the error."""
    if not result["rows"]:
        return []
    own, said = result["own"], result["article"]
    size = f"{own['width']}×{own['n']}"
    pixels, by_rods = own["pixels"], own["rods"]

    def error(one: Row) -> str:
        return f"{hits(one, form='{:,.0f} ppm wrong hits'.format)}, |Δt| 99 % {show.number(one['dt_p99'], 2)}"

    rows = [
        {
            "system": "rod marching (P4)",
            "what": f"{rods.SCENE} {size}, per pixel, ms",
            "article": f"{said['pixels_ms']} ({said['cpu']})",
            "ours": _ms(pixels),
            "ratio": show.number(said["pixels_ms"] / pixels["ms"]) + "× its speed",
            "error": error(pixels),
        },
        {
            "system": "rod marching (P4)",
            "what": f"{rods.SCENE} {size}, rods, ms",
            "article": f"under {said['rods_ms']}",
            "ours": _ms(by_rods),
            "ratio": show.number(said["rods_ms"] / by_rods["ms"]) + "× its speed",
            "error": error(by_rods),
        },
        {
            "system": "rod marching (P4)",
            "what": "rods over per pixel, time",
            "article": f"over {said['pixels_ms'] / said['rods_ms']:.0f}×",
            "ours": _gain(own),
            "ratio": show.number(own["gain"] / (said["pixels_ms"] / said["rods_ms"])) + "× of it",
            "error": error(by_rods),
        },
        {
            "system": "rod marching (P4)",
            "what": "evaluations, per pixel over rods",
            "article": "two orders of magnitude",
            "ours": show.number(own["fewer"]) + "×",
            "ratio": show.number(own["fewer"] / said["evaluations"]) + "× of it",
            "error": error(by_rods),
        },
    ]
    coarse = {r["least"]: r for r in result["trade"] if r["least"] > 1}
    if coarse and (beside := trade_pixels(result)):
        rows.append(
            {
                "system": "rod marching (P4)",
                "what": f"{rods.SCENE} {size}, per pixel, timed anew between the rows below, ms",
                "article": f"{said['pixels_ms']} ({said['cpu']})",
                "ours": _ms(beside) if "ms_low" in beside else f"{show.number(beside['ms'])} (no interval)",
                "ratio": show.number(said["pixels_ms"] / beside["ms"]) + "× its speed",
                "error": error(pixels),
            }
        )
    rows += [
        {
            "system": "rod marching (P4)",
            "what": f"rods that end at {least}×{least} pixels: ms; evaluations, per pixel over rods",
            "article": f"under {said['rods_ms']}; two orders of magnitude",
            "ours": f"{_ms(row)}; {show.number(pixels['evaluations'] / row['evaluations'])}×",
            "ratio": over_pixels(row, pixels, trade_pixels(result)),
            "error": error(row),
        }
        for least, row in sorted(coarse.items())
    ]
    return rows + [one for row in throttled["rows"] if row["chosen"] for one in hybrid_rows(row)]


def hybrid_rows(row: Row) -> list[Row]:
    """The throttle's choice for a scene, in the size it was made for and in the larger one."""
    base = {"system": "rods, then packets (P4's hybrid)", "article": "proposed, not measured"}
    found = [
        base
        | {
            "what": f"{row['scene']} {row['width']}×{row['n']}, ms a frame",
            "ours": _ms(row["chosen"]),
            "ratio": f"{_gain(row)} over packets alone: {verdict(row)}",
            "error": f"{show.number(row['chosen']['psnr_db'])} dB, "
            f"{hits(row['chosen'], form='{:,.0f} ppm wrong hits'.format)}",
        }
    ]
    if more := row.get("large"):
        found.append(
            base
            | {
                "what": f"{row['scene']} {more['width']}×{more['n']}, that choice, ms a frame",
                "ours": _ms(more["chosen"]),
                "ratio": f"{_gain(more)} over packets alone: {verdict(more)}",
                "error": f"against packets alone: {apart(more)}",
            }
        )
    return found


NOTE = (
    "The article marches two spheres without perspective, and says neither its camera nor their sizes: our "
    "scene has its size in pixels, its number of spheres and its step cap. Times are of the march alone, "
    "which its pictures show; PSNR is of pictures shaded as every phase's are."
)


def throttle_foot(throttled: Row) -> str:
    """Of which launches the gains are: files of before had no others than those that chose."""
    if all("finalists" in row for row in throttled["rows"]):
        return (
            "A choice is the fastest of several finalists, whose times thereby say too much: gains are of "
            "launches after it was made."
        )
    return "Gains are of the launches that made the choice, the least of several: they are upper bounds."


def draw(result: Row) -> Figure:
    """Time against wrong hits and |Δt|, a line for each number of starting rods along the step caps."""
    figure = Figure(figsize=(11, 4.6), layout="constrained")
    panels = figure.subplots(1, 2)
    axes_of = {
        "wrong_ppm": "wrong hits to ground truth, ppm",
        "dt_p99": "|Δt| to ground truth, 99 %, scene units",
    }
    marks = []
    for panel, (key, label) in zip(panels, axes_of.items(), strict=True):
        for number, (down, step) in enumerate(
            [*((d, "whole") for d in rods.DOWN), (rods.ARTICLE["down"], "safe")]
        ):
            mine = [r for r in result["trade"] if (r["down"], r["step"], r["least"]) == (down, step, 1)]
            mine = sorted((r for r in mine if r[key]), key=lambda r: r["max_steps"])
            line = {
                "color": COLOURS[number % len(COLOURS)],
                "linestyle": "--" if step == "safe" else "-",
                "marker": "o",
                "markersize": 4,
            }
            panel.plot([r["ms"] for r in mine], [r[key] for r in mine], **line)
            if panel is panels[0]:
                name = f"{down} down" + (", step less the radius" if step == "safe" else "")
                marks.append(Line2D([], [], label=name, **line))
                for r in mine if down == rods.ARTICLE["down"] and step == "whole" else []:
                    panel.annotate(f"{r['max_steps']} steps", (r["ms"], r[key]), fontsize=8, xytext=(4, 4),
                                   textcoords="offset points")  # fmt: skip
        own = result["own"]["pixels"]
        panel.plot([own["ms"]], [own[key]], "k*", markersize=11)
        panel.set(xscale="log", yscale="log", xlabel="ms, the march alone", ylabel=label)
        plain_log(panel.xaxis)
    marks.append(
        Line2D(
            [], [], color="black", marker="*", linestyle="none", markersize=10, label="per pixel, 20 steps"
        )
    )
    figure.legend(handles=marks, loc="outside upper center", ncols=4, frameon=False, fontsize=9)
    return figure


def drawings(result: Row) -> dict[str, Drawing]:
    """What rods.json suffices for."""
    if not result["rows"]:
        return {}
    caption = "Starting rods × step cap: time against error (lower left is better)"
    note = f"{rods.SCENE}, {result['own']['width']}×{result['own']['n']}; along a line the step cap grows."
    return {TRADE: Drawing(caption, note, lambda: draw(result))}
