"""Launches of programs that are no phases: by common/tools/launch.c, with what hyperfine's options mean.

Options of one name mean what they mean in hyperfine (D. Peter, https://github.com/sharkdp/hyperfine). One
differs: without `--shell` programs are started directly, and commands around them by sh.
"""

import os
import re
import shlex
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import msgspec

from study.core import run
from study.core.build import build
from study.core.cli import BAD_INPUT, CANNOT_RUN, StudyError
from study.core.host import child, energy

NONE, DEFAULT = "none", "default"  # of --shell
ALL = "all-non-zero"  # of --ignore-failure
SECONDS = {"ns": 1e-9, "us": 1e-6, "µs": 1e-6, "μs": 1e-6, "ms": 1e-3, "s": 1.0, "sec": 1.0, "seconds": 1.0}
_UNIT = re.compile(rf"\s*({'|'.join(sorted(SECONDS, key=len, reverse=True))})\b")


class Launched(msgspec.Struct):
    """What launch.c writes, by the names of run_schema.Frame."""

    exit_status: int
    ns: float
    user_ns: int
    system_ns: int
    unused_ns: int
    max_rss_kib: int
    faults_minor: int
    faults_major: int
    ctx_voluntary: int
    ctx_involuntary: int
    instructions: int | None = None
    joules: float | None = None
    frame: int = 0


@dataclass(frozen=True)
class Launcher:
    """How programs are launched. `cpus`: those that they are pinned to; `ignore`: what statuses are no
    failure, None: any. `time_from`: its first group is a time in the output. `by`: "wall" or "cpu" time."""

    cpus: frozenset[int] | None
    shell: str | None = None
    input: Path | None = None
    ignore: frozenset[int] | None = frozenset()
    time_from: re.Pattern[str] | None = None
    by: str = "wall"

    def words(self, command: Sequence[str], around: bool = False) -> list[str]:
        """What is executed; `around`: of --prepare and --cleanup. One word alone is a line of words."""
        (first, *rest) = command
        shell = self.shell or (DEFAULT if around else NONE)
        if shell != NONE:
            line = shlex.join(command) if rest else first
            return [*shlex.split("sh" if shell == DEFAULT else shell), "-c", line]
        if rest or shutil.which(first):
            return [*command]
        try:
            found = shlex.split(first)
        except ValueError as error:
            raise StudyError(f"{first}: {error}") from None
        if not found:
            raise StudyError("an empty command")
        return found

    def around(self, line: str) -> None:
        """Runs a command of --prepare or --cleanup. Raises StudyError where it fails."""
        words = self.words([line], around=True)
        try:
            done = child.run(words, stdin=subprocess.DEVNULL, capture_output=True, text=True)
        except OSError as error:
            raise StudyError(f"{words[0]}: {error.strerror}") from None
        if done.returncode:
            said = done.stderr.strip().splitlines()
            raise StudyError(f"{line}: status {done.returncode}" + (f": {said[-1]}" if said else ""))

    def launch(self, command: Sequence[str], env_bytes: int) -> list[Launched]:
        """One process: its wall time, or each time that it printed. Raises StudyError where it fails."""
        words, name = self.words(command), shlex.join(command)
        where = ",".join(map(str, sorted(self.cpus))) if self.cpus else "-"
        printed = subprocess.PIPE if self.time_from else subprocess.DEVNULL
        with open(self.input or os.devnull, "rb") as given, tempfile.TemporaryFile() as said:
            out, into = os.pipe()
            how = {"stdin": given, "stdout": printed, "stderr": said, "pass_fds": (into,)}
            how["env"] = run.environment(env_bytes)
            before = energy.reading()
            try:
                done = child.run([build(".", "launch"), str(into), where, *words], **how)
            finally:
                os.close(into)
                with open(out, "rb") as pipe:
                    line = pipe.read()
            used = energy.joules(before, energy.reading())
            said.seek(0)
            last = said.read().decode(errors="replace").strip().splitlines()[-1:]
        if done.returncode:
            why = "".join(last) or f"{name}: its launcher ended with status {done.returncode}"
            raise StudyError(why, CANNOT_RUN if done.returncode == CANNOT_RUN else BAD_INPUT)
        found = msgspec.json.decode(line, type=Launched)
        if found.exit_status and not (self.ignore is None or found.exit_status in self.ignore):
            ended = f"status {found.exit_status}" if found.exit_status > 0 else f"signal {-found.exit_status}"
            why = "".join(f": {text}" for text in last)
            raise StudyError(f"{name}: {ended}{why} (--ignore-failure takes its time all the same)")
        found.joules = used
        if self.by == "cpu":  # of which others have nothing, however often they took turns
            found = msgspec.structs.replace(found, ns=found.user_ns + found.system_ns or 1, unused_ns=0)
        if self.time_from is None:
            return [found]
        times = printed_times(self.time_from, done.stdout.decode(errors="replace"), name)
        return [msgspec.structs.replace(found, ns=ns, frame=number) for number, ns in enumerate(times)]


def printed_times(wanted: re.Pattern[str], text: str, name: str) -> list[float]:
    """Times in ns that `wanted` finds. The unit is the word behind the number. Raises StudyError."""
    found = []
    for match in wanted.finditer(text):
        unit = _UNIT.match(text, match.end(1))
        if not unit:
            after = text[match.start(1) : match.end(1) + 12].splitlines()[0]
            raise StudyError(f"{name}: {after!r}: no unit of time behind it (ns, us, ms or s)")
        try:
            ns = float(match[1]) * SECONDS[unit[1]] * 1e9
        except ValueError:
            raise StudyError(
                f"{name}: {match[1]!r} is no number; --time-from's group is to hold one"
            ) from None
        if not 0 < ns < float("inf"):
            raise StudyError(f"{name}: {match[0]!r}: a time must be above 0")
        found.append(ns)
    if not found:
        raise StudyError(f"{name}: --time-from {wanted.pattern!r} finds nothing in what it printed")
    return found
