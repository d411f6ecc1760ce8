"""The scene whose shapes move, frame by frame: the distribution of the frames' times, update and all.

The driver appends a line for each frame to a file of the run's folder. A run that was interrupted goes on
behind the last whole one.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TypeVar

import msgspec
import numpy as np

from study.core import cli, machine, registry, run, temporary
from study.core.build import build
from study.core.cli import StudyError
from study.core.registry import Scene
from study.measuring import hits
from study.measuring.launches import Size, Told
from study.measuring.schema import Animation, FrameErrors, Spread
from study.pictures.gallery import sha256
from study.truth import truth

MOVING = "spheres40_animated"
FOLDER = "animation"  # of a run's: files of frames, until what they are for is written
STILL = 360  # rows, at most, of the picture at its beginning that is held against truth
OURS = "STEPWISE_"  # begins what the environment says to a driver
QUARTER = 4  # of the frames are timed where all of them would take minutes
Row = TypeVar("Row", bound=Animation)


class Line(msgspec.Struct):
    """What the driver writes of a frame. `first`: of its process."""

    frame: int
    warmup: bool
    first: bool
    ns: float
    update_ns: float
    settings: str


def file_of(keep: Path, phase: str, scene: Scene, size: Size, threads: int, told: Told | None = None) -> Path:
    """Where the frames of this are kept: by program, scene, settings, size, threads and CPU, not their
    number."""
    said = {k: v for k, v in os.environ.items() if k.startswith(OURS) and k != run.UNTIMED} | dict(told or {})
    about = {
        "program": sha256(build(phase)),
        "scene": sha256(scene.path),
        "said": said,
        "size": size,
        "threads": threads,
        "cpus": run.USABLE,
        "cpu": machine.name({"cpu": machine.cpu()}),
    }
    made_of = json.dumps(about, sort_keys=True)
    return keep / FOLDER / f"{phase}-{hashlib.sha256(made_of.encode()).hexdigest()[:12]}.jsonl"


def lines_of(file: Path) -> list[Line]:
    """The frames in it, warm-up ones too. StudyError unless the timed ones are 0, 1, 2 … each once."""
    found: list[Line] = []
    due = 0
    for number, text in enumerate(file.read_bytes().splitlines(), 1):
        with contextlib.suppress(msgspec.DecodeError):
            line = msgspec.json.decode(text, type=Line)
            if line.warmup or line.frame == due:
                due += not line.warmup
                found.append(line)
                continue
        raise StudyError(f"{file}:{number}: not the line of frame {due}; remove the file to begin again")
    return found


@contextlib.contextmanager
def _appended(file: Path) -> Iterator[int]:
    """It, open for appending, a last line that was cut off dropped."""
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        with file.open("ab") as kept:
            kept.truncate(file.read_bytes().rfind(b"\n") + 1)
            yield kept.fileno()
    except OSError as error:
        raise StudyError(f"{error.filename or file}: {error.strerror}") from None


def _measured(
    phase: str, scene: Scene, size: Size, frames: int, threads: int, keep: Path, told: Told | None
) -> tuple[list[Line], int]:
    """The lines of the first `frames` frames: those that are kept, how many, and the others measured now."""
    file = file_of(keep, phase, scene, size, threads, told)
    with _appended(file) as end:
        done = sum(not line.warmup for line in lines_of(file))
        if done:
            rest = "; goes on behind them" if done < frames else ""
            cli.say(f"{file}: {min(done, frames)} of {frames} frames are there{rest}")
        if done < frames:
            cli.say(f"{phase}: {frames - done} frames of {size[0]}×{size[1]}, {threads} threads")
            run.frames_into(
                end,
                phase,
                scene.path,
                size[1],
                size[0],
                cpu=run.FASTEST,
                threads=threads,
                timed=False,
                told=told,
                animation=frames,
                first_frame=done or None,
                warmup=2,
            )
        return [line for line in lines_of(file) if line.frame < frames], min(done, frames)


def forget(keep: Path, phases: Iterable[str]) -> None:
    """Removes the frames kept of these: what they were for is written, the next run measures anew."""
    for phase in phases:
        for file in (keep / FOLDER).glob(f"{phase}-{'[0-9a-f]' * 12}.jsonl"):
            file.unlink(missing_ok=True)
    with contextlib.suppress(OSError):  # others' are in it, or it is not there
        (keep / FOLDER).rmdir()


def resumed(lines: Sequence[Line]) -> list[int]:
    """The frames at which another process went on: those behind a process's first frame, but for frame 0."""
    begins = [i for i, line in enumerate(lines) if line.first]
    timed = (next((x.frame for x in lines[i:] if not x.warmup), 0) for i in begins)
    return sorted({frame for frame in timed if frame})


def still_error(phase: str, scene: Scene, n: int, told: Told | None = None) -> FrameErrors:
    """How far the picture of the beginning is from truth, of `n` rows, STILL at most. Raises StudyError."""
    size = scene.size(min(n, STILL))
    found = hits.errors(truth.picture(scene, size), hits.picture(phase, scene, size, told))
    return FrameErrors(psnr_db=found.psnr_db, wrong_ppm=found.wrong_ppm, width=size[0], n=size[1])


def animation(
    phase: str,
    frames: int,
    n: int,
    threads: int,
    keep: Path | None = None,
    scene: Scene | None = None,
    told: Told | None = None,
) -> Animation:
    """MOVING, or `scene`, from its beginning, at `n` pixels' height: times in ms. Raises StudyError.

    `keep`: a folder where frames outlive an interruption; forget(keep, …) when the row is written.
    """
    scene = scene or registry.animated()[MOVING]
    size = scene.size(n)
    with contextlib.ExitStack() as stack:
        folder = keep or stack.enter_context(temporary.folder())
        lines, reused = _measured(phase, scene, size, frames, threads, folder, told)
    timed = [line for line in lines if not line.warmup]
    ms = np.array([line.ns for line in timed]) / 1e6
    p5, p50, p95 = np.percentile(ms, (5, 50, 95)).tolist()
    mean = float(ms.mean())
    return Animation(
        phase=phase,
        settings=timed[0].settings,
        threads=threads,
        frames=frames,
        width=size[0],
        n=n,
        ms=Spread(mean=mean, p5=p5, p50=p50, p95=p95, most=float(ms.max())),
        update_ms=float(np.median([line.update_ns for line in timed])) / 1e6,
        core_ns_per_pixel=mean * 1e6 * threads / (size[0] * n),
        all_ms=ms.tolist(),
        resumed_at=resumed(lines),
        reused=reused,
    )


def thread_counts() -> Sequence[int]:
    """One, and as many as there are."""
    return [1] + ([len(run.USABLE)] if len(run.USABLE) > 1 else [])


def with_common(rows: Sequence[Row]) -> list[Row]:
    """With `common_ms`, the mean of the first `common_frames`, as many as the shortest row has: what
    the frames show drifts, so that means of different numbers of them are of different work."""
    fewest = min((len(row.all_ms) for row in rows if row.all_ms), default=0)
    return [
        msgspec.structs.replace(row, common_frames=fewest, common_ms=sum(row.all_ms[:fewest]) / fewest)
        if row.all_ms
        else row
        for row in rows
    ]
