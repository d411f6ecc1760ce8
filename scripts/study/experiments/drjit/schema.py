"""drjit.json."""

from __future__ import annotations

from typing import Annotated, ClassVar

from study.core.schema import ABSENT, Absent, key
from study.numbers.schema import Interval, Measured, PictureErrors


class Row(PictureErrors, kw_only=True):
    """One program, scene, limits of the march and number of threads. Errors are by the same limits."""

    program: Annotated[str, key("", "Dr.Jit, or a phase")]
    scene: Annotated[str, key("", "its name; without shadows")]
    limits: Annotated[str, key("", "the scene's own, or those that Dr.Jit was published with")]
    threads: Annotated[int, key("threads", "that drew it", ge=1)]
    ns: Annotated[
        list[float] | Absent, key("ns", "one per launch: median of its frames, without compiling")
    ] = ABSENT
    ms: Annotated[Interval, key("ms", "a frame")]
    ratio: Annotated[
        Interval | None, key("×", "Dr.Jit's time on as many threads over this one's; null: is Dr.Jit")
    ]
    goal: Annotated[float | None, key("×", "asked for")]
    published_ms: Annotated[
        float | None, key("ms", "Dr.Jit's own figure, of another machine; null: another size")
    ]
    verdict: Annotated[str | None, key("", "`met` where the whole interval is")]
    reference: Annotated[str, key("", "whose picture the errors are to")]
    to_own: Annotated[
        PictureErrors | Absent | None, key("", "errors to its picture by the scene's own limits")
    ] = ABSENT


class DrJit(Measured, kw_only=True):
    """Our phases beside Dr.Jit on two scenes without shadows, with the error of both."""

    made_by: ClassVar[str] = "drjit"
    n: Annotated[int, key("pixels", "height of the pictures", ge=1)]
    threads: Annotated[list[int] | Absent, key("threads", "tried")] = ABSENT
    drjit: Annotated[str, key("", "its version")]
    llvm: Annotated[str, key("", "version of the library that it compiles with")]
    rows: Annotated[list[Row], key("", "programs and scenes", min_length=1)]


SCHEMAS = {"drjit.json": DrJit}
