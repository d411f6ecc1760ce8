"""Pages of the keys of every file of a run, made from the schemas: results/keys/FILE.md."""

from __future__ import annotations

import textwrap
from collections import Counter
from collections.abc import Iterator
from typing import Annotated, Any, Literal, get_args, get_origin

import msgspec

from study.core import schema
from study.core.run_schema import RUN_TOML, STUDY, About, Cuts
from study.core.schema import File, Record
from study.experiments import experiment
from study.numbers import schema as common

SHARED = "shared.md"
WIDTH = 100
WORDS = {str: "text", int: "integer", float: "number", bool: "true or false", dict: "object", Any: "any"}
BOUNDS = {"ge": "≥ {}", "gt": "> {}", "le": "≤ {}", "lt": "< {}", "min_length": "at least {}"}
HEAD = """\
This page is made from the code by `scripts/stepwise docs`. A key with `?` may be missing. NaN and
infinity are null. A file may have more keys: a newer version may have written it.
"""


def files() -> dict[str, type[File]]:
    """Name → schema of every file of a run: of the experiments in their order, and two more."""
    found = {name: kind for one in experiment.find_all().values() for name, kind in one.schemas.items()}
    return found | {STUDY: Cuts, RUN_TOML: About}


def records(kind: Any) -> list[type[Record]]:
    """The kinds of objects in a value of the type, itself first, each once; a File has its own page."""
    found: list[type[Record]] = []

    def visit(one: Any) -> None:
        for each in schema.alternatives(one):
            if not schema.is_record(each):
                for argument in get_args(each) if get_origin(each) in (list, dict) else ():
                    visit(argument)
            elif each not in found and (not issubclass(each, File) or not found):
                found.append(each)
                for _, inner, _ in schema.fields(each):
                    visit(inner)

    visit(kind)
    return found


def shared() -> list[type[Record]]:
    """The objects that stand in several files and are explained once."""
    uses = Counter(one for kind in files().values() for one in records(kind))
    return [one for one, n in uses.items() if n > 2 and one.__module__ == common.__name__]


class Writer:
    """Writes tables of keys: of the objects on this page, `here`, with links to the others."""

    def __init__(self, here: list[type[Record]]) -> None:
        self.here = here
        self.pages = {kind: f"{name}.md" for name, kind in files().items()}

    def value(self, kind: Any) -> str:
        """What a key may hold, in words."""
        known = list(self._values(kind))
        null = ["null"] if type(None) in get_args(kind) else []
        return " or ".join(known + null)

    def _values(self, kind: Any) -> Iterator[str]:
        bounds = [one for one in get_args(kind)[1:] if get_origin(kind) is Annotated]
        for one in get_args(kind) if get_origin(kind) not in (None, list, dict, Literal, Annotated) else ():
            if one is not type(None) and one is not schema.Absent:
                yield from self._values(one)
        origin, arguments = get_origin(kind), get_args(kind)
        if origin is Annotated:
            yield from (word + bounded(about) for about in bounds for word in self._values(arguments[0]))
        elif origin is Literal:
            yield " or ".join(f"`{one}`" for one in arguments)
        elif origin is list:
            yield f"list of {self.value(arguments[0])}"
        elif origin is dict:
            yield "object" if arguments[1] is Any else f"name → {self.value(arguments[1])}"
        elif schema.is_record(kind):
            page = "" if kind in self.here else self.pages.get(kind, SHARED)
            yield f"[{kind.__name__}]({page}{'' if kind in self.pages else '#' + kind.__name__.lower()})"
        elif origin is None and kind is not type(None):
            yield WORDS[kind]

    def table(self, kind: type[Record]) -> str:
        """A line for each key."""
        needed = {one.encode_name for one in msgspec.structs.fields(kind) if one.required}
        lines = ["| key | unit | value | meaning |", "| --- | --- | --- | --- |"]
        for name, inner, about in schema.fields(kind):
            mark = "" if name in needed else "?"
            cells = [f"`{name}`{mark}", (about.extra or {})["unit"], self.value(inner) + bounded(about)]
            lines.append("| " + " | ".join(clean(cell) for cell in [*cells, about.description or ""]) + " |")
        return "\n".join(lines) + "\n"

    def chapter(self, kind: type[Record]) -> str:
        return f"## {kind.__name__}\n\n{paragraphs(kind)}\n\n{self.table(kind)}"


def clean(cell: str) -> str:
    return cell.replace("|", "\\|")


def bounded(about: msgspec.Meta) -> str:
    """The bounds of a value: `, ≥ 1`."""
    found = {name: getattr(about, name) for name in BOUNDS}
    return "".join(f", {BOUNDS[name].format(value)}" for name, value in found.items() if value is not None)


def paragraphs(kind: type[Record]) -> str:
    """What the class says of itself. Raises TypeError where it says nothing."""
    if not kind.__doc__:
        raise TypeError(f"{kind.__module__}.{kind.__name__} does not say what it is")
    parts = textwrap.dedent("    " + kind.__doc__).strip().split("\n\n")
    return "\n\n".join(textwrap.fill(" ".join(part.split()), WIDTH) for part in parts)


def page(name: str, kind: type[File]) -> str:
    """The page of one file."""
    apart = shared()
    top, *others = here = [one for one in records(kind) if one not in apart]
    made = "one of these objects a line" if name.endswith(".jsonl") else "one object"
    head = f"# {name}\n\n{paragraphs(top)}\n\nMade by `scripts/stepwise {kind.made_by}`: {made}.\n"
    writer = Writer(here)
    return "\n".join([head, HEAD, writer.table(top), *(writer.chapter(one) for one in others)])


def pages() -> dict[str, str]:
    """Every page of results/keys by its file's name."""
    apart = shared()
    writer = Writer(apart)
    head = "# Objects that several files have\n"
    found = {SHARED: "\n".join([head, HEAD, *(writer.chapter(one) for one in apart)])}
    return found | {f"{name}.md": page(name, kind) for name, kind in files().items()}


def index() -> str:
    """The table of files: what stands in each, and the command that writes it."""
    lines = ["| file | what | made by |", "| --- | --- | --- |"]
    for name, kind in files().items():
        what = paragraphs(kind).replace("\n", " ").split(". ")[0].rstrip(".")
        lines.append(f"| [{name}](keys/{name}.md) | {clean(what)} | `stepwise {kind.made_by}` |")
    return "\n".join(lines) + "\n"
