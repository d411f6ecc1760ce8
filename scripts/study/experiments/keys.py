"""The keys of every file of a run, made from the schemas: build/docs/keys/FILE.md."""

import textwrap
import types
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import msgspec

from study.core import schema
from study.core.run_schema import RUN_TOML, STUDY, About, Cuts
from study.core.schema import File, Record
from study.experiments import experiment

WIDTH = 100
WORDS = {str: "text", int: "integer", float: "number", bool: "true or false", dict: "object"}
WORDS |= {Any: "any", type(None): "null"}
HEAD = "A key with `?` may be missing. NaN and infinity are null."


def files() -> dict[str, type[File]]:
    """Name → schema of every file of a run: of the experiments in their order, and two more."""
    found = {name: kind for one in experiment.find_all().values() for name, kind in one.schemas.items()}
    return found | {STUDY: Cuts, RUN_TOML: About}


def records(kind: Any) -> list[type[Record]]:
    """The kinds of objects in a value of the type, itself first, each once."""
    found: list[type[Record]] = []

    def visit(one: Any) -> None:
        if schema.is_record(one):
            if one not in found:
                found.append(one)
                for _, inner, _ in schema.fields(one):
                    visit(inner)
        elif get_origin(one) is not Literal:
            for argument in get_args(one):
                visit(argument)

    visit(kind)
    return found


def value(kind: Any) -> str:
    """What a key may hold, in words."""
    origin, arguments = get_origin(kind), get_args(kind)
    if origin is Annotated:
        return value(arguments[0])
    if origin in (Union, types.UnionType):
        return " or ".join(value(one) for one in arguments if one is not msgspec.UnsetType)
    if origin is Literal:
        return " or ".join(f"`{one}`" for one in arguments)
    if origin is list:
        return f"list of {value(arguments[0])}"
    if origin is dict:
        return f"name → {value(arguments[1])}"
    return WORDS.get(kind) or kind.__name__


def table(kind: type[Record]) -> str:
    """What the class says of itself, and a line for each key."""
    needed = {one.encode_name for one in msgspec.structs.fields(kind) if one.required}
    said = textwrap.fill(" ".join((kind.__doc__ or "").split()), WIDTH)
    lines = [said, "", "| key | unit | value | meaning |", "| --- | --- | --- | --- |"]
    for name, inner, about in schema.fields(kind):
        cells = [f"`{name}`{'' if name in needed else '?'}", (about.extra or {})["unit"], value(inner)]
        lines.append("| " + " | ".join([*cells, (about.description or "").replace("|", "\\|")]) + " |")
    return "\n".join(lines) + "\n"


def page(name: str, kind: type[File]) -> str:
    top, *others = records(kind)
    parts = [f"# {name}", f"Made by `scripts/stepwise {kind.made_by}`. {HEAD}", table(top)]
    return "\n\n".join([*parts, *(f"## {one.__name__}\n\n{table(one)}" for one in others)])


def index() -> str:
    """The table of files: what stands in each, and the command that writes it."""
    lines = ["| file | what | made by |", "| --- | --- | --- |"]
    for name, kind in files().items():
        what = " ".join((kind.__doc__ or "").split()).split(". ")[0].rstrip(".")
        lines.append(f"| `{name}` | {what} | `stepwise {kind.made_by}` |")
    return "\n".join(lines) + "\n"
