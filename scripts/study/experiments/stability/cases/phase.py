"""What a hard case sees of a phase: pictures and distances of scenes that are given as dicts.

Each program run has a time limit; running out of it, being killed by a signal and refusing the scene are told
apart, since a phase may do the last and neither of the others.
"""

import contextlib
import json
import os
import signal
import subprocess
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from study.core import build, registry, temporary
from study.core.cli import StudyError
from study.core.host import child
from study.core.run import NO_ISA, UNSUPPORTED, UNTIMED
from study.pictures import images
from study.pictures.images import Picture

# No case takes a second where nothing goes wrong; the rest is for sanitized programs on busy machines.
TIME_LIMIT = 30.0  # s


class Hung(Exception):
    """The program was still running at the time limit, and was killed."""


class Crashed(Exception):
    """The program was killed by a signal, a sanitizer or its own complaint of a scene that is sound."""


class Refused(Exception):
    """The phase says that it does not render such a scene, or not on this CPU."""


@dataclass
class Phase:
    """A phase, as built by make (`make`: its settings, with another folder: CC=clang BUILD=build/clang).

    `non_finite` counts over all pictures rendered through this object, so a measurement takes a new one.
    """

    name: str  # opt4, or opt2@opt4
    make: tuple[str, ...] = ()
    folder: str = "build"
    time_limit: float = TIME_LIMIT  # s
    non_finite: int = field(default=0, compare=False)

    @property
    def precision(self) -> str:
        """float or double, as phase.json declares it: for texts, never to widen a limit."""
        return registry.find_phase(self.name.partition("@")[0]).precision

    def program(self, target: str = "render") -> Path:
        """FOLDER/NAME/TARGET, brought up to date once per process."""
        return build.build(self.name, target, self.folder, self.make)

    def execute(
        self, arguments: Sequence[str | Path], stdin: bytes = b"", env: dict[str, str] | None = None
    ) -> subprocess.CompletedProcess[bytes]:
        """Run a program to its end, whatever its exit status. Raises Hung, or Crashed for a signal."""
        command = [str(word) for word in arguments]
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
        try:
            with child.started(command, env=os.environ | {UNTIMED: "1"} | (env or {}), **pipes) as program:
                said = program.communicate(stdin, self.time_limit)
        except subprocess.TimeoutExpired:
            raise Hung(f"not done after {self.time_limit:g} s") from None
        done = subprocess.CompletedProcess(command, program.returncode, *said)
        if done.returncode < 0:
            raise Crashed(f"killed by {signal.Signals(-done.returncode).name}")
        return done

    def render(self, scene: dict, size: tuple[int, int], aov: bool = True, **overrides: float) -> Picture:
        """The picture of `size` (width, height), float32 planes of (height, width) by channel name.

        Overrides: hit_distance and max_steps, the driver's options; everything else is the scene's.
        Samples that are not finite are counted, not refused.
        """
        with _written(scene) as path:
            out = path.with_name("picture.exr")
            command: list[str | Path] = [self.program(), path, "-o", out]
            command += ["-n", str(size[1]), "-w", str(size[0])]
            for name, value in overrides.items():
                command += ["--" + name.replace("_", "-"), repr(value)]
            _checked(self.execute([*command, "--aov"] if aov else command))
            picture = images.read(out)
        self.non_finite += images.non_finite(picture)
        return picture

    def distances(self, scene: dict, points: np.ndarray) -> np.ndarray:
        """Signed distance (scene units) at each point of (count, 3), in the arithmetic of the phase's march.

        The probe does not ask whether the phase supports the scene.
        """
        with _written(scene) as path:
            raw = np.ascontiguousarray(points, "<f8").tobytes()
            done = self.execute([self.program("probe"), path], stdin=raw)
            _checked(done)
        found = np.frombuffer(done.stdout, "<f8").reshape(-1, 2)[:, 0].copy()
        self.non_finite += int((~np.isfinite(found)).sum())
        return found


@contextlib.contextmanager
def _written(scene: dict) -> Iterator[Path]:
    """The scene as a file of a folder that lasts as long as the context."""
    with temporary.folder(prefix="stepwise-hard-") as folder:
        path = Path(folder, "scene.json")
        path.write_text(json.dumps(scene), encoding="utf-8")
        yield path


def _checked(done: subprocess.CompletedProcess[Any]) -> None:
    if done.returncode == 0:
        return
    lines = done.stderr.decode(errors="replace").strip().splitlines()
    said = lines[-1] if lines else f"exit status {done.returncode}, without a word"
    if done.returncode in (NO_ISA, UNSUPPORTED):
        raise Refused(said)
    # Status 2 is the loader's: then the case is wrong, not the phase.
    raise StudyError(f"the scene of a hard case: {said}") if done.returncode == 2 else Crashed(said)
