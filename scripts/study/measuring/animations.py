"""The scene whose shapes move, frame by frame: the distribution of the frames' times, update and all."""

from collections.abc import Sequence
from typing import TypeVar

import msgspec
import numpy as np

from study.core import cli, registry, run, show
from study.core.registry import Scene
from study.core.show import Column
from study.measuring import hits, launches
from study.measuring.launches import Told
from study.measuring.schema import Animation, Article, FrameErrors, Spread
from study.truth import truth

MOVING = "spheres40_animated"
STILL = 360  # rows, at most, of the picture at its beginning that is held against truth
QUARTER = 4  # of the frames are timed where all of them would take minutes
Row = TypeVar("Row", bound=Animation)


def still_error(phase: str, scene: Scene, n: int, told: Told | None = None) -> FrameErrors:
    """How far the picture of the beginning is from truth, of `n` rows, STILL at most. Raises StudyError."""
    size = scene.size(min(n, STILL))
    found = hits.errors(truth.picture(scene, size), hits.picture(phase, scene, size, told))
    return FrameErrors(psnr_db=found.psnr_db, wrong_ppm=found.wrong_ppm, width=size[0], n=size[1])


def animation(
    phase: str, frames: int, n: int, threads: int, scene: Scene | None = None, told: Told | None = None
) -> Animation:
    """MOVING, or `scene`, from its beginning, at `n` pixels' height: times in ms. Raises StudyError."""
    scene = scene or registry.animated()[MOVING]
    size = scene.size(n)
    cli.doing(f"{phase}: {frames} frames of {size[0]}×{size[1]}, {threads} threads")
    how = {"cpu": run.FASTEST, "threads": threads, "told": told}
    made = launches.render(phase, scene.path, size[1], size[0], animation=frames, warmup=2, **how)
    ms = np.array([frame.ns for frame in made.timed]) / 1e6
    p5, p50, p95 = np.percentile(ms, (5, 50, 95)).tolist()
    mean = float(ms.mean())
    return Animation(
        phase=phase,
        settings=made.settings,
        threads=threads,
        frames=frames,
        width=size[0],
        n=n,
        ms=Spread(mean=mean, p5=p5, p50=p50, p95=p95, most=float(ms.max())),
        update_ms=float(np.median([frame.update_ns for frame in made.timed])) / 1e6,
        core_ns_per_pixel=mean * 1e6 * threads / (size[0] * n),
        all_ms=ms.tolist(),
    )


def thread_counts() -> Sequence[int]:
    """One, and as many as there are."""
    return [1] + ([len(run.USABLE)] if len(run.USABLE) > 1 else [])


def with_common(rows: Sequence[Row]) -> list[Row]:
    """Adds `common_ms`, the mean of the first `common_frames`, as many as the shortest row has: what
    the frames show drifts, so that means of different numbers of them are of different work."""
    fewest = min((len(row.all_ms) for row in rows if row.all_ms), default=0)
    return [
        msgspec.structs.replace(row, common_frames=fewest, common_ms=sum(row.all_ms[:fewest]) / fewest)
        if row.all_ms
        else row
        for row in rows
    ]


# --- as columns, beside what an article says of its own

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
    """Ours over the article's pixels per core and second, if of as many frames: what they show drifts."""
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
