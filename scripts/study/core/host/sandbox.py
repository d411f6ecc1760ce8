"""What is meanwhile started runs without network, with limits, and can write in the build folder alone.

By bubblewrap (bwrap), whose namespaces need no rights where the kernel lets users have them. Where it is not
installed, or the kernel refuses it, the limits alone hold. All files can be read. Memory, files and CPU time
are limited for each process, wall time for each driver.
"""

import contextlib
import shutil
import subprocess
from collections.abc import Iterator, Sequence
from pathlib import Path

TOOL = "bwrap"
GB = 1 << 30
MEMORY, FILE, CPU = 4 * GB, GB, 900  # bytes, bytes and seconds of a process
SECONDS = 300.0  # wall time of a driver (study.core.run)
NAMESPACES = (
    "--unshare-user-try",
    "--unshare-net",
    "--unshare-ipc",
    "--cap-drop",
    "ALL",
    "--die-with-parent",
)
# In a container /proc may not be mounted anew: there the sandbox's processes see the others'.
OWN_PROCESSES = ("--unshare-pid", "--proc", "/proc")

_around: list[str] = []  # words of bwrap; of none, limits alone
_limits: list[str] = []


def active() -> bool:
    return bool(_limits)


def _words(writable: Path, more: Sequence[str]) -> list[str]:
    temporary = writable / "sandbox"
    temporary.mkdir(parents=True, exist_ok=True)
    told = {"TMPDIR": temporary, "STEPWISE_CACHE": temporary / "kernels", "CCACHE_DISABLE": 1}
    return [
        *(TOOL, "--ro-bind", "/", "/", "--dev", "/dev"),
        *(() if writable.is_relative_to("/run") else ("--tmpfs", "/run")),  # sockets of daemons
        *("--bind", str(writable), str(writable), *NAMESPACES, *more),
        *(word for name, value in told.items() for word in ("--setenv", name, str(value))),
    ]


def _works(words: Sequence[str]) -> str:
    """Why bwrap cannot run a program so; "" if it can."""
    if not shutil.which(TOOL):
        return f"{TOOL} is not installed (package bubblewrap)"
    done = subprocess.run([*words, "true"], capture_output=True, text=True, errors="replace")
    said = done.stderr.strip().splitlines()
    return "" if done.returncode == 0 else said[-1] if said else f"{TOOL}: exit status {done.returncode}"


@contextlib.contextmanager
def entered(writable: Path) -> Iterator[str]:
    """Meanwhile each child of core.host.child is in it. Gives why limits alone hold, "" if all of it does."""
    global _around, _limits
    tried = [_words(writable.resolve(), more) for more in (OWN_PROCESSES, ())]
    lacking = [_works(words) for words in tried]
    _around = next((words for words, why in zip(tried, lacking, strict=True) if not why), [])
    _limits = ["prlimit", f"--as={MEMORY}", f"--fsize={FILE}", f"--cpu={CPU}", "--core=0"]
    try:
        yield "" if _around else lacking[-1]
    finally:
        _around, _limits = [], []


def around(command: Sequence[str | Path]) -> list[str | Path]:
    """The command as it is started: in the sandbox, where one is entered."""
    return [*_limits, *_around, *command]


@contextlib.contextmanager
def unlimited_memory() -> Iterator[None]:
    """Lifts the limit for a program with its own, as those of AddressSanitizer, which map terabytes."""
    global _limits
    before = _limits
    _limits = [word for word in before if not word.startswith("--as=")]
    try:
        yield
    finally:
        _limits = before


def ended(status: int) -> int:
    """A child's exit status: bwrap tells of a signal as a shell does."""
    return 128 - status if _around and status > 128 else status
