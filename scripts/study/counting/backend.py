"""What the back ends that count share: whose counts they are, emulated programs, and the known work."""

from __future__ import annotations

import hashlib
import json
import signal
import subprocess
from collections.abc import Callable, Iterable, Mapping
from importlib import metadata
from pathlib import Path
from typing import Any

from study.core import imports, machine, store
from study.core.cli import StudyError

_PICTURE = ("phase", "flags_from", "scene", "scene_hash", "width", "height")


def header(said: Mapping[str, Any]) -> dict[str, Any]:
    """Fields of counts.Measured from what the driver printed (picture, compiler, flags), and this CPU.

    Raises KeyError for what is no picture's.
    """
    about = {key: said[key] for key in _PICTURE} | {
        key: said.get(key) for key in ("compiler", "flags", "kernel")
    }
    return about | {"cpu": machine.cpu().get("model")}


def header_of(output: str, program: str, under: str) -> dict[str, Any]:
    """`header` of an emulated driver's standard output. StudyError if that is no picture's."""
    try:
        return header(json.loads(output))
    except (ValueError, KeyError, TypeError):
        raise StudyError(f"{program}: printed no JSON object of a picture under {under}") from None


def variant(target: str) -> str:
    """ "calls" for a build without inlining, else "shipped"."""
    return "calls" if target.endswith("calls") else "shipped"


def failed(done: subprocess.CompletedProcess, program: str, under: str, hint: str = "") -> StudyError:
    """How an emulated program ended, with its last words. `hint` goes with an unknown instruction."""
    status = done.returncode
    how = f"killed by {signal.Signals(-status).name}" if status < 0 else f"exit status {status}"
    said = [line for line in done.stderr.splitlines() if line.strip()]
    more = hint if status == -signal.SIGILL else ""
    return StudyError(f"{program} under {under}: {how}{more}{f' ({said[-1]})' if said else ''}")


def _versions(packages: Iterable[str]) -> list[tuple[str, str]]:
    """Distribution and version of what those names are imported from."""
    owners = metadata.packages_distributions()
    names = {name for package in packages for name in owners.get(package, [])}
    return [(name, metadata.version(name)) for name in sorted(names)]


def known_work(
    cache: Path,
    analysis: str,
    files: Iterable[Path],
    parts: Iterable[str],
    calibrate: Callable[[str], list[str]],
) -> bool:
    """Whether `calibrate` finds no difference in any of the parts. Kept in `cache` until something changes:

    one of `files`, the module `analysis`, what it imports of the project, or a version of another package.
    """
    parts = list(parts)
    imported = imports.closure(analysis)
    key = hashlib.sha256(repr([parts, _versions(imported.packages)]).encode())
    for path in [*files, *imported.files]:
        key.update(hashlib.sha256(path.read_bytes()).digest())
    try:
        known = store.read_json(cache)
        if known["key"] == key.hexdigest():
            return known["differences"] == []
    except (StudyError, KeyError, TypeError):
        pass  # never made, or not whole: made again
    differences = [line for part in parts for line in calibrate(part)]
    store.write_json(cache, {"key": key.hexdigest(), "parts": parts, "differences": differences})
    return not differences
