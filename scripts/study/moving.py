"""The scene whose shapes move, frame by frame: the distribution of the frames' times, update and all."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from study import registry, run, show
from study.show import Column

Row = dict[str, Any]
MOVING = "spheres40_animated"


@contextlib.contextmanager
def environment(wanted: Mapping[str, str]) -> Iterator[None]:
    """Drivers started within have these variables; not for several threads."""
    before = {key: os.environ.get(key) for key in wanted}
    os.environ.update(wanted)
    try:
        yield
    finally:
        for key, value in before.items():
            if value is None:
                del os.environ[key]
            else:
                os.environ[key] = value


def animation(phase: str, frames: int, n: int, threads: int) -> Row:
    """MOVING from its beginning, at `n` pixels' height: times in ms. Raises StudyError."""
    scene = registry.animated()[MOVING]
    size = scene.size(n)
    record = run.render(
        phase, scene.path, n, size[0], animation=frames, warmup=2, threads=threads, timed=False
    )
    ms = np.array([f["ns"] for f in record["frames"] if not f["warmup"]]) / 1e6
    update = np.array([f["update_ns"] for f in record["frames"] if not f["warmup"]]) / 1e6
    found = {f"p{p}": float(np.percentile(ms, p)) for p in (5, 50, 95)} | {"most": float(ms.max())}
    per = {"core_ns_per_pixel": found["p50"] * 1e6 * threads / (size[0] * n)}
    about = {"phase": phase, "settings": record["settings"], "threads": threads, "frames": frames}
    return about | {"width": size[0], "n": n, "ms": found, "update_ms": float(np.median(update)), **per,
                    "all_ms": ms.tolist()}  # fmt: skip


def thread_counts() -> Sequence[int]:
    """One, and as many as there are."""
    return [1] + ([len(run.USABLE)] if len(run.USABLE) > 1 else [])


COLUMNS = [
    Column("", "phase", lambda r: r["phase"]),
    Column("", "threads", lambda r: str(r["threads"])),
    Column("", "frames", lambda r: f"{r['frames']} at {r['width']}×{r['n']}"),
    *(Column("ms a frame, update and all", name, lambda r, k=key: show.number(r["ms"][k]))
      for name, key in (("median", "p50"), ("5 %", "p5"), ("95 %", "p95"), ("most", "most"))),
    Column("", "update, ms", lambda r: show.number(r["update_ms"], 2)),
    Column("", "core·ns a pixel", lambda r: show.number(r["core_ns_per_pixel"])),
]  # fmt: skip


def sentence(row: Row) -> str:
    """For a terminal."""
    ms = row["ms"]
    return (
        f"animation, {row['phase']}, {row['threads']} threads: {ms['p50']:.3g} ms a frame "
        f"({ms['p5']:.3g} to {ms['p95']:.3g}, at most {ms['most']:.3g})"
    )
