"""An animation in a result file."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np

from study.core.schema import ABSENT, Absent, Record, key
from study.numbers.schema import HitErrors


class Spread(Record, kw_only=True):
    """Milliseconds of a frame with its update."""

    mean: Annotated[float, key("ms", "of all frames")]
    p5: Annotated[float, key("ms", "5th percentile")]
    p50: Annotated[float, key("ms", "median")]
    p95: Annotated[float, key("ms", "95th percentile")]
    most: Annotated[float, key("ms", "the slowest")]


class FrameErrors(HitErrors, kw_only=True):
    """Errors of one frame to ground truth, and its size."""

    width: Annotated[int | Absent, key("pixels", "of the picture")] = ABSENT
    n: Annotated[int | Absent, key("pixels", "its height")] = ABSENT


class Animation(Record, kw_only=True):
    """The first frames of spheres40_animated by one program. One process: no interval."""

    phase: Annotated[str, key("", "its name")]
    settings: Annotated[str | Absent, key("", "how it is told to work")] = ABSENT
    threads: Annotated[int, key("threads", "that drew it")]
    frames: Annotated[int, key("frames", "drawn")]
    width: Annotated[int, key("pixels", "of the picture")]
    n: Annotated[int, key("pixels", "its height")]
    ms: Annotated[Spread, key("ms", "of a frame with its update")]
    update_ms: Annotated[float, key("ms", "of it the update, median")]
    core_ns_per_pixel: Annotated[float, key("ns", "mean × threads over pixels")]
    all_ms: Annotated[list[float] | Absent, key("ms", "every frame, in order")] = ABSENT
    resumed_at: Annotated[list[int] | Absent, key("frames", "at which another process went on")] = ABSENT
    reused: Annotated[int | Absent, key("frames", "that an earlier start had measured")] = ABSENT
    error: Annotated[FrameErrors | Absent | None, key("", "of the picture at its beginning, to truth")] = (
        ABSENT
    )
    common_frames: Annotated[int | Absent | None, key("frames", "the fewest that a row has")] = ABSENT
    common_ms: Annotated[float | Absent | None, key("ms", "mean of that many first ones")] = ABSENT


def with_mean(row: dict[str, Any]) -> dict[str, Any]:
    """A row of an older file, which had the median in the mean's place, by its frames' times."""
    if "mean" in row["ms"] or not row.get("all_ms"):
        return row
    mean = float(np.mean(row["all_ms"]))
    per = {"core_ns_per_pixel": mean * 1e6 * row["threads"] / (row["width"] * row["n"])}
    return row | {"ms": row["ms"] | {"mean": mean}} | per


def with_means(data: Any) -> Any:
    """A file with animations, as it is written today."""
    return data | {"animation": [with_mean(row) for row in data.get("animation", [])]}
