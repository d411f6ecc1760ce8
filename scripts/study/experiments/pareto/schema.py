"""pareto.json."""

from __future__ import annotations

from typing import Annotated, ClassVar

from study.core.schema import ABSENT, Absent, Record, key
from study.numbers.schema import Interval, Measured, Skipped


class Row(Record, kw_only=True):
    """One scene, program, hit distance and step cap, on one thread. Errors are to ground truth."""

    scene: Annotated[str, key("", "its name")]
    phase: Annotated[str, key("", "with its switch: opt4+rsqrt")]
    n: Annotated[int | Absent, key("pixels", "height of the timed picture")] = ABSENT
    hit_distance: Annotated[float, key("scene units", "as used")]
    max_steps: Annotated[int, key("evaluations", "as used")]
    own_parameters: Annotated[bool | Absent, key("", "whether both are the scene's own")] = ABSENT
    converged_only: Annotated[bool | Absent, key("", "a fractal: its hits are not judged")] = ABSENT
    beaten_by: Annotated[
        dict[str, str] | Absent | None, key("", "null: timed in full; else measure → the point that beats it")
    ] = ABSENT
    ns_per_pixel: Annotated[Interval, key("ns", "one launch has no interval")]
    speedup: Annotated[
        Interval | Absent | None, key("×", "over baseline with the scene's own parameters")
    ] = ABSENT
    threads: Annotated[int | Absent, key("threads", "as the driver said")] = ABSENT
    evals_per_ray: Annotated[
        float | Absent | None, key("evaluations", "of the whole scene's distance, mean over camera rays")
    ] = ABSENT
    evals_per_pixel: Annotated[
        float | Absent | None, key("evaluations", "of all rays and normals, lanes at work; null: not counted")
    ] = ABSENT
    ns_per_eval: Annotated[float | Absent | None, key("ns", "`ns_per_pixel` / `evals_per_pixel`")] = ABSENT
    non_finite: Annotated[int | Absent, key("samples", "NaN or infinite where none may be")] = ABSENT
    false_hits_ppm: Annotated[float | Absent | None, key("ppm", "of proved pixels")] = ABSENT
    false_misses_ppm: Annotated[float | Absent | None, key("ppm", "of proved pixels")] = ABSENT
    false_ppm: Annotated[float | Absent | None, key("ppm", "the two together")] = ABSENT
    wrong_shape_ppm: Annotated[float | Absent | None, key("ppm", "of proved pixels")] = ABSENT
    dt_p99: Annotated[float | Absent | None, key("scene units", "99th percentile of |Δt|")] = ABSENT
    dt_max: Annotated[float | Absent | None, key("scene units", "its maximum")] = ABSENT
    psnr_db: Annotated[
        float | Absent | None,
        key("dB", "to truth; of fractals averaged pictures; null: infinite, if all is finite"),
    ] = ABSENT
    psnr_ideal_db: Annotated[float | Absent | None, key("dB", "to truth with the ideal shadow")] = ABSENT
    depth_agree_fraction: Annotated[float | Absent | None, key("share of pixels", "of fractals")] = ABSENT


class Winner(Record, kw_only=True):
    """The fastest program of a scene that reaches a level."""

    scene: Annotated[str, key("", "its name")]
    truth: Annotated[str, key("", "which of the two truths")]
    metric: Annotated[str, key("", "that its level is of")]
    level_db: Annotated[float, key("dB", "to be reached")]
    best: Annotated[Row | None, key("", "the row; null: none reaches it")]
    n: Annotated[int | Absent | None, key("pixels", "height of the picture")] = ABSENT
    not_told_apart_from: Annotated[
        list[str] | Absent, key("", "programs whose interval overlaps its own")
    ] = ABSENT


class Pareto(Measured, kw_only=True):
    """Speed against error over hit distance, step cap and approximations.

    Every point is drawn, judged and launched once. It is left at that, and `beaten_by` names what beats it,
    if by every measure (both PSNR, `false_ppm`, `dt_p99`) a point of at most its error took less than half
    its time. The others are timed anew in interleaved launches: they alone stand on a front or win a level.
    """

    made_by: ClassVar[str] = "pareto"
    n: Annotated[int | Absent, key("pixels", "height of the pictures")] = ABSENT
    antialias_n: Annotated[int | Absent | None, key("pixels", "height of fractals' averaged pictures")] = (
        ABSENT
    )
    seconds: Annotated[dict[str, float] | Absent, key("s", "wall time by scene")] = ABSENT
    unfinished: Annotated[list[str] | Absent, key("", "scenes that a killed run did not come to")] = ABSENT
    rows: Annotated[list[Row], key("", "the points", min_length=1)]
    skipped: Annotated[list[Skipped] | Absent, key("", "programs that could not run")] = ABSENT
    winners: Annotated[list[Winner] | Absent, key("", "by scene, truth and level")] = ABSENT
    sentences: Annotated[list[str] | Absent, key("", "the winners in words")] = ABSENT
    summary: Annotated[list[str] | Absent, key("", "the same over all scenes")] = ABSENT


SCHEMAS = {"pareto.json": Pareto}
