"""packets.json's `animation`: shapes that move, the tree built anew before each frame and timed with it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from study.core import registry, show
from study.core.show import Column
from study.experiments.fixed import measure as fixed
from study.experiments.fixed import tables as fixed_page
from study.experiments.moving import measure as moving
from study.experiments.section import Part, part
from study.measuring import rays as packets_rays

Row = dict[str, Any]
TREES = {"BVH": "tree=bvh", "kd-tree": "tree=kd"}
COLUMNS = [
    Column("", "tree", lambda r: r["tree"]),
    *moving.COLUMNS[:4],
    fixed_page.COMMON,
    *moving.COLUMNS[4:],
]


def share(frames: int, tree: str, threads: int) -> int:
    """How many of the animation's `frames` are timed, from the first on: all by the phase's own tree on
    every core, else a quarter, which keeps the whole under two minutes or so."""
    headline = tree == next(iter(TREES)) and threads == moving.thread_counts()[-1]
    return frames if headline else max(2, frames // fixed.QUARTER)


def study(frames: int, n: int, keep: Path | None = None) -> list[Row]:
    """A row for each tree and number of threads; `keep` as moving.animation has it. Raises StudyError."""
    rows = []
    for name, words in TREES.items():
        with moving.environment({packets_rays.SETTINGS: words}):
            error = moving.still_error("packets", registry.animated()[moving.MOVING], n)
            for threads in moving.thread_counts():
                count = share(frames, name, threads)
                rows.append(
                    {"tree": name, **moving.animation("packets", count, n, threads, keep), "error": error}
                )
    return fixed.with_common(rows)


def foot(rows: list[Row]) -> str:
    """Why rows have different numbers of frames; "" where they have not."""
    most, fewest = (end(row["frames"] for row in rows) for end in (max, min))
    if most == fewest:
        return ""
    return (
        f"{most:,} frames by the phase's own tree on every core, {fewest:,} by the others, for the time it "
        "takes; what is seen drifts from frame to frame, so rows are compared by the mean of those that all "
        "have."
    )


def parts(result: Row) -> list[Part]:
    """Its table; none in a file of before there was one."""
    caption = "Packet ray tracing: an animation, the tree built anew for each frame"
    rows = fixed.with_common(result.get("animation", []))
    return part(
        "packets-animation", caption, rows, COLUMNS, f"{foot(rows)}\n{moving.NOTE}".strip() if rows else ""
    )


def sentences(result: Row) -> list[str]:
    """For a terminal."""
    return [
        f"{moving.sentence(row)}; building the {row['tree']} {row['update_ms']:.2g} ms of it"
        for row in result.get("animation", [])
    ]


def system_rows(result: Row) -> list[Row]:
    """Rows of the table of all systems, of the phase's own tree; the article with such frames is P3's."""
    said = fixed.ARTICLE
    return [
        {
            "system": "packet ray tracer (P2)",
            "what": f"{moving.MOVING} {row['width']}×{row['n']}, {moving.processes_said(row)}, ms a frame, "
            f"the {row['tree']} rebuilt, "
            f"{row['threads']} thread{'s' if row['threads'] > 1 else ''}",
            "article": f"{said['ms']} (P3's: mean of {said['frames']} frames, no shadows; {said['cpu']})",
            "ours": f"{moving.mean_said(row)}; the tree {show.number(row['update_ms'], 2)}",
            "ratio": moving.per_article(row, said),
            "error": moving.error_said(row.get("error")),
        }
        for row in fixed.with_common(result.get("animation", []))
        if row["tree"] == next(iter(TREES))
    ]
