"""Kernels generated for a scene against the general code, as tables made from breakeven.json alone."""

from __future__ import annotations

from collections.abc import Callable

from matplotlib.figure import Figure

from study.core import show
from study.core.show import Column
from study.experiments.breakeven.measure import SMALL
from study.experiments.breakeven.schema import Breakeven, Row
from study.experiments.section import Found, left_out, part
from study.pictures import dots
from study.pictures.draw import Drawing


def _interval(name: str, unit: str = "") -> Callable[[Row], str]:
    return show.spread_of(name, unit, 4)


def frames_needed(row: Row) -> str:
    """The number with its interval, whose end may be “never”."""
    found = row.break_even_frames
    if not found:
        return show.NOTHING
    if found.value is None:
        return "never"
    if found.low is None:
        return f"{found.value:,.0f} (insufficient)"
    high = "never" if found.high is None else f"{found.high:,.0f}"
    return f"{found.value:,.0f} [{found.low:,.0f}, {high}]"


def _psnr(row: Row) -> str:
    return row.error.psnr if row.error else show.NOTHING


def columns(against: str) -> list[Column]:
    return [
        Column("", "scene", lambda r: f"{r.scene}, {r.width}×{r.n}"),
        Column("ms a frame, set-up not in it [95 %]", against, _interval("general_ms")),
        Column("ms a frame, set-up not in it [95 %]", "kernel", _interval("generated_ms")),
        Column("", "gain [95 %]", _interval("gain", "×")),
        Column("", "PSNR of the two pictures, dB", _psnr),
        Column("set-up, once a scene", "compiling, s", show.plain("compile_s")),
        Column("set-up, once a scene", "of all, s", show.plain("setup_s")),
        Column("set-up, once a scene", "kernel in the cache, ms", show.plain("setup_found_ms", 2)),
        Column("", "breaks even after, frames", frames_needed),
    ]


NONE = [Column("", "scene", lambda r: r.scene), Column("", "why", lambda r: r.reason)]
NEVER = Column("", "breaks even after, frames", lambda r: "never: no kernel")


def note(result: Breakeven) -> str:
    compilers = dict.fromkeys(row.compiler for row in result.rows if row.compiler)
    by = f"; kernels by {', '.join(compilers)}" if compilers else ""
    return (
        f"{result.machine}; one thread, {result.launches} interleaved launches{by}. {result.phase} compiles "
        "its code anew for a scene, once, while it sets up, and keeps that in a cache: no frame's time has "
        f"this in it. Pictures of both at n = {SMALL} are compared in linear RGB."
    )


FOOT = (
    "Frames to break even: all of the first set-up over what a frame gains. Later launches find the kernel "
    "in the cache and gain from their first frame on."
)


def draw(rows: list[Row]) -> Figure:
    shown = []
    for row in rows:
        assert row.gain
        text = f"paid after {frames_needed(row)} frames"
        shown.append(dots.of(row.gain, "", f"{row.scene}, n = {row.n}", text, True))
    title = "Gain of a kernel generated for the scene"
    return dots.draw(shown, title, "times as fast as the general code", True)


def answer(rows: list[Row]) -> str:
    """When the first scene's kernel has paid; on how many scenes one gains."""
    first = rows[0]
    gaining = sum(row.gain.ends[1] > 1 for row in rows if row.gain)
    return (
        f"On {first.scene} at n = {first.n} the kernel is {_interval('gain', '×')(first)} as fast as "
        f"the general code, {show.decibels(_psnr(first))} apart. It has paid for its "
        f"{first.compile_s:.1f} s of compilation after {frames_needed(first)} frames. "
        f"Kernels gain on {gaining} of {len(rows)} scenes and sizes."
    )


def found(result: Breakeven) -> Found:
    """Kernels for scenes: what they gain, what compiling costs, after how many frames it has paid."""
    made = [row for row in result.rows if row.generated]
    without = [row for row in result.rows if not row.generated]
    caption = "When a kernel generated for a scene has paid for its compilation"
    parts = [
        *part("breakeven", caption, made, columns(result.against), FOOT),
        *part("breakeven-none", "No kernel: the general code runs", without, [*NONE, NEVER]),
        *left_out("breakeven-left-out", result.left_out),
    ]
    if not made:
        return Found(parts)
    caption = "What a generated kernel gains, and when it has paid"
    return Found(parts, answer(made), {"breakeven": Drawing(caption, note(result), lambda: draw(made))})
