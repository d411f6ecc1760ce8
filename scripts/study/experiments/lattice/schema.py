"""lattice.json."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar

from study.core.schema import ABSENT, Absent, key
from study.measuring.schema import HitErrors
from study.numbers.schema import Measured


class Row(HitErrors, kw_only=True):
    """One phase, size and number of threads. Errors are of pictures of `error_size`."""

    phase: Annotated[str, key("", "its name")]
    width: Annotated[int, key("pixels", "of the picture", ge=1)]
    n: Annotated[int, key("pixels", "its height", ge=1)]
    threads: Annotated[int, key("threads", "that drew it", ge=1)]
    ms: Annotated[float | None, key("ms", "median over launches")]
    ms_low: Annotated[float | Absent | None, key("ms", "lower end")] = ABSENT
    ms_high: Annotated[float | Absent | None, key("ms", "upper end")] = ABSENT
    ns: Annotated[list[float] | Absent, key("ns", "one per launch: median of its frames")] = ABSENT
    program_ms: Annotated[float | None, key("ms", "CPU-RTRM's; null: another size or number of threads")]
    program: Annotated[float | Absent | None, key("×", "that over `ms`")] = ABSENT
    program_low: Annotated[float | Absent | None, key("×", "lower end")] = ABSENT
    program_high: Annotated[float | Absent | None, key("×", "upper end")] = ABSENT
    light: Annotated[
        float | None,
        key("share of the time", "a frame is faster with the light behind all that is seen; null: not asked"),
    ]
    light_low: Annotated[float | Absent | None, key("share of the time", "lower end")] = ABSENT
    light_high: Annotated[float | Absent | None, key("share of the time", "upper end")] = ABSENT
    shading: Annotated[
        float | Absent | None,
        key("share of FLOPs", "in normals, light and colours alone: a lower bound; null: not counted"),
    ] = ABSENT


class Lattice(Measured, kw_only=True):
    """CPU-RTRM's scene by every phase, beside that program's figures."""

    made_by: ClassVar[str] = "lattice"
    threads: Annotated[list[int] | Absent, key("threads", "tried")] = ABSENT
    program: Annotated[
        dict[str, Any] | Absent,
        key("", "CPU-RTRM as others measured it: `ms` by threads at `size` on `machine`"),
    ] = ABSENT
    paper: Annotated[float | Absent, key("×", "what the paper says of its last step")] = ABSENT
    error_size: Annotated[
        list[int] | Absent, key("pixels", "width and height of pictures that errors are of")
    ] = ABSENT
    still_lit: Annotated[float | Absent, key("share of hits", "that face the moved light")] = ABSENT
    known: Annotated[float | Absent, key("share of pixels", "whose colour truth knows")] = ABSENT
    rows: Annotated[list[Row], key("", "phases, sizes, threads")]


SCHEMAS = {"lattice.json": Lattice}
