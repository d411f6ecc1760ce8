"""Files that set other programs beside our phases: original.json and peers.json."""

from pathlib import Path
from typing import Annotated, ClassVar

from study.core.schema import Record, key
from study.numbers.schema import Interval, Measured, PictureErrors, Skipped

ORIGINAL, PEERS = "original.json", "peers.json"
PLAIN = "scene0_plain", "mandelbulb_plain"  # scenes without shadows and mirrors, which most peers draw
NO_SLOWER = 1.03  # our baseline's time over the paper's, at the most


class OriginalRow(Record, kw_only=True):
    """One phase and scene: the paper's program of that step and ours, timed in turn on one CPU."""

    phase: Annotated[str, key("", "of ours; the paper's step has its name")]
    scene: Annotated[str, key("", "its name")]
    commit: Annotated[str | None, key("", "of the paper's step")] = None
    n: Annotated[int, key("pixels", "height of the picture", ge=1)]
    width: Annotated[int | None, key("pixels", "of the picture")] = None
    theirs_launches_ms: Annotated[list[float], key("ms", "one per launch: one frame by the timer")]
    ours_launches_ms: Annotated[list[float], key("ms", "the same of ours")]
    theirs_ms: Annotated[Interval | None, key("ms", "the paper's program")] = None
    ours_ms: Annotated[Interval | None, key("ms", "our phase")] = None
    ours_over_theirs: Annotated[Interval, key("×", "ratio of the medians; under 1: ours is faster")]
    psnr_display_db: Annotated[float | None, key("dB", "pictures as displayed; null: identical")] = None
    fraction_over_1_255: Annotated[float | None, key("share of pixels", "over 1/255 apart")] = None
    largest: Annotated[int | None, key("steps of 1/255", "the largest difference")] = None


class Original(Measured, kw_only=True):
    """The paper's own program beside baseline to opt4."""

    made_by: ClassVar[str] = "original"
    repository: Annotated[str | None, key("", "that the paper's program was fetched from")] = None
    rows: Annotated[list[OriginalRow], key("", "phases and scenes", min_length=1)]


class PeerRow(PictureErrors, kw_only=True):
    """One program on one scene, on so many threads. Errors are to ground truth."""

    program: Annotated[str, key("", "a phase or a peer")]
    kind: Annotated[str, key("", "`phase` or `peer`")]
    scene: Annotated[str, key("", "its name; `_plain`: without shadows and mirrors")]
    threads: Annotated[int, key("threads", "that drew it", ge=1)]
    ns: Annotated[list[float], key("ns", "one per launch: median of its frames")]
    ms: Annotated[Interval, key("ms", "a frame; `timed` says what is in it")]
    beside: Annotated[str | None, key("", "the phase that it is held against; null: none drew it")]
    ratio: Annotated[Interval | None, key("×", "its time over that phase's; null: is that phase")]
    psnr_display_db: Annotated[float | None, key("dB", "pictures as displayed")] = None
    surface_db: Annotated[float | None, key("dB", "to a Mandelbulb's exact surface")] = None


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
    rows: Annotated[list[PeerRow], key("", "programs, scenes and threads")]
    left_out: Annotated[list[Skipped], key("", "what could not be had or drawn; `phase`: its name")]


def originals(run: Path) -> list[OriginalRow]:
    """The rows of a run's original.json; none without it. Raises StudyError."""
    found = Original.load_if_there(run / ORIGINAL)
    return found.rows if found else []


def held_beside(run: Path) -> bool:
    """Whether the run's baseline was timed beside the paper's program and was no slower (3 %)."""
    ratios = [row.ours_over_theirs.value for row in originals(run) if row.phase == "baseline"]
    return bool(ratios) and all(one is not None and one <= NO_SLOWER for one in ratios)
