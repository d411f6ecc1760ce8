"""toolchains.json."""

from typing import Annotated, ClassVar

from study.core.schema import Record, key
from study.numbers.schema import Interval, Measured, Skipped

FILE = "toolchains.json"


class Row(Record, kw_only=True):
    """One phase and scene by one compiler and set of flags, on one thread."""

    compiler: Annotated[str, key("", "gcc, clang or icx")]
    flags: Annotated[str, key("", "name of the set")]
    more: Annotated[str | None, key("", "the flags themselves, behind the phase's own")] = None
    phase: Annotated[str, key("", "its name")]
    scene: Annotated[str, key("", "its name")]
    n: Annotated[int | None, key("pixels", "height of the picture")] = None
    ms: Annotated[Interval, key("ms", "a frame")]
    speedup: Annotated[Interval, key("×", "over gcc as shipped, of the same phase and scene")]
    changed_fraction: Annotated[float | None, key("share of pixels", "any bit unlike gcc's as shipped")]
    non_finite: Annotated[int, key("samples", "NaN or infinite where none may be")]
    psnr_to_shipped_db: Annotated[float | None, key("dB", "to gcc's as shipped; null with RMSE 0: identical")]
    rmse_to_shipped: Annotated[float | None, key("linear RGB", "to gcc's as shipped")]
    truth_psnr_db: Annotated[
        float | None, key("dB", "to ground truth; absent with --no-truth; of fractals 4×4 means")
    ] = None
    truth_rmse: Annotated[float | None, key("linear RGB", "to ground truth")] = None
    truth_false_hits_ppm: Annotated[float | None, key("ppm", "of proved pixels")] = None
    truth_false_misses_ppm: Annotated[float | None, key("ppm", "of proved pixels")] = None
    truth_wrong_shape_ppm: Annotated[float | None, key("ppm", "of proved pixels")] = None
    truth_dt_p99: Annotated[float | None, key("scene units", "99th percentile of |Δt|")] = None


class Failure(Record, kw_only=True):
    """What did not build or run."""

    program: Annotated[str, key("", "phase, compiler and flags")]
    reason: Annotated[str, key("", "why")]


class Missing(Skipped, kw_only=True):
    """A compiler or phase that is not here."""

    compiler: Annotated[str | None, key("", "its name")] = None


class Toolchains(Measured, kw_only=True):
    """Every phase by compiler and flags: time, what changes, error to truth."""

    made_by: ClassVar[str] = "toolchains"
    n: Annotated[int, key("pixels", "height of the pictures", ge=1)]
    launches: Annotated[int, key("launches", "of one frame, interleaved")]
    native: Annotated[dict[str, str | None], key("", "compiler → what -march=native stands for")]
    rows: Annotated[list[Row], key("", "programs and scenes")]
    skipped: Annotated[list[Missing], key("", "compilers and phases that are not here")]
    failures: Annotated[list[Failure], key("", "what did not build or run")]


SCHEMAS = {FILE: Toolchains}
