"""pareto.json."""

import math
from typing import Annotated, Any, ClassVar

from study.core.schema import Record, key
from study.numbers.schema import Interval, Measured, Skipped

TRUTHS = {"psnr_db": "the paper's shadow", "psnr_ideal_db": "the ideal shadow"}


class Row(Record, kw_only=True):
    """One scene, program, hit distance and step cap, on one thread. Errors are to ground truth."""

    scene: Annotated[str, key("", "its name")]
    phase: Annotated[str, key("", "with its switch: opt4+rsqrt")]
    n: Annotated[int | None, key("pixels", "height of the timed picture")] = None
    hit_distance: Annotated[float, key("scene units", "as used")]
    max_steps: Annotated[int, key("evaluations", "as used")]
    own_parameters: Annotated[bool, key("", "whether both are the scene's own")] = False
    converged_only: Annotated[bool, key("", "a fractal: its hits are not judged")] = False
    beaten_by: Annotated[dict[str, str] | None, key("", "by measure; null: timed in full")] = None
    ns_per_pixel: Annotated[Interval, key("ns", "one launch has no interval")]
    speedup: Annotated[Interval | None, key("×", "over baseline with the scene's own parameters")] = None
    threads: Annotated[int | None, key("threads", "as the driver said")] = None
    evals_per_ray: Annotated[float, key("evaluations", "of the scene, mean over camera rays")] = math.nan
    evals_per_pixel: Annotated[float, key("evaluations", "all rays, normals; null: not counted")] = math.nan
    ns_per_eval: Annotated[float, key("ns", "`ns_per_pixel` / `evals_per_pixel`")] = math.nan
    non_finite: Annotated[int, key("samples", "NaN or infinite where none may be")] = 0
    false_hits_ppm: Annotated[float, key("ppm", "of proved pixels")] = math.nan
    false_misses_ppm: Annotated[float, key("ppm", "of proved pixels")] = math.nan
    false_ppm: Annotated[float, key("ppm", "the two together")] = math.nan
    wrong_shape_ppm: Annotated[float, key("ppm", "of proved pixels")] = math.nan
    dt_p99: Annotated[float, key("scene units", "99th percentile of |Δt|")] = math.nan
    dt_max: Annotated[float, key("scene units", "its maximum")] = math.nan
    psnr_db: Annotated[float, key("dB", "to truth, of fractals' means; null: infinite if finite")] = math.nan
    psnr_ideal_db: Annotated[float, key("dB", "to truth with the ideal shadow")] = math.nan
    surface_db: Annotated[float, key("dB", "to a Mandelbulb's exact surface, of means")] = math.nan
    depth_agree_fraction: Annotated[float, key("share of pixels", "of fractals")] = math.nan

    @property
    def pace(self) -> float:
        """Nanoseconds a pixel."""
        return math.nan if self.ns_per_pixel.value is None else self.ns_per_pixel.value

    @property
    def ends(self) -> tuple[float, float] | None:
        """95 % interval of the pace; None of too few launches."""
        low, high = self.ns_per_pixel.low, self.ns_per_pixel.high
        return None if low is None or high is None or math.isnan(low + high) else (low, high)

    @property
    def timed(self) -> bool:
        """Whether it was in the running after the first launch."""
        return self.beaten_by is None

    def badness(self, measure: str) -> float:
        """An error that is better when smaller, whatever the measure; NaN where there is none."""
        if self.non_finite:
            return math.nan
        value = getattr(self, measure)
        return -value if measure in TRUTHS else value


class Winner(Record, kw_only=True):
    """The fastest program of a scene that reaches a level."""

    scene: Annotated[str, key("", "its name")]
    truth: Annotated[str, key("", "which of the two truths")]
    metric: Annotated[str, key("", "that its level is of")]
    level_db: Annotated[float, key("dB", "to be reached")]
    best: Annotated[Row | None, key("", "the row; null: none reaches it")]
    n: Annotated[int | None, key("pixels", "height of the picture")] = None
    not_told_apart_from: Annotated[list[str], key("", "programs whose interval overlaps its own")] = []


class Pareto(Measured, kw_only=True):
    """Speed against error over hit distance, step cap and approximations. Every point is drawn, judged and
    launched once. It is left at that, and `beaten_by` names what beats it, if by every measure (both PSNR,
    `false_ppm`, `dt_p99`) a point of at most its error took less than half its time. The others are timed
    anew in interleaved launches: they alone stand on a front or win a level."""

    made_by: ClassVar[str] = "pareto"
    n: Annotated[int | None, key("pixels", "height of the pictures")] = None
    antialias_n: Annotated[int | None, key("pixels", "height of fractals' averaged pictures")] = None
    seconds: Annotated[dict[str, float], key("s", "wall time by scene")] = {}
    unfinished: Annotated[list[str], key("", "scenes that a killed run did not come to")] = []
    rows: Annotated[list[Row], key("", "the points", min_length=1)]
    skipped: Annotated[list[Skipped], key("", "programs that could not run")] = []
    winners: Annotated[list[Winner], key("", "by scene, truth and level")] = []

    @classmethod
    def current(cls, data: Any) -> Any:
        """Rows without what has no value. A null PSNR is infinite, but of a picture that is not finite."""
        bests = [winner["best"] for winner in data.get("winners", []) if winner["best"]]
        for row in [*data["rows"], *bests]:
            for name in [name for name, value in row.items() if value is None]:
                if name in TRUTHS and not row.get("non_finite"):
                    row[name] = math.inf
                elif name not in ("beaten_by", "speedup"):
                    del row[name]
        return data


FILE = "pareto.json"
SCHEMAS = {FILE: Pareto}
