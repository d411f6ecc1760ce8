"""Tab completion for a shell: commands, options, phases and scenes.

Prints a script for the shell to read: eval "$(scripts/stepwise completion bash)".
"""

import argparse
import shlex

import shtab

from study.core import commands
from study.core.cli import Outcome
from study.core.registry import ROOT

SHELLS = ("bash", "zsh")
NAMED = {  # placeholder -> the command that lists its names when Tab is pressed
    "PHASE": f"basename -a {shlex.quote(str(ROOT))}/{{phases,systems}}/*/",
    "SCENE": f"basename -s .json {shlex.quote(str(ROOT / 'common' / 'scenes'))}/*.json",
}
FOLDERS, FILES = ("DIR", "RUN", "RUN_A", "RUN_B", "FOLDER"), ("PATH", "FILE")


def completed(action: argparse.Action) -> None:
    """Says how the action's value is completed: by its placeholder."""
    if action.metavar in NAMED:
        action.choices = None
        action.complete = shtab.cmd(NAMED[action.metavar])  # type: ignore[attr-defined]
    elif action.metavar in FOLDERS + FILES:
        kind = shtab.DIRECTORY if action.metavar in FOLDERS else shtab.FILE
        action.complete = kind  # type: ignore[attr-defined]


def whole() -> argparse.ArgumentParser:
    made = argparse.ArgumentParser("stepwise")
    below = made.add_subparsers()
    below.add_parser("list", help="the commands")
    for command in commands.find_all().values():
        parser = commands.parser_of(command)
        for action in parser._actions:
            completed(action)
        below.add_parser(command.name, help=command.what, parents=[parser], add_help=False)
    return made


def options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("shell", choices=SHELLS, help="what reads the script")


def run(args: argparse.Namespace) -> Outcome:
    script = shtab.complete(whole(), args.shell)
    return Outcome({"script": script}, [script])
