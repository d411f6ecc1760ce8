"""What the back ends that count share: a measurement from what the driver printed, and the known work."""

import hashlib
import json
import os
import signal
import subprocess
from collections.abc import Callable, Iterable, Mapping
from importlib import metadata
from pathlib import Path
from typing import Any

import msgspec

from study.core import machine, store
from study.core.cli import CANNOT_RUN, StudyError
from study.core.host import child
from study.core.registry import Scene, Spec
from study.core.run import GENERAL, UNTIMED, _arguments
from study.counting.counts import Counts
from study.counting.schema import Executed, Measurement, Picture

REGION = "phase_render"  # the timed region
TARGETS = {"shipped": "render", "calls": "render-calls"}  # by variant: the programs that are run unchanged


def command(spec: Spec, scene: Scene, height: int, variant: str) -> list[str]:
    """The driver's command for one picture, its JSON on standard output."""
    wide, high = scene.size(height)
    return [*_arguments(spec, scene.path.resolve(), high, wide, target=TARGETS[variant]), "--json"]


def measurement(
    backend: str,
    variant: str,
    printed: str | Mapping[str, Any],
    total: Counts,
    functions: Mapping[str, Counts] | None = None,
    outside: Mapping[str, Counts] | None = None,
    edges: dict[str, dict[str, int]] | None = None,
    calibrated: bool | None = None,
) -> Measurement:
    """Counts with what the driver printed of its picture, and this CPU. StudyError if it printed none."""

    def executed(several: Mapping[str, Counts]) -> dict[str, Executed]:
        return {name: counts.executed() for name, counts in several.items()}

    try:
        data = json.loads(printed) if isinstance(printed, str) else printed
        about = msgspec.structs.asdict(msgspec.convert(data, Picture))
    except (ValueError, msgspec.ValidationError):
        raise StudyError(f"{backend}: the program printed no JSON object of a picture") from None
    return Measurement(
        **about,
        backend=backend,
        variant=variant,
        total=total.executed(),
        functions=executed(functions or {}),
        outside=None if outside is None else executed(outside),
        edges=edges or {},
        calibrated=calibrated,
        cpu=machine.cpu().model,
    )


def run(command: list[str], program: str, under: str, **how: Any) -> subprocess.CompletedProcess[str]:
    """A program under a counter. StudyError, with the last words, if it ends badly."""
    how = {"env": os.environ | GENERAL | {UNTIMED: "1"}, "stdin": subprocess.DEVNULL} | how
    try:
        done = child.run(command, capture_output=True, text=True, errors="replace", **how)
    except OSError as error:
        raise StudyError(f"{command[0]}: {error.strerror}", CANNOT_RUN) from None
    if status := done.returncode:
        ended = f"killed by {signal.Signals(-status).name}" if status < 0 else f"exit status {status}"
        words = [line for line in done.stderr.splitlines() if line.strip()]
        raise StudyError(f"{program} under {under}: {ended}{f' ({words[-1]})' if words else ''}")
    return done


def known_work(
    cache: Path, files: Iterable[Path], parts: Iterable[str], calibrate: Callable[[str], list[str]]
) -> bool:
    """Whether `calibrate` finds no difference in any of the parts. `cache` keeps that there was none, until
    one of `files`, this package or its decoder changes.
    """
    parts = list(parts)
    key = hashlib.sha256(repr([parts, metadata.version("iced-x86")]).encode())
    for path in [*files, *sorted(Path(__file__).parent.glob("*.py"))]:
        key.update(path.read_bytes())
    if cache.exists() and cache.read_text() == key.hexdigest():
        return True
    known = not any([line for part in parts for line in calibrate(part)])
    if known:
        store.write_text(cache, key.hexdigest())
    return known
