"""The commands of scripts/stepwise, found by their files.

They are study/experiments/NAME/command.py and, there or in a folder, study/commands/NAME.py; a name that
Python has taken ends in an underscore. A command is a module as `Body` says; the first sentence of its text
says what it does.
"""

import argparse
import ast
import dataclasses
import difflib
import importlib
import os
import re
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from study.core import cli, registry, store
from study.core.cli import Outcome, StudyError

STUDY = Path(__file__).resolve().parents[1]
OPTIONS = {  # one meaning in every command that has it: placeholder and what it is
    "--run": ("DIR", "the folder of the run that is read or added to; without it a second result gets a"
              " folder of its own, build/NAME-2"),
    "--resume": (None, "go on with the interrupted run at `--run`"),
    "--budget": ("SECONDS", "the time for measuring; what does not fit is left out and said"),
    "--phase": ("PHASE", "a phase, `opt2@opt4` (opt2 with opt4's flags) or an ablation `opt2+title`"),
    "--scene": ("SCENE", "a scene of `common/scenes` by its name, or any by the path of its file"),
    "-n": ("HEIGHT", "the height of the pictures, in pixels"),
    "-w": ("WIDTH", "their width; 16:9 if it is not given"),
    "--threads": ("THREADS", "the threads that a phase renders with"),
    "--launches": ("LAUNCHES", "process launches of each program"),
    "--seed": ("SEED", "of everything that is random"),
    "--cpu": ("CPU", "the CPU that a program is pinned to"),
    "--jobs": ("JOBS", "what is done at a time where nothing is timed"),
    "-o": ("PATH", "where the result goes"),
    "--results": ("DIR", "the folder in which a new run is made"),
    "--json": (None, "one JSON object on standard output, always with these keys: `command`, `status`"
               " (`ok` or `failed`), `run` (its folder or null) and `result`"),
}  # fmt: skip
begun = time.monotonic()  # the command that runs
USAGE = """\
scripts/stepwise NAME [options]     runs a command; NAME -h explains it
scripts/stepwise list               the commands"""


@dataclass(frozen=True)
class Command:
    """`experiment`: it measures something into a run."""

    name: str
    path: Path
    experiment: bool

    @property
    def what(self) -> str:
        """The first sentence of its module. Raises StudyError without one."""
        text = ast.get_docstring(ast.parse(self.path.read_text(encoding="utf-8")))
        if not text:
            raise StudyError(f"{self.path}: its first line must say what the command does")
        return re.split(r"(?<=\.) ", " ".join(text.split("\n\n")[0].split()))[0]

    @property
    def module(self) -> str:
        return ".".join(["study", *self.path.relative_to(STUDY).with_suffix("").parts])


class Body(Protocol):
    """A command's module. `measure` is what an experiment has, `run` what any other command has; the text of
    -h is DESCRIPTION or the module's, with STATUSES beside the usual exit statuses."""

    def options(self, parser: argparse.ArgumentParser) -> None: ...

    def measure(self, args: argparse.Namespace) -> Outcome: ...


def parser_for(name: str, body: Any) -> argparse.ArgumentParser:
    text = getattr(body, "DESCRIPTION", body.__doc__) or ""
    made = cli.parser(text, getattr(body, "STATUSES", None))
    made.prog = f"stepwise {name}"
    body.options(made)
    for action in made._actions:
        if action.dest in ("scene", "left_scene"):
            action.type = registry.given
    return made


def called(name: str, words: Sequence[str | Path]) -> tuple[Outcome, bool]:
    """A command in this process, and whether --json was given. SystemExit for bad arguments; StudyError.
    A study calls many: what one sets in the environment ends with it."""
    global begun
    begun, environment = time.monotonic(), dict(os.environ)
    body: Any = importlib.import_module(find_all()[name].module)
    args = parser_for(name, body).parse_args(list(map(str, words)))
    store.known_scenes(getattr(args, "run", None))
    try:
        outcome = body.measure(args) if hasattr(body, "measure") else body.run(args)
    finally:
        os.environ.clear()
        os.environ.update(environment)
    if outcome.run:
        store.keep_scenes(outcome.run)
    return outcome, args.json


def parser_of(command: Command) -> argparse.ArgumentParser:
    return parser_for(command.name, importlib.import_module(command.module))


def find_all() -> dict[str, Command]:
    experiments = sorted((STUDY / "experiments").glob("*/command.py"))
    others = sorted((STUDY / "commands").rglob("*.py"), key=lambda path: path.stem)
    found = [Command(path.parent.name.replace("_", "-"), path, True) for path in experiments]
    others = [path for path in others if path.stem != "__init__"]
    found += [Command(path.stem.rstrip("_").replace("_", "-"), path, False) for path in others]
    return {command.name: command for command in found}


def listing(found: dict[str, Command]) -> str:
    width = max(map(len, found))
    lines = [USAGE]
    for title, kind in (("experiments, which measure into a run:", True), ("other commands:", False)):
        lines += ["", title]
        lines += [f"  {c.name:{width}}  {c.what}" for c in found.values() if c.experiment is kind]
    return "\n".join(lines)


def main() -> int:
    """Runs sys.argv[1] with what stands behind it. Raises StudyError for a command that there is not."""
    found = find_all()
    name, rest = (sys.argv[1] if len(sys.argv) > 1 else ""), sys.argv[2:]
    if name in ("-h", "--help") or (name == "list" and not rest):
        print(listing(found))
        return cli.OK
    if name == "list" and rest == ["--json"]:
        sys.argv[:] = ["stepwise list"]
        known = {c.name: {"what": c.what, "experiment": c.experiment} for c in found.values()}
        return Outcome(known).tell(as_json=True)
    if name not in found:
        near = difflib.get_close_matches(name, found, n=1)
        hint = f"did you mean {near[0]}?" if near else "`scripts/stepwise list` names them all"
        raise StudyError(f"no command {name!r}; {hint}" if name else f"which command? {hint}")
    sys.argv[:] = [f"stepwise {name}", *rest]
    outcome, as_json = called(name, rest)
    return noted(outcome).tell(as_json)


def noted(outcome: Outcome) -> Outcome:
    """Adds, on arm64, a remark on the phases named in what is printed whose code SIMDe translated."""
    if not (programs := registry.by_simde()):
        return outcome
    lines = list(map(str, outcome.lines))
    words = set(re.findall(r"\w+", " ".join(lines)))
    said = filter(None, [registry.translated(programs, words)])
    return dataclasses.replace(outcome, lines=lines, remarks=[*outcome.remarks, *said])
