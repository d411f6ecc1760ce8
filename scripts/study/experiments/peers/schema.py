"""peers.json."""

from __future__ import annotations

from typing import Annotated, ClassVar

from study.core.schema import ABSENT, Absent, Record, key
from study.numbers.schema import Interval, Measured, PictureErrors, Skipped


class Row(PictureErrors, kw_only=True):
    """One program on one scene, on so many threads. Errors are to ground truth."""

    program: Annotated[str, key("", "a phase, a peer, or a step of the paper's program")]
    kind: Annotated[str, key("", "`phase`, `peer` or `paper`")]
    scene: Annotated[str, key("", "its name; `_plain`: without shadows and mirrors")]
    threads: Annotated[int, key("threads", "that drew it", ge=1)]
    ns: Annotated[list[float] | Absent, key("ns", "one per launch: median of its frames")] = ABSENT
    ms: Annotated[Interval, key("ms", "a frame; `timed` says what is in it")]
    beside: Annotated[str | None, key("", "the phase that it is held against; null: none drew it")]
    ratio: Annotated[Interval | None, key("×", "its time over that phase's; null: is that phase")]
    psnr_display_db: Annotated[float | Absent | None, key("dB", "pictures as displayed")] = ABSENT


class Program(Record, kw_only=True):
    """What a program is that is not ours."""

    program: Annotated[str, key("", "as in the rows")]
    version: Annotated[str, key("", "as it says itself")]
    timed: Annotated[str, key("", "what is in the time of a frame")]
    differs: Annotated[str, key("", "why its picture is not ours")]
    least_db: Annotated[dict[str, float], key("dB", "by scene: the PSNR below which its picture is wrong")]


class Peers(Measured, kw_only=True):
    """Our phases beside what one would use instead: times in one interleaved run, errors to ground truth."""

    made_by: ClassVar[str] = "peers"
    n: Annotated[int, key("pixels", "height of the pictures that are timed", ge=1)]
    error_n: Annotated[int, key("pixels", "height of the pictures that are judged", ge=1)]
    programs: Annotated[list[Program], key("", "that are not ours")]
    rows: Annotated[list[Row], key("", "programs, scenes and threads")]
    left_out: Annotated[list[Skipped], key("", "what could not be had or drawn; `phase`: its name")]


SCHEMAS = {"peers.json": Peers}
