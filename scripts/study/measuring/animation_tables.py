"""Animations as columns and sentences, beside what an article says of its own."""

from __future__ import annotations

from study.core import show
from study.core.show import Column
from study.measuring.schema import Animation, Article, FrameErrors

NOTE = (
    "A row is one process of so many frames: each is much like the one before, so that they are no "
    "independent samples, and between launches there is no interval."
)


def error_said(error: FrameErrors | None) -> str:
    if not error:
        return show.NOTHING
    psnr = "identical" if error.psnr_db is None else f"{error.psnr_db:.1f} dB"
    return f"{psnr}, {error.wrong_ppm:,.0f} ppm wrong hits (its beginning at {error.width}×{error.n})"


def frames_said(row: Animation) -> str:
    return f"{row.frames:,} at {row.width}×{row.n}"


def per_article(row: Animation, said: Article) -> float | None:
    """Ours over the article's pixels per core and second; of as many frames as the article's alone, for what
    the frames show drifts."""
    if (row.frames, row.width, row.n) != (said.frames, said.width, said.height):
        return None
    return said.ms * 1e6 * said.cores / (said.width * said.height) / row.core_ns_per_pixel


def _common(row: Animation) -> str:
    if row.common_ms is None:
        return show.NOTHING
    return f"{show.number(row.common_ms, 4)} (first {row.common_frames:,})"


FRAMES = [
    Column("", "frames", frames_said),
    Column("ms a frame, update and all", "mean", lambda r: show.number(r.ms.mean, 4)),
    Column("ms a frame, update and all", "mean of the frames that all rows have", _common),
    *(
        Column("ms a frame, update and all", name, lambda r, k=key: show.number(getattr(r.ms, k)))
        for name, key in (("median", "p50"), ("5 %", "p5"), ("95 %", "p95"), ("most", "most"))
    ),
    Column("", "update, ms", lambda r: show.number(r.update_ms, 2)),
    Column("", "core·ns a pixel", lambda r: show.number(r.core_ns_per_pixel)),
    Column("", "error to truth", lambda r: error_said(r.error)),
]
