"""The scene whose shapes move, frame by frame: the distribution of the frames' times, update and all.

The driver appends a line for each frame to a file of the run's folder; a run that was interrupted goes on
behind the last whole one.
"""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import json
import os
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from study.core import cli, machine, registry, run, show, temporary
from study.core.build import build
from study.core.cli import StudyError
from study.core.registry import Scene
from study.core.show import Column
from study.experiments.rods import measure as rods
from study.pictures.gallery import sha256
from study.truth import truth

Row = dict[str, Any]
MOVING = "spheres40_animated"
FOLDER = "animation"  # of a run's: files of frames, until what they are for is written
STILL = 360  # rows, at most, of the picture at its beginning that is held against truth
OURS = "STEPWISE_"  # begins what the environment says to a driver


@contextlib.contextmanager
def environment(wanted: Mapping[str, str]) -> Iterator[None]:
    """Drivers started within have these variables; not for several threads."""
    before = {key: os.environ.get(key) for key in wanted}
    os.environ.update(wanted)
    try:
        yield
    finally:
        for key, value in before.items():
            if value is None:
                del os.environ[key]
            else:
                os.environ[key] = value


def file_of(keep: Path, phase: str, scene: Scene, size: tuple[int, int], threads: int) -> Path:
    """Where the frames of this are kept: by program, scene, settings, size, threads and CPU, not their
    number."""
    said = {k: v for k, v in sorted(os.environ.items()) if k.startswith(OURS) and k != run.UNTIMED}
    about = {"program": sha256(build(phase)), "scene": sha256(scene.path), "said": said}
    about |= {
        "size": size,
        "threads": threads,
        "cpus": run.USABLE,
        "cpu": machine.name({"cpu": machine.cpu()}),
    }
    made_of = json.dumps(about, sort_keys=True)
    return keep / FOLDER / f"{phase}-{hashlib.sha256(made_of.encode()).hexdigest()[:12]}.jsonl"


def lines_of(file: Path) -> list[Row]:
    """The frames in it, warm-up ones too. Raises StudyError for a line that is none, and where the timed
    frames are not 0, 1, 2 … each once."""
    found: list[Row] = []
    due = 0
    for number, line in enumerate(file.read_bytes().splitlines(), 1):
        try:
            row = json.loads(line)
            right = row["warmup"] or row["frame"] == due
        except (ValueError, TypeError, KeyError):
            right = False
        if not right:
            raise StudyError(f"{file}:{number}: not the line of frame {due}; remove the file to begin again")
        due += not row["warmup"]
        found.append(row)
    return found


@contextlib.contextmanager
def _appended(file: Path) -> Iterator[int]:
    """It, open for appending, of this process alone, a last line that was cut off dropped."""
    end = _opened(file)
    try:
        os.ftruncate(end, file.read_bytes().rfind(b"\n") + 1)
        yield end
    finally:
        os.close(end)


def _opened(file: Path) -> int:
    """It, open and locked. What another process's forget() removes meanwhile is made anew, a few times."""
    for attempt in range(11):
        try:
            file.parent.mkdir(parents=True, exist_ok=True)
            end = os.open(file, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o644)
        except OSError as error:
            if isinstance(error, FileNotFoundError) and attempt < 10:
                continue  # the folder
            raise StudyError(f"{file}: {error.strerror or error}") from None
        try:
            _lock(end, file)
            with contextlib.suppress(FileNotFoundError):
                if os.path.samestat(os.fstat(end), file.stat()):
                    return end
        except BaseException:
            os.close(end)
            raise
        os.close(end)
    raise StudyError(f"{file}: another process removes it again and again")


