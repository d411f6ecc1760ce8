"""Pages made from the code: docs/commands.md, build/docs/, lines of functions in MAP.md."""

import argparse
import re
import textwrap
from functools import partial
from pathlib import Path

from study.core import commands, store
from study.core.cli import Outcome
from study.core.commands import Command
from study.core.registry import ROOT
from study.core.show import between
from study.experiments import experiment, keys

FILES = "results/README.md"
BEGIN, END = "<!-- files: scripts/stepwise docs -->", "<!-- end of files -->"
WIDTH = 100
LINES = re.compile(r"(`(\w+)`, ((?:\w+/)?\w+\.[ch])) \d+–\d+")  # of a function in a MAP.md
HEAD = """\
# Commands

`scripts/stepwise NAME` runs a command, and `NAME -h` explains it. `make NAME` installs what is
needed and runs an experiment. `scripts/stepwise docs` writes this page, and every help below
`build/docs/commands/`. Commands share their [exit statuses](exit-statuses.md). RUN is the folder of
a run. These options mean the same in every command that has them:
"""
TABLES = (
    ("Experiments, which measure into a run", "| command | what it is | writes |\n| --- | --- | --- |", True),
    ("Other commands", "| command | what it is |\n| --- | --- |", False),
)


def row(command: Command) -> str:
    """A command's name, what it is, and what an experiment writes into a run."""
    made = experiment.find_all().get(command.name)
    writes = [", ".join(f"`{name}`" for name in made.schemas) if made else ""] if command.experiment else []
    return " | ".join([f"| `{command.name}`", command.what, *writes]) + " |"


def described(command: Command) -> str:
    """The help of a command."""
    parser = commands.parser_of(command)
    parser.formatter_class = partial(argparse.RawDescriptionHelpFormatter, width=WIDTH - 2)
    text = parser.format_help()
    text = filled(text.partition("\nexit status:")[0].replace(str(ROOT), ".").rstrip())
    return f"# {command.name}\n\n```\n{text}\n```\n"


def filled(text: str) -> str:
    """Help whose long paragraphs are wrapped; lines that are indented stay as they are."""
    parts = []
    for paragraph in text.split("\n\n"):
        lines = paragraph.split("\n")
        plain = not any(line.startswith(" ") for line in lines)
        parts.append(textwrap.fill(paragraph, WIDTH) if plain else paragraph)
    return "\n\n".join(parts)


def page() -> str:
    lines = []
    for name, (placeholder, meaning) in commands.OPTIONS.items():
        shown = f"{name} {placeholder}" if placeholder else name
        lines.append(textwrap.fill(f"- `{shown}`: {meaning}.", WIDTH, subsequent_indent="  "))
    for title, head, kind in TABLES:
        rows = [row(command) for command in commands.find_all().values() if command.experiment is kind]
        lines += ["", f"## {title}", "", head, *rows]
    return "\n".join([HEAD, *lines, ""])


def lines_of(name: str, path: Path) -> str:
    """First and last line of a C function with its comment. Raises ValueError if it does not stand there."""
    lines = path.read_text(encoding="utf-8").split("\n")
    heads = (i for i, line in enumerate(lines) if re.match(rf"(\w.*\W)?{name}\(", line))
    for first in heads:
        rest = next(i for i in range(first, len(lines)) if lines[i].endswith((";", "{")))
        if lines[rest].endswith("{"):
            last = lines.index("}", rest)
            while lines[first - 1].startswith(("//", "static", "__attribute__")):
                first -= 1
            return f"{first + 1}–{last + 1}"
    raise ValueError(f"{path}: has no function {name}")


def mapped(page: Path) -> str:
    """A MAP.md whose functions have their lines. Files without a folder stand in shadow/."""

    def now(found: re.Match[str]) -> str:
        path = page.parent / found[3]
        path = path if path.is_file() else page.parent / "shadow" / found[3]
        return f"{found[1]} {lines_of(found[2], path)}"

    return LINES.sub(now, page.read_text(encoding="utf-8"))


def pages(root: Path = ROOT) -> dict[str, str]:
    """Every page by its path below the project; `root` has the page that the table of files goes into."""
    text = (root / FILES).read_text(encoding="utf-8")
    made = {"docs/commands.md": page(), FILES: between(text, BEGIN, END, f"\n{keys.index()}\n")}
    maps = (page for page in (root / "phases").glob("*/MAP.md") if LINES.search(page.read_text("utf-8")))
    made |= {str(page.relative_to(root)): mapped(page) for page in maps}
    made |= {f"build/docs/commands/{name}.md": described(one) for name, one in commands.find_all().items()}
    return made | {f"build/docs/keys/{name}.md": keys.page(name, kind) for name, kind in keys.files().items()}


def options(parser: argparse.ArgumentParser) -> None:
    about = "the folder that the pages go below; default: the project"
    parser.add_argument("-o", "--out", type=Path, default=ROOT, metavar="PATH", help=about)


def run(args: argparse.Namespace) -> Outcome:
    made = pages()
    for name, text in made.items():
        store.write_text(args.out / name, text)
    return Outcome({"pages": list(made)}, made)
