"""drjit.json of earlier runs: our phases and Dr.Jit by two limits of the march, as a table.

`stepwise peers` measures Dr.Jit today, by the limits that the other float programs have.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, ClassVar

from study.core import show
from study.core.schema import key
from study.core.show import Column
from study.experiments.section import Found, Section, chapter, part
from study.numbers.schema import Interval, Measured, PictureErrors

FILE, DRJIT = "drjit.json", "Dr.Jit"


class Row(PictureErrors, kw_only=True):
    """One program, scene, limits of the march and number of threads. Errors are by the same limits."""

    program: Annotated[str, key("", "Dr.Jit, or a phase")]
    scene: Annotated[str, key("", "its name; without shadows")]
    limits: Annotated[str, key("", "the scene's own, or those that Dr.Jit was published with")]
    threads: Annotated[int, key("threads", "that drew it", ge=1)]
    ms: Annotated[Interval, key("ms", "a frame")]
    ratio: Annotated[Interval | None, key("×", "Dr.Jit's time over this one's; null: is Dr.Jit")]
    published_ms: Annotated[float | None, key("ms", "Dr.Jit's own figure, of another machine")]
    reference: Annotated[str, key("", "whose picture the errors are to")]
    to_own: Annotated[PictureErrors, key("", "errors to its picture by the scene's own limits")]


class DrJit(Measured, kw_only=True):
    """Our phases beside Dr.Jit on two scenes without shadows. No command writes it any more."""

    made_by: ClassVar[str] = "peers"
    n: Annotated[int, key("pixels", "height of the pictures", ge=1)]
    drjit: Annotated[str, key("", "its version")]
    llvm: Annotated[str, key("", "version of the library that it compiles with")]
    rows: Annotated[list[Row], key("", "programs and scenes", min_length=1)]


COLUMNS = [
    Column("", "scene, no shadows", lambda r: r.scene),
    Column("", "threads", lambda r: str(r.threads)),
    Column("", "program", lambda r: r.program),
    Column("", "limits of the march", lambda r: r.limits),
    Column("", "ms [95 %]", lambda r: show.spread(r.ms)),
    Column("", f"times as fast as {DRJIT} [95 %]", lambda r: show.spread(r.ratio, 3, "×")),
    Column("", f"{DRJIT} as published, ms", lambda r: published(r)),
    Column("error by the same limits", "to", lambda r: r.reference),
    Column("error by the same limits", "PSNR, dB", lambda r: r.psnr),
    Column("error by the same limits", "depth agrees", lambda r: show.share(r.depth_agree_fraction)),
    Column("error by the scene's own", "PSNR, dB ", lambda r: r.to_own.psnr),
    Column("error by the scene's own", "wrong hit, ppm", lambda r: show.number(r.to_own.wrong_ppm)),
]  # fmt: skip


def published(row: Row) -> str:
    return show.number(row.published_ms if row.program == DRJIT else None)


def found(result: DrJit) -> Found:
    foot = (
        f"{result.machine}; n = {result.n}, {result.launches} interleaved launches; drjit {result.drjit} on "
        f"{result.llvm}. Compiling is in no time."
    )
    parts = part("drjit", "Our phases and Dr.Jit on the same scenes", result.rows, COLUMNS, foot)
    return Found(parts)


def section(run: Path) -> Section:
    return chapter("drjit", "Beside Dr.Jit", run / FILE, DrJit.load_if_there, found)
