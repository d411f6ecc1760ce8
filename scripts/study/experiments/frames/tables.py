"""Frame rates as a table and a figure, made from frames.json alone."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from study.core import machine, show
from study.core.show import Column
from study.experiments.frames.measure import AWAY_ONCE, HALF, MET, MISSED, PHASE, Row
from study.pictures.draw import BAD, Drawing, plain_log

FIGURE = "frames"


def _rate(row: Row) -> str:
    found = row["frames_per_s"]
    flat = {"v": found["value"], "v_low": found["low"], "v_high": found["high"]}
    return show.interval({k: math.nan if v is None else v for k, v in flat.items()}, "v", 3)


def _p99(row: Row) -> str:
    if row["p99_ms"] is not None:
        return show.number(row["p99_ms"])
    return f"{show.number(row['worst_ms'])} (largest of {row['frames']})"


def _presenting(row: Row) -> str:
    """Older runs had it done by the driver and do not say so."""
    return "in the phase's tiles" if row.get("presented_by") == PHASE else show.number(row["present_ms"], 2)


def _psnr(row: Row | None) -> str:
    if row is None:
        return show.NOTHING
    if row["rmse"] is None:
        return "not finite"
    value = "identical" if row["psnr_db"] is None else show.number(row["psnr_db"])
    return value + (" (4×4 means)" if row["averaged"] else "")


def _on_bulb(row: Row | None) -> str:
    found = (row or {}).get("bulb_psnr_db")
    return show.NOTHING if found is None else show.number(found)


def _marched(row: Row) -> str:
    """Its parent's errors, whose floor is marched as the reference's: PSNR, on the bulb, depths."""
    found = row.get("marched")
    if not found:
        return show.NOTHING
    bulb = "" if found["bulb_psnr_db"] is None else f", on the bulb {_on_bulb(found)}"
    whole = "not finite" if found["rmse"] is None else show.number(found["psnr_db"])
    return f"{found['phase']}: {whole}{bulb}; {show.share(found['depth_agree_fraction'])}"


def sentence(row: Row) -> str:
    """For a terminal."""
    where = f"{row['scene']}, {row['width']}×{row['n']}, {_hit(row)}: {row['phase']}"
    error = f"{_psnr(row)} dB to {row['reference']}"
    if row["to_own"]:
        error += f", {_psnr(row['to_own'])} dB to the scene's own parameters"
    return f"{where} {_rate(row)} frames/s, {error}; ≥ {row['goal']:g}: {row['verdict']}"


def _hit(row: Row) -> str:
    return f"{row['hit']}, {row['hit_distance']:.2g}"


RATES = [
    Column("", "scene", lambda r: f"{r['scene']}, {r['width']}×{r['n']}"),
    Column("", "hit distance", _hit),
    Column("", "phase", lambda r: r["phase"]),
    Column("", "threads", lambda r: str(r["threads"])),
    Column("", "frames a second [95 %]", _rate),
    Column("ms a frame, presenting included", "median", show.plain("median_ms")),
    Column("ms a frame, presenting included", "99 %", _p99),
    Column("ms a frame, presenting included", "of it presenting", _presenting),
    Column("", "goal", lambda r: f"≥ {r['goal']:g}"),
    Column(
        "", "goal met?", lambda r: r["verdict"], lambda r: {MET: "good", MISSED: "bad"}.get(r["verdict"], "")
    ),
    Column("error by the same parameters", "to", lambda r: r["reference"]),
    Column("error by the same parameters", "PSNR, dB", _psnr),
    Column(
        "error by the same parameters", "pixels off > 1/255", lambda r: show.percent(r["fraction_over_1_255"])
    ),
    Column("error by the same parameters", "wrong hit, ppm", show.plain("wrong_ppm")),
    Column("error by the same parameters", "depth agrees", lambda r: show.share(r["depth_agree_fraction"])),
    Column("error by the same parameters", "PSNR on the bulb alone, dB", _on_bulb),
    Column("error by the same parameters", "beside it, marched: PSNR, dB; depth agrees", _marched),
    Column("to the scene's own parameters", "PSNR, dB ", lambda r: _psnr(r["to_own"])),
    Column(
        "to the scene's own parameters",
        "depth agrees ",
        lambda r: show.share((r["to_own"] or {}).get("depth_agree_fraction")),
    ),
]
LEFT_OUT = [
    Column("", "phase", lambda r: r["phase"]),
    Column("", "scene", lambda r: f"{r['scene']}, {r['hit']}" if "scene" in r else "all"),
    Column("", "why", lambda r: r["reason"]),
]


def tables(result: Row) -> list[tuple[str, str, list[Row], list[Column], bool]]:
    """Name, caption, rows, columns, and whether it is folded."""
    caption = "Finished frames a second on every core, gamma and 8 bits included"
    return [
        ("frames", caption, result["rows"], RATES, False),
        ("frames-left-out", "Not measured", result["left_out"], LEFT_OUT, True),
    ]


def draw(result: Row) -> Figure:
    """A panel a scene and hit distance: every frame a dot, median, 99 % and the goal as a line."""
    kinds = list(dict.fromkeys((r["scene"], r["hit"]) for r in result["rows"]))
    most = max(sum((r["scene"], r["hit"]) == kind for r in result["rows"]) for kind in kinds)
    lines = math.ceil(len(kinds) / 2)
    figure = Figure(figsize=(11, lines * (0.5 * most + 1.5) + 1), layout="constrained")
    figure.suptitle("Time of every frame, presenting included", x=0.01, ha="left", fontsize=12)
    grid = figure.subplots(lines, 2, squeeze=False)
    for axes in grid.flat[len(kinds) :]:
        axes.set_axis_off()
    dice = np.random.default_rng(1)
    for kind, axes in zip(kinds, grid.flat, strict=False):
        mine = [r for r in result["rows"] if (r["scene"], r["hit"]) == kind]
        for place, one in enumerate(mine):
            ms = np.concatenate([np.asarray(launch, float) for launch in one["ms"]])
            aside = place + 0.22 * (dice.random(len(ms)) * 2 - 1)
            axes.scatter(ms, aside, s=7, color="#56B4E9", linewidth=0, alpha=0.6, zorder=2)
            axes.plot(
                [one["median_ms"]] * 2, [place - 0.34, place + 0.34], color="black", linewidth=2, zorder=3
            )
            if one["p99_ms"] is not None:
                ends = [place - 0.34, place + 0.34]
                axes.plot([one["p99_ms"]] * 2, ends, color="black", linewidth=1, linestyle=":", zorder=3)
        goal = mine[0]["goal"]
        axes.axvline(1000 / goal, color=BAD, linewidth=1.2, zorder=1)
        axes.set_yticks(range(len(mine)), [r["phase"] for r in mine], fontsize=9)
        title = f"{kind[0]}, {mine[0]['width']}×{mine[0]['n']}, hit distance {_hit(mine[0])}"
        axes.set(
            xscale="log", xlabel="ms a frame (left is faster)", ylim=(-0.6, len(mine) - 0.4), title=title
        )
        axes.title.set_fontsize(9)
        low, high = axes.get_xlim()
        axes.set_xlim(min(low, 800 / goal), max(high, 1300 / goal))
        plain_log(axes.xaxis)
    marks = [
        Line2D([], [], marker="o", color="#56B4E9", linestyle="none", markersize=4, label="a frame"),
        Line2D([], [], color="black", linewidth=2, label="median"),
        Line2D([], [], color="black", linewidth=1, linestyle=":", label="99 %"),
        Line2D([], [], color=BAD, linewidth=1.2, label="the goal: 60 and 30 frames a second"),
    ]
    figure.legend(handles=marks, loc="outside upper right", ncols=4, frameon=False, fontsize=9)
    return figure


def note(result: Row) -> str:
    cpu = machine.name(result.get("context"))
    tiles = (
        " (in its tiles where a phase can, before they leave the cache: to the byte what is displayed of the "
        "picture whose errors stand here)"
        if any(row.get("presented_by") == PHASE for row in result["rows"])
        else ""
    )
    return (
        f"{cpu}; {result['threads']} threads, {result['launches']} interleaved launches. A frame is its "
        f"rendering, gamma and 8 bits{tiles}, all on all cores; the driver calibrates clocks between "
        f"two frames, which is in neither. Hit distance: {HALF} is half of what a pixel covers at the mean "
        f"distance of the shapes; secondary rays start {result.get('away', AWAY_ONCE)} of them off the "
        "surface then: a march within the hit distance at its first step ends there, lit, as on a floor that "
        "hardly faces the light. Errors are of these very pictures, in linear RGB, to the fastest double "
        "phase. "
        "That phase marches planes and solids, and with a coarse hit distance it stops short of them by up "
        "to that much; phases with closed forms put them where they are. So the pictures differ on the "
        "floor, in depth and, as shadows start elsewhere, in colour: there the low PSNR is the reference's. "
        "Beside it are the same over pixels that hit the bulb, which both march, and the parent that "
        "marches its floor, too."
    )


def drawings(result: dict[str, Any]) -> dict[str, Drawing]:
    caption = "Time of every frame against the goal, by phase"
    return {FIGURE: Drawing(caption, note(result), lambda: draw(result))} if result["rows"] else {}
