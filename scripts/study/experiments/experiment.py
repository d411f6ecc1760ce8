"""What an experiment is. Each folder study/experiments/NAME/ exports one, EXPERIMENT of its experiment.py.

The study, `scripts/stepwise NAME`, `make NAME`, the report, `stepwise redraw`, `stepwise publish` and the
lists of the documents know an experiment only through this object, and find it by its folder.
"""

import importlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any

from study.core import commands
from study.core.cli import StudyError
from study.core.schema import File
from study.experiments import cuts
from study.experiments.section import Section, System, noted
from study.experiments.shards import Sharded
from study.numbers.analysis import Data

FOLDER = Path(__file__).resolve().parent
QUESTIONS = {  # of the report, in their order
    1: "How fast is each phase here, and at what error?",
    2: "What bounds it?",
    3: "Does it reproduce the paper?",
    4: "What did each idea give?",
    5: "Where does it fail?",
    6: "More",
    7: "What was run, and how",
}
DEPTHS = ("quick", "standard", "full")  # of a study: 10 minutes, 40, hours


@dataclass(frozen=True)
class Study:
    """The study that an experiment is part of: its run, the scenes that are timed, the headline's height in
    pixels. `asked`: the user has asked for this experiment by its name."""

    run: Path
    scenes: Sequence[str]
    height: int
    depth: str = "standard"
    asked: bool = False

    def at_least(self, depth: str) -> bool:
        return DEPTHS.index(self.depth) >= DEPTHS.index(depth)

    @property
    def whole(self) -> bool:
        """Whether the experiment is to measure all that it knows."""
        return self.asked or self.depth == "full"

    @property
    def quick(self) -> bool:
        """Whether seconds must do."""
        return self.depth == "quick" and not self.asked


@dataclass(frozen=True)
class Call:
    """A command of a study. `judges`: its status 1 says that a check failed, and not that it broke.
    `may_lack`: the study goes on where the machine lacks what the command needs."""

    command: str
    arguments: Sequence[str] = ()
    judges: bool = True
    may_lack: bool = False


@dataclass(frozen=True)
class Experiment:
    """`what`: a few words for progress and lists. `turn`: its place in a study. `schemas`: what stands in
    each file that its own command writes into a run. `calls`: its commands in a study; None: its own, which
    may lack what it needs. `depth`: the least depth of a study that has it; None: only by its name.
    `sections`: chapters of the report, each with its place there: the hundreds say which of QUESTIONS it
    answers. `cut`: what a quick study has of it (empty: all), or why it has nothing of it. `sharded`: how its
    work is parted, where its command has --shard. `lesson`: a phase and the text of its NOTES.md → that text
    with the experiment's table made anew, None where it has none there. `system`: what a run has of another
    article's system. `sheets`: pictures that are rendered anew into a run's images, by name. `command`: the
    module with `options(parser)` and `measure(args) -> Outcome`."""

    name: str
    what: str
    turn: int
    schemas: Mapping[str, type[File]]
    calls: Callable[[Study], list[Call]] | None = None
    depth: str | None = "standard"
    sections: Sequence[tuple[int, Callable[[Data], Section]]] = ()
    cut: str = ""
    sharded: Sharded | None = None
    lesson: Callable[[str, str], str | None] | None = None
    system: Callable[[Path], System | None] | None = None
    sheets: Mapping[str, Callable[[Path], list[Path]]] = field(default_factory=dict)
    command: commands.Body | None = None

    def commands(self, study: Study) -> list[Call]:
        own = Call(self.name, ["--run", str(study.run)], may_lack=True)
        return [own] if self.calls is None else self.calls(study)


@cache
def find_all(folder: Path = FOLDER) -> dict[str, Experiment]:
    """Every experiment by its name, in the order of a study. Raises StudyError for a folder without one."""
    found = []
    for path in sorted(folder.glob("*/experiment.py")):
        module = importlib.import_module(f"study.experiments.{path.parent.name}.experiment")
        made = getattr(module, "EXPERIMENT", None)
        if not isinstance(made, Experiment) or made.name != path.parent.name:
            raise StudyError(f"{path}: must define EXPERIMENT, named {path.parent.name!r}")
        found.append(made)
    return {one.name: one for one in sorted(found, key=lambda one: (one.turn, one.name))}


def load(run: Path, name: str) -> Any:
    """The file `name` of a run, read by the experiment that writes it; None without it. Raises StudyError."""
    kinds = {file: kind for one in find_all().values() for file, kind in one.schemas.items()}
    return kinds[name].load_if_there(run / name)


def placed(data: Data) -> list[tuple[int, Section]]:
    """The chapters of a run's page with their places, in order. Raises StudyError for a broken file."""
    few = cuts.read(data.path)
    made, programs = [], data.by_simde
    for one in find_all().values():
        line = few.get(one.name, "")
        made += [(place, replace(noted(make(data), programs), cut=line)) for place, make in one.sections]
    return sorted(made, key=lambda each: each[0])


def sections(data: Data) -> list[Section]:
    return [section for _, section in placed(data)]
