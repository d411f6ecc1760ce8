"""Progress of long work on standard error: a bar with the time left on a terminal, else a line at times."""

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from typing import Any, TypeVar

from tqdm import tqdm

from study.core import cli
from study.core.host.child import overdue, seconds

T = TypeVar("T")
PAUSE = 10  # s until the first line; until each next one as long as the work has taken
LOOK = 0.2  # s between two looks at a child's work
BAR = "|{bar:30}| {elapsed} < {remaining}  {postfix}"


def duration(seconds: float) -> str:
    minutes, seconds = divmod(round(seconds), 60)
    return f"{minutes} min {seconds} s" if minutes else f"{seconds} s"


class Progress(contextlib.AbstractContextManager["Progress"]):
    """How far `about` is; `total` steps, None where that is not known. `share`: in percent, and the end is
    said. Lines come after PAUSE seconds and whenever that doubles: of ten minutes six, of seconds none."""

    def __init__(self, about: str, total: float | None, share: bool = False) -> None:
        self.about, self.total, self.share = about, total, share
        self.done: float = 0
        self.begun, self.next = time.monotonic(), float(PAUSE)
        far = "{percentage:3.0f} % " if share else "{n_fmt} of {total_fmt} "
        form = "{desc}: " + ("{elapsed}" if total is None else far + BAR)
        self.bar: Any = None
        if sys.stderr.isatty():
            kept = share and not cli.listeners
            self.bar = tqdm(total=total, desc=about, leave=kept, dynamic_ncols=True, bar_format=form)

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if self.bar is not None:
            self.bar.close()
        elif self.share and not kind and not cli.listeners:
            cli.say(self.text())

    def text(self) -> str:
        """`build: 12 of 80, after 14 s, 1 min 19 s left`."""
        spent = time.monotonic() - self.begun
        if self.total is None:
            return f"{self.about}: after {duration(spent)}"
        percent = 100 * self.done / self.total if self.total else 100
        far = f"{percent:.0f} %" if self.share else f"{self.done:g} of {self.total:g}"
        left = ""
        if 0 < self.done < self.total:
            left = f", {duration(spent * (self.total - self.done) / self.done)} left"
        return f"{self.about}: {far}, after {duration(spent)}{left}"

    def to(self, done: float, doing: str = "") -> None:
        """So much is done; `doing`: what comes now."""
        step, self.done = done - self.done, done
        if self.bar is not None:
            if doing:
                self.bar.set_postfix_str(doing, refresh=False)
            self.bar.update(step)
        elif (spent := time.monotonic() - self.begun) >= self.next and not cli.listeners:
            self.next = 2 * spent
            if not self.share or done != self.total:
                cli.say(self.text() + (f"; {doing}" if doing else ""))


def each(items: Iterable[T], about: str, total: int | None = None) -> Iterator[T]:
    """The items, counted when each has been dealt with. `total`: how many, where len() does not say."""
    if total is None and hasattr(items, "__len__"):
        total = len(items)  # type: ignore[arg-type]
    with Progress(about, total) as progress:
        for number, item in enumerate(items, 1):
            yield item
            progress.to(number)


def until(child: subprocess.Popen[Any], about: str, done: Callable[[], int], total: int | None) -> None:
    """Waits for the child's end; `done` says how far it is. StudyError if that stands still too long."""
    limit = seconds()
    try:
        with Progress(about, total) as progress:
            heard, before = time.monotonic(), done()
            while child.poll() is None:
                if time.monotonic() - heard > limit:
                    raise overdue(about, limit)
                with contextlib.suppress(subprocess.TimeoutExpired):
                    child.wait(LOOK)
                if (now := done()) != before:
                    heard, before = time.monotonic(), now
                progress.to(now)
    except BaseException:
        with contextlib.suppress(ProcessLookupError):
            if os.getpgid(child.pid) == child.pid:  # a make: what it started goes with it
                os.killpg(child.pid, signal.SIGKILL)
        child.kill()
        raise
