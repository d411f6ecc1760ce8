"""Files of a run (results/README.md): written whole or not at all, read with their torn tail cut off."""

from __future__ import annotations

import contextlib
import datetime
import errno
import fcntl
import functools
import json
import os
import re
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec

from study.core import cli, registry, temporary
from study.core.cli import StudyError, Unwritten
from study.core.host import checkout
from study.core.json_files import content
from study.core.json_files import read_json as read_json
from study.core.json_files import stored as stored
from study.core.registry import ROOT
from study.core.run_schema import Context, Frame, Plan

if TYPE_CHECKING:
    import pandas as pd

RESULTS = ROOT / "results"
NOT_MACHINES = ("paper", "reference")
OWN_SCENES = "own-scenes"  # of a run: the scenes that were given as files
AGAIN = f"make it again with scripts/stepwise {Frame.made_by}"


def _problem(path: Path, error: OSError) -> StudyError:
    return StudyError(f"{path}: {error.strerror or error}")


def write_bytes(path: Path, data: bytes) -> None:
    """Replace `path` by `data` in one step: a reader, a kill or a full disk sees the old file or the new one.
    Raises StudyError."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with temporary.folder(path.parent, f".{path.name}.") as folder:
            with (folder / path.name).open("wb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            (folder / path.name).replace(path)
    except OSError as error:
        raise Unwritten(f"{path}: cannot be written: {error.strerror or error}") from None


def write_text(path: Path, text: str) -> None:
    write_bytes(path, text.encode())


def writable(folder: Path) -> Path:
    """`folder`, made if need be and tried with a file. Raises StudyError: before measuring, not after."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):  # without a name: nothing stays at a signal
            pass
    except OSError as error:
        raise Unwritten(f"{folder}: cannot be written to: {error.strerror or error}") from None
    return folder


def write_json(path: Path, value: Any) -> None:
    """`write_text` of indented JSON; NaN and infinity become null."""
    write_text(path, json.dumps(cli.plain(value), indent=2, allow_nan=False) + "\n")


def known_scenes(run: Path | None) -> None:
    """Makes the scenes known that an earlier command kept in a run. Raises StudyError where another scene of
    such a name is given now: a run has one of a name."""
    for path in sorted((run / OWN_SCENES).glob("*.json")) if run else []:
        registry.given(str(path))


def keep_scenes(run: Path) -> None:
    """Copies the scenes that the command line gives as files into a run, so that it can be made again."""
    for name, scene in registry.own_scenes().items():
        kept, text = run / OWN_SCENES / f"{name}.json", content(scene.path)
        if not kept.exists() or kept.read_bytes() != text:
            write_bytes(kept, text)


