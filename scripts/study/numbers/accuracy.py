"""accuracy.json: errors of each phase to ground truth."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import msgspec

from study.core.schema import Record, key
from study.numbers.schema import DEPTH_AGREES, DT_P99, Result, Skipped

FILE = "accuracy.json"


class Colours(Record, kw_only=True):
    """Errors of colours to three pictures of truth: the paper's shadow estimator in exact arithmetic, the
    ideal soft shadow, and no shadows. A null PSNR is infinite where its RMSE is a number."""

    psnr_db: Annotated[float, key("dB", "to truth with the paper's estimator, linear RGB")] = math.nan
    psnr_display_db: Annotated[float, key("dB", "the same as displayed")] = math.nan
    rmse: Annotated[float, key("linear RGB", "to that truth")] = math.nan
    fraction_over_1_255: Annotated[float, key("share of pixels", "off by over 1/255")] = math.nan
    fraction_over_1_255_display: Annotated[float, key("share of pixels", "as displayed")] = math.nan
    max_abs: Annotated[float, key("linear RGB", "largest difference")] = math.nan
    psnr_ideal_db: Annotated[float, key("dB", "to truth with the ideal soft shadow")] = math.nan
    psnr_ideal_display_db: Annotated[float, key("dB", "the same as displayed")] = math.nan
    rmse_ideal: Annotated[float, key("linear RGB", "to that truth")] = math.nan
    psnr_none_db: Annotated[float, key("dB", "both without shadows")] = math.nan
    psnr_none_display_db: Annotated[float, key("dB", "the same as displayed")] = math.nan
    rmse_none: Annotated[float, key("linear RGB", "both without shadows")] = math.nan


class Surface(Colours, kw_only=True):
    """Errors to a Mandelbulb's exact surface, whose hits are proved: colours, `psnr_db` with the paper's
    estimator and `psnr_ideal_db` with the ideal shadow, by the scene's own normals at the proved points."""

    proved_fraction: Annotated[float, key("share of pixels", "camera ray proved")] = math.nan
    proved_hits: Annotated[int, key("pixels", "of these, hits")] = 0
    lost_ppm: Annotated[float, key("ppm", "of proved pixels: the hit is missed, or over 1e-3 behind")] = (
        math.nan
    )
    wrong_ppm: Annotated[float, key("ppm", "the hit is over 1e-3 before the surface")] = math.nan
    normal_p50_degrees: Annotated[float, key("degrees", "median angle to a Mandelbulb's exact normal")] = (
        math.nan
    )
    antialiased: Annotated[Colours | None, key("", "the same errors of 4×4 means")] = None


