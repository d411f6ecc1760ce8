"""original.json: the paper's own program beside ours."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, ClassVar

from study.core.schema import ABSENT, Absent, Record, key
from study.numbers.schema import Interval, Measured


class Row(Record, kw_only=True):
    """One phase and scene: the paper's program of that step and ours, timed in turn on one CPU."""

    phase: Annotated[str, key("", "of ours; the paper's step has its name")]
    scene: Annotated[str, key("", "its name")]
    commit: Annotated[str | Absent, key("", "of the paper's step")] = ABSENT
    n: Annotated[int, key("pixels", "height of the picture", ge=1)]
    width: Annotated[int | Absent, key("pixels", "of the picture")] = ABSENT
    theirs_launches_ms: Annotated[
        list[float] | Absent, key("ms", "one per launch: TSC time of one frame")
    ] = ABSENT
    ours_launches_ms: Annotated[list[float] | Absent, key("ms", "the same of ours")] = ABSENT
    theirs_ms: Annotated[Interval | Absent, key("ms", "the paper's program")] = ABSENT
    ours_ms: Annotated[Interval | Absent, key("ms", "our phase")] = ABSENT
    ours_over_theirs: Annotated[Interval, key("×", "ratio of the medians; under 1: ours is faster")]
    psnr_display_db: Annotated[float | Absent | None, key("dB", "pictures as displayed; null: identical")] = (
        ABSENT
    )
    fraction_over_1_255: Annotated[
        float | Absent, key("share of pixels", "over one step of 8 bits apart")
    ] = ABSENT
    largest: Annotated[int | Absent, key("steps of 1/255", "the largest difference")] = ABSENT


class Original(Measured, kw_only=True):
    """The paper's own program beside baseline to opt4."""

    made_by: ClassVar[str] = "original"
    repository: Annotated[str | Absent, key("", "that the paper's program was fetched from")] = ABSENT
    rows: Annotated[list[Row], key("", "phases and scenes", min_length=1)]


FILE = "original.json"
SCHEMAS = {FILE: Original}


def read(path: Path) -> dict[str, Any]:
    """A run's original.json. Raises StudyError for another thing's JSON."""
    return Original.read(path)


def held_beside(folder: Path) -> bool:
    """Whether the run's baseline was timed beside the paper's program and was no slower (3 %)."""
    if not (folder / FILE).exists():
        return False
    rows = [row for row in Original.read(folder / FILE)["rows"] if row["phase"] == "baseline"]
    return bool(rows) and all(row["ours_over_theirs"]["value"] <= 1.03 for row in rows)
