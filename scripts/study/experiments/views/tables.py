"""The tables of further views, made from views.json alone."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from study.core import show
from study.core.show import Column
from study.experiments.views.gains import ALONE, EVERYWHERE, MEDIAN, SCENE_ALONE, by_scene, level
from study.experiments.views.measure import BASE, Row
from study.measuring.views import OWN


def _text(found: Any) -> str:
    return show.spread(found, 3, "×")


def _tuned(row: Row) -> str:
    return "; ".join(f"{scene} {_text(found)}" for scene, found in row["tuned"].items()) or show.NOTHING


def _worst(row: Row) -> str:
    return (
        show.NOTHING
        if not row["worst"]
        else f"{_text(row['worst'])} {row['worst_scene']} {row['worst_view']}"
    )


def _db(name: str) -> Callable[[Row], str]:
    def text(row: Row) -> str:
        low = row[name]
        if low is None:
            return show.NOTHING
        if low["no_value"]:
            return f"not finite: {low['scene']} {low['view']}"
        own = "identical" if _infinite(low["psnr_db"]) else show.number(low["psnr_db"])
        parent = low["parent_db"]
        beside = (
            "its parent is the reference"
            if low["parent_is_reference"]
            else "parent " + ("identical" if _infinite(parent) else show.number(parent))
        )
        return f"{own} ({beside}): {low['scene']} {low['view']}"

    return text


def _infinite(value: float | None) -> bool:
    return value is None or math.isinf(value)  # JSON has null for it; what has no value has no_value


def _mark(row: Row) -> str:
    text = row["verdict"]
    if text == ALONE or text.startswith((SCENE_ALONE, "slower")):
        return "bad"
    return "good" if text == EVERYWHERE or (text.startswith(MEDIAN) and text.endswith("none")) else ""


RUNGS = [
    Column("", "phase", lambda r: r["phase"]),
    Column("", "parent", lambda r: r["parent"]),
    Column("times as fast as its parent", "tuned views [95 %]", _tuned),
    Column("times as fast as its parent", "median of the other views [95 %]", show.spread_of("median", "×")),
    Column("times as fast as its parent", "worst case [95 %]", _worst),
    Column("times as fast as its parent", "slower on", lambda r: f"{r['slower']} of {r['views']}"),
    Column(
        "times as fast as its parent", "of them by its parent's code", lambda r: str(r.get("general") or 0)
    ),
    Column("", "verdict", lambda r: r["verdict"], _mark),
    Column("lowest PSNR of all views, dB", "to ground truth", _db("to_truth")),
    Column("lowest PSNR of all views, dB", f"to {BASE} (fractals: 4×4 averaged)", _db("to_base")),
    Column("", "most wrong hits, ppm", show.plain("wrong_ppm")),
]


def _of_view(name: str) -> Callable[[Row], str]:
    return lambda row: _text(row["views"].get(name))


def _psnrs(row: Row) -> str:
    return ", ".join("∞" if one is None else show.number(one) for one in row["psnr"].values())


SCENES = [
    Column("", "phase", lambda r: r["phase"]),
    Column("", "scene", lambda r: r["scene"]),
    *[
        Column("times as fast as its parent", f"{name} [95 %]", _of_view(name))
        for name in (OWN, "left", "right", "near")
    ],
    Column("", "PSNR of each, dB", _psnrs),
    Column("", "verdict", lambda r: r["verdict"], _mark),
]
POINTS = [
    Column("", "program", lambda r: r["phase"]),
    Column("", "scene", show.picture),
    Column("", "view", lambda r: f"{r['view']}: {r['change']}"),
    Column("", "ms a frame [95 %]", show.spread_of("ms")),
    Column("", "× parent [95 %]", show.spread_of("ratio", "×")),
    Column("", "code", lambda r: r.get("general") or ""),
    Column("error", "reference", lambda r: r["reference"] or "is it itself"),
    Column("error", "PSNR, dB", lambda r: show.NOTHING if not r["reference"] else show.number(level(r))),
    Column("error", "ideal shadow, dB", lambda r: show.number(level(r, "psnr_ideal_db"))),
    Column("error", "wrong hit, ppm", show.plain("wrong_ppm")),
    Column("error", "depth agrees", lambda r: show.share(r.get("depth_agree_fraction"))),
]
LEFT_OUT = [
    Column("", "program", lambda r: r["phase"]),
    Column("", "scene and view", lambda r: f"{r['scene']} {r['view']}" if "scene" in r else "all"),
    Column("", "why", lambda r: r["reason"]),
]


def tables(result: Row) -> list[tuple[str, str, list[Row], list[Column]]]:
    """Name, caption, rows and columns."""
    left_out = [*result["failures"], *result["left_out"]]
    size = f"times at n = {result['n']}, errors at n = {result['error_n']}"
    return [
        (
            "views",
            f"Each phase against its parent, on views it was not tuned on; {size}",
            result["rungs"],
            RUNGS,
        ),
        ("views-scenes", f"The same scene by scene; {size}", by_scene(result["rows"]), SCENES),
        ("views-points", "Every program on every view", result["rows"], POINTS),
        ("views-left-out", "Not measured", left_out, LEFT_OUT),
    ]