class Row(Colours, kw_only=True):
    """One phase and scene against ground truth (truth). Colours are of the pixels that truth knows."""

    phase: Annotated[str, key("", "its name")]
    scene: Annotated[str, key("", "its name")]
    kind: Annotated[str, key("", "`fractal` or `smooth`")] = msgspec.field(name="class", default="")
    width: Annotated[int, key("pixels", "of the picture", ge=1)]
    height: Annotated[int, key("pixels", "of the picture", ge=1)]
    precision: Annotated[str | None, key("", "float or double")] = None
    converged_only: Annotated[bool, key("", "a fractal, marched: judged by `antialiased` and depth")] = False
    non_finite: Annotated[int, key("samples", "NaN or infinite where none may be")] = 0
    proved_fraction: Annotated[float, key("share of pixels", "camera ray proved")] = math.nan
    proved_chain_fraction: Annotated[float, key("share of pixels", "and every mirror ray")] = math.nan
    converged_pixels: Annotated[int, key("pixels", "camera ray marched")] = 0
    undecided_pixels: Annotated[int, key("pixels", "camera ray neither")] = 0
    unjudged_colours: Annotated[int, key("pixels", "for which truth has no colour")] = 0
    false_hits_ppm: Annotated[float, key("ppm", "of proved pixels: hit where truth misses")] = math.nan
    false_misses_ppm: Annotated[float, key("ppm", "miss where truth hits")] = math.nan
    wrong_shape_ppm: Annotated[float, key("ppm", "another shape where both hit")] = math.nan
    beyond_outlines: Annotated[dict[str, float] | None, key("ppm", "over `outline_pixels` off")] = None
    dt_p99: Annotated[float, key("scene units", DT_P99)] = math.nan
    dt_max: Annotated[float, key("scene units", "its maximum")] = math.nan
    dt_p99_of_as_many: Annotated[float, key("scene units", "of as many as baseline has right")] = math.nan
    normal_p99_degrees: Annotated[float, key("degrees", "angle between normals there")] = math.nan
    depth_agree_fraction: Annotated[float, key("share of pixels", DEPTH_AGREES)] = math.nan
    flip_mean: Annotated[float, key("", "FLIP of the display pictures, mean")] = math.nan
    flip_max: Annotated[float, key("", "its maximum")] = math.nan
    antialiased: Annotated[Colours | None, key("", "the same errors of 4×4 means, fractals")] = None
    surface: Annotated[Surface | None, key("", "errors to a Mandelbulb's exact surface")] = None
    shadow_rmse: Annotated[float, key("linear RGB", "of what the shadow takes, estimator")] = math.nan
    shadow_ideal_rmse: Annotated[float, key("linear RGB", "the same, ideal shadow")] = math.nan
    bad_pixels: Annotated[int, key("pixels", "off by over 1/255, or a wrong hit")] = 0
    bad_silhouette: Annotated[float, key("share of bad pixels", "a neighbour has another shape")] = math.nan
    bad_edge: Annotated[float, key("share of bad pixels", "normals over 30° apart")] = math.nan
    bad_shadow_boundary: Annotated[float, key("share of bad pixels", "shadow factors apart")] = math.nan
    bad_reflection: Annotated[float, key("share of bad pixels", "a mirror is seen")] = math.nan
    bad_interior: Annotated[float, key("share of bad pixels", "none of these")] = math.nan
    gated: Annotated[bool, key("", "whether the phase can fail (docs/method.md)")] = False
    judged_by: Annotated[str | None, key("", "`ideal` or `estimator`: the shadow that it draws")] = None
    to_ideal: Annotated[bool, key("", "whether FLIP, and pixels off or bad, are to the ideal shadow")] = False
    margins: Annotated[dict[str, float] | None, key("", "how much further than baseline")] = None
    worse: Annotated[list[str], key("", "metrics worse than baseline's")] = []
    why: Annotated[list[str], key("", "what is outside of the margins")] = []
    failed: Annotated[bool, key("", "whether anything is")] = False
    binary_sha256: Annotated[str | None, key("", "of the program")] = None
    truth_sha256: Annotated[str | None, key("", "of truth's picture")] = None
    picture: Annotated[str | None, key("", "side by side, below the run")] = None

    @property
    def colours(self) -> Colours:
        """The errors that a picture is judged by: of a fractal those of 4×4 means."""
        return self.antialiased if self.converged_only and self.antialiased else self

    @property
    def shown(self) -> Colours:
        """The errors to ground truth that a reader is shown: to the exact surface where that is proved."""
        return self.surface.antialiased if self.surface and self.surface.antialiased else self.colours

    @property
    def of(self) -> str:
        """What `shown` is of, for a remark behind it; "" of a solid's single samples."""
        return " (4×4)" if self.surface else " (4×4, march)" if self.converged_only else ""

    @property
    def wrong_ppm(self) -> float:
        return self.false_hits_ppm + self.false_misses_ppm + self.wrong_shape_ppm


class Left(Skipped, kw_only=True):
    """What could not be had."""

    failed: Annotated[bool, key("", "because it crashed")] = False


class Accuracy(Result, kw_only=True):
    """Errors of each phase to ground truth, per scene.

    A null PSNR is infinite where the RMSE beside it is a number, and no value where that is null too. A
    phase behind opt4 fails where it is further from truth than baseline by more than its margins.
    """

    made_by: ClassVar[str] = "accuracy"
    schema: Annotated[Literal[1], key("", "version of the form")] = 1
    flip_tool: Annotated[str | None, key("", "name and version")] = None
    picture_tool: Annotated[str | None, key("", "name and version")] = None
    rows: Annotated[list[Row], key("", "phases and scenes")]
    skipped: Annotated[list[Left], key("", "what could not be had")] = []

    @classmethod
    def current(cls, data: Any) -> Any:
        return {**data, "rows": list(map(_numbers, data["rows"]))}


SCHEMAS = {FILE: Accuracy}


def rows(run: Path) -> list[Row]:
    """Rows of a run's accuracy.json, one per phase and scene; none without that file. Raises StudyError."""
    found = Accuracy.load_if_there(run / FILE)
    return found.rows if found else []


def _numbers(row: Mapping[str, Any]) -> dict[str, Any]:
    """Numbers without what has no value; ∞ where JSON has null for it: a PSNR beside an RMSE."""
    found: dict[str, Any] = {}
    for name, value in row.items():
        if isinstance(value, dict):
            found[name] = _numbers(value)
        elif value is not None:
            found[name] = value
        elif name.startswith("psnr"):
            rmse = row.get("rmse" + name.removeprefix("psnr").removesuffix("_db").removesuffix("_display"))
            found[name] = math.nan if rmse is None else math.inf
    return found