class Run:
    """One run's folder. Make it with `Run.create`, `Run.open` or `latest`."""

    def __init__(self, path: Path) -> None:
        self.path = Path(path)
        self._file: int | None = None

    @classmethod
    def create(cls, results_root: Path, machine_slug: str) -> Run:
        """A new folder RESULTS/MACHINE/DATE-COMMIT (UTC, so that names sort by age)."""
        stamp = datetime.datetime.now(datetime.UTC).strftime("%Y%m%d-%H%M%S")
        commit = (checkout.state().commit or "")[:7] or "nocommit"
        base = Path(results_root) / machine_slug / f"{stamp}-{commit}"
        for number in range(1, 1000):
            path = base if number == 1 else base.with_name(f"{base.name}-{number}")
            try:
                path.mkdir(parents=True)
                return cls(path)
            except FileExistsError:
                continue
            except OSError as error:
                raise _problem(path, error) from None
        raise StudyError(f"{base}: exists a thousand times over")

    @classmethod
    def open(cls, path: Path | str) -> Run:
        """An existing run; StudyError if the folder has no plan.json."""
        path = Path(path)
        if not (path / "plan.json").is_file():
            raise StudyError(f"{path}: not a run (no plan.json); a run is a folder like results/MACHINE/RUN")
        return cls(path)

    @staticmethod
    def latest(results_root: Path | str = RESULTS) -> Run:
        """The newest run of any machine below results/. The published reference does not count, nor does a
        run of other programs than phases, into which no experiment can measure."""
        found = [
            path.parent
            for path in Path(results_root).glob("*/*/plan.json")
            if path.parent.parent.name not in NOT_MACHINES
        ]
        for path in sorted(found, key=lambda path: path.name, reverse=True):
            if not re.search(rb'"programs": \[\s*\{', (path / "plan.json").read_bytes()):
                return Run(path)
        raise StudyError(f"{results_root}: no run yet; make one with scripts/stepwise sweep")

    def __str__(self) -> str:
        return str(self.path)

    @functools.cached_property
    def context(self) -> Context:
        return Context.load(self.path / "context.json")

    @property
    def plan(self) -> Plan:
        """Configurations, seed, budget, notes (plan.json), as on disk now."""
        return Plan.load(self.path / "plan.json")

    @property
    def frames_path(self) -> Path:
        return self.path / "frames.jsonl"

    def _alone(self, file: int, how: int) -> None:
        try:
            fcntl.flock(file, how | fcntl.LOCK_NB)
        except BlockingIOError:
            raise StudyError(f"{self.path}: another process is measuring into this run") from None

    def lock(self) -> None:
        """Open frames.jsonl for appending, alone, and cut off a torn last line."""
        if self._file is not None:
            return
        try:
            file = os.open(self.frames_path, os.O_RDWR | os.O_CREAT, 0o644)
            try:
                self._alone(file, fcntl.LOCK_EX)
            except StudyError:
                os.close(file)
                raise
            os.ftruncate(file, whole_lines(self.frames_path.read_bytes()))
        except OSError as error:
            raise _problem(self.frames_path, error) from None
        self._file = file

    @contextlib.contextmanager
    def still(self) -> Iterator[None]:
        """Within, no process measures into it: StudyError if one does. Changes nothing in the folder."""
        if not self.frames_path.exists():
            yield
            return
        with self.frames_path.open("rb") as file:
            self._alone(file.fileno(), fcntl.LOCK_SH)
            yield

    def append_frame(self, frame: dict[str, Any]) -> None:
        """Append one line: one write, then fsync. A full disk leaves only whole lines behind."""
        line = json.dumps(cli.plain(frame), allow_nan=False).encode() + b"\n"
        self.lock()
        assert self._file is not None
        end = os.fstat(self._file).st_size
        try:
            if os.pwrite(self._file, line, end) < len(line):  # room for a part of it only
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            os.fsync(self._file)
        except OSError as error:
            os.ftruncate(self._file, end)
            raise _problem(self.frames_path, error) from None

    def close(self) -> None:
        """Close frames.jsonl; appending opens it again."""
        if self._file is not None:
            os.close(self._file)
            self._file = None

    def lines(self) -> list[Frame]:
        """Every frame, of frames.jsonl or frames.jsonl.gz. A torn last line is dropped with a remark; any
        other broken line is a StudyError with file and line."""
        path = stored(self.frames_path)
        data = content(path) if path.exists() else b""
        whole = whole_lines(data)
        if whole < len(data):
            cli.say(f"{self.frames_path}: last line is cut off ({len(data) - whole} bytes dropped)")
        rows, decoder = [], msgspec.json.Decoder(Frame)
        for number, line in enumerate(data[:whole].splitlines(), 1):
            try:
                rows.append(decoder.decode(line))
            except msgspec.DecodeError as error:
                raise StudyError(f"{self.frames_path}:{number}: {error}; {AGAIN}") from None
        return rows

    def frames(self) -> pd.DataFrame:
        """`lines` as a table with the column `spec`, without the columns that are empty in every row."""
        import pandas as pd  # a quarter of a second, which the build of every counted phase need not wait for

        made = pd.DataFrame([msgspec.structs.asdict(one) | {"spec": one.spec} for one in self.lines()])
        return made.dropna(axis="columns", how="all")


def whole_lines(data: bytes) -> int:
    return data.rfind(b"\n") + 1


latest = Run.latest