def _lock(end: int, file: Path) -> None:
    """The driver has the same open file: until it is gone, too, nobody else has the lock. That of a run
    which was killed is given a second."""
    for attempt in range(11):
        try:
            return fcntl.flock(end, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            time.sleep(0.1 if attempt < 10 else 0)
    raise StudyError(f"{file}: another process is measuring into it")


def _measured(
    phase: str, scene: Scene, size: tuple[int, int], frames: int, threads: int, keep: Path
) -> tuple[list[Row], int]:
    """The lines of the first `frames` frames: those that are kept, how many, and the others measured now."""
    file = file_of(keep, phase, scene, size, threads)
    with _appended(file) as end:
        done = sum(not line["warmup"] for line in lines_of(file))
        if done:
            rest = "; goes on behind them" if done < frames else ""
            cli.say(f"{file}: {min(done, frames)} of {frames} frames are there{rest}")
        if done < frames:
            first = {"first_frame": done} if done else {}
            cli.say(f"{phase}: {frames - done} frames of {size[0]}×{size[1]}, {threads} threads")
            about = {"animation": frames, "warmup": 2, "threads": threads, "timed": False}
            about["cpu"] = run.FASTEST
            run.frames_into(end, phase, scene.path, size[1], size[0], **about, **first)
        return [line for line in lines_of(file) if line["frame"] < frames], min(done, frames)


def forget(keep: Path, phases: Iterable[str]) -> None:
    """Removes the frames kept of these: what they were for is written, the next run measures anew. A file
    into which another process is measuring stays."""
    for phase in phases:
        for file in (keep / FOLDER).glob(f"{phase}-{'[0-9a-f]' * 12}.jsonl"):
            with contextlib.suppress(OSError), file.open("rb+") as kept:  # what stays does no harm
                fcntl.flock(kept, fcntl.LOCK_EX | fcntl.LOCK_NB)
                file.unlink()
    with contextlib.suppress(OSError):  # others' are in it, or it is not there
        (keep / FOLDER).rmdir()


def resumed(lines: Sequence[Row]) -> list[int]:
    """The frames at which another process went on: those behind a process's first frame, but for frame 0."""
    begins = [i for i, line in enumerate(lines) if line["first"]]
    timed = (next((x["frame"] for x in lines[i:] if not x["warmup"]), 0) for i in begins)
    return sorted({frame for frame in timed if frame})


def still_error(phase: str, scene: Scene, n: int) -> Row:
    """How far the picture of the beginning is from truth, of `n` rows, STILL at most. Raises StudyError."""
    size = scene.size(min(n, STILL))
    found = rods.errors(truth.picture(scene, size), rods.picture(phase, "", scene, size))
    return {key: found[key] for key in ("psnr_db", "wrong_ppm")} | {"width": size[0], "n": size[1]}


def error_said(error: Row | None) -> str:
    """For a row of the table of all systems; an older file has none."""
    if not error:
        return show.NOTHING
    psnr = "identical" if error["psnr_db"] is None else f"{error['psnr_db']:.1f} dB"
    return (
        f"{psnr}, {error['wrong_ppm']:,.0f} ppm wrong hits (its beginning at {error['width']}×{error['n']})"
    )


def animation(
    phase: str, frames: int, n: int, threads: int, keep: Path | None = None, scene: Scene | None = None
) -> Row:
    """MOVING, or `scene`, from its beginning, at `n` pixels' height: times in ms. Raises StudyError.

    `keep`: a folder where frames outlive an interruption; forget(keep, …) when the row is written.
    """
    scene = scene or registry.animated()[MOVING]
    size = scene.size(n)
    with contextlib.ExitStack() as stack:
        folder = keep or stack.enter_context(temporary.folder())
        lines, reused = _measured(phase, scene, size, frames, threads, folder)
    timed = [line for line in lines if not line["warmup"]]
    ms = np.array([line["ns"] for line in timed]) / 1e6
    update = np.array([line["update_ns"] for line in timed]) / 1e6
    found = {f"p{p}": float(np.percentile(ms, p)) for p in (5, 50, 95)}
    found |= {"mean": float(ms.mean()), "most": float(ms.max())}
    per = {"core_ns_per_pixel": found["mean"] * 1e6 * threads / (size[0] * n)}
    about = {"phase": phase, "settings": timed[0]["settings"], "threads": threads, "frames": frames}
    return about | {"width": size[0], "n": n, "ms": found, "update_ms": float(np.median(update)), **per,
                    "resumed_at": resumed(lines), "reused": reused, "all_ms": ms.tolist()}  # fmt: skip


def thread_counts() -> Sequence[int]:
    """One, and as many as there are."""
    return [1] + ([len(run.USABLE)] if len(run.USABLE) > 1 else [])


def frames_said(row: Row) -> str:
    """How many, of which size; how many an earlier start had measured; where it was interrupted."""
    rest = f", {row['reused']:,} of an earlier start" if row.get("reused") else ""
    rest += "".join(f", resumed at {frame:,}" for frame in row.get("resumed_at", []))
    return f"{row['frames']:,} at {row['width']}×{row['n']}{rest}"


def processes_said(row: Row) -> str:
    """How many launches its frames are of: one has no interval between launches."""
    again = len(row.get("resumed_at", []))
    many = f"{row['frames']:,} frames"
    return f"{again + 1} processes of {many} together" if again else f"one process of {many}"


def mean_said(row: Row) -> str:
    """The mean of a row's own frames, the time that 95 % of them are under, and the mean of those that all
    rows have (fixed.with_common): only the last compares rows of different numbers of frames."""
    common = ""
    if row.get("common_ms") is not None:
        common = (
            f"; of the first {row['common_frames']:,} frames, which all its rows have: "
            f"{show.number(row['common_ms'])}"
        )
    ms = row["ms"]
    return f"mean {show.number(ms.get('mean'))} (95 % of frames under {show.number(ms['p95'])} ms){common}"


def per_article(row: Row, said: Row) -> str:
    """Ours over the article's pixels per core and second; of as many frames as the article's alone, for what
    the frames show drifts."""
    if tuple(row.get(key) for key in ("frames", "width", "n")) != (
        said["frames"],
        said["width"],
        said["height"],
    ):
        return show.NOTHING
    theirs = said["ms"] * 1e6 * said["cores"] / (said["width"] * said["height"])
    return f"{show.number(theirs / row['core_ns_per_pixel'])}× its pixels per core and second"


NOTE = (
    "A row is one process of so many frames: each is much like the one before, so that they are no "
    "independent samples, and between launches there is no interval."
)
COLUMNS = [
    Column("", "phase", lambda r: r["phase"]),
    Column("", "threads", lambda r: str(r["threads"])),
    Column("", "frames", frames_said),
    Column("ms a frame, update and all", "mean", lambda r: show.number(r["ms"].get("mean"), 4)),
    *(Column("ms a frame, update and all", name, lambda r, k=key: show.number(r["ms"].get(k)))
      for name, key in (("median", "p50"), ("5 %", "p5"), ("95 %", "p95"), ("most", "most"))),
    Column("", "update, ms", lambda r: show.number(r["update_ms"], 2)),
    Column("", "core·ns a pixel", lambda r: show.number(r["core_ns_per_pixel"])),
    Column("", "error to truth", lambda r: error_said(r.get("error"))),
]  # fmt: skip


def sentence(row: Row) -> str:
    """For a terminal."""
    ms = row["ms"]
    return (
        f"animation, {row['phase']}, {row['threads']} threads, {frames_said(row)}: {ms['p50']:.3g} ms a "
        f"frame ({ms['p5']:.3g} to {ms['p95']:.3g}, at most {ms['most']:.3g})"
    )
