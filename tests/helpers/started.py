"""The project's scripts as processes of their own, forked from one that has imported their packages.

A script's start is half a second of importing NumPy, pandas and Matplotlib, many times what most tests of it
need. Python's own fork server (multiprocessing) imports them once and forks for each call: own process, own
arguments, environment, output and exit status, and every module of the project imported anew.
"""

from __future__ import annotations

import atexit
import multiprocessing
import os
import runpy
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

ROOT = (
    Path(__file__).resolve().parents[2]
)  # nothing of the project is imported: a test may start a copy of it
PACKAGES = ["numpy", "pandas", "matplotlib.figure", "matplotlib.backends.backend_agg"]
PACKAGES += ["matplotlib.backends.backend_svg", "OpenImageIO", "jinja2", "markdown_it", "tqdm"]
PACKAGES += ["elftools.elf.elffile", "flip_evaluator", "iced_x86", "mpmath"]
_server = multiprocessing.get_context("forkserver")
_server.set_forkserver_preload(PACKAGES)


def _child(words: list[str], folder: str, environment: dict[str, str], outputs: list[str]) -> None:
    """In the forked process: what the interpreter would have set up, then the script."""
    for number, path in enumerate([os.devnull, *outputs]):
        opened = os.open(path, os.O_RDWR)
        os.dup2(opened, number)
        os.close(opened)
    os.chdir(folder)
    os.environ.clear()
    os.environ.update(environment)
    sys.path[:] = [str(Path(words[0]).parent), *(p for p in sys.path if not _own(p))]
    sys.argv[:] = words
    try:
        runpy.run_path(words[0], run_name="__main__")
    finally:
        atexit._run_exitfuncs()
        sys.stdout.flush()


def _own(path: str) -> bool:
    """Whether modules found there are the project's, or a test's."""
    found = Path(path).resolve()
    return found == ROOT or any(ROOT / folder in (found, *found.parents) for folder in ("scripts", "tests"))


def run(
    command: Sequence[str | Path],
    *,
    env: dict[str, str] | None = None,
    cwd: Path | None = None,
    timeout: float = 300,
) -> subprocess.CompletedProcess[Any]:
    """As subprocess.run of [sys.executable, SCRIPT, argument …] with its output captured as text."""
    assert command[0] == sys.executable, command
    words = [os.fspath(word) for word in command]
    with tempfile.TemporaryDirectory(prefix="stepwise-started-") as folder:
        outputs = [Path(folder, name) for name in ("stdout", "stderr")]
        for path in outputs:
            path.touch()
        environment = dict(os.environ if env is None else env)
        paths = [str(path) for path in outputs]
        process = _server.Process(
            target=_child, args=(words[1:], os.fspath(cwd or os.getcwd()), environment, paths)
        )
        process.start()
        process.join(timeout)
        if process.exitcode is None:
            process.kill()
            process.join()
            raise subprocess.TimeoutExpired(words, timeout)
        said, errors = (path.read_text(errors="replace") for path in outputs)
        return subprocess.CompletedProcess(words, process.exitcode, said, errors)
