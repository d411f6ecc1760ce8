"""Parts of an experiment's work, for many processes or machines: `--shard K/N`, and the parts joined again.

An experiment whose command takes --shard lists its units of work by its arguments alone, never by what the
machine can do: all machines cut the same list in the same places. A shard's file has another name than the
whole's, so nothing reads it for the whole. Such a file holds no times: two machines write the same bytes.
"""

import argparse
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from study.core import cli, store
from study.core.cli import StudyError

T = TypeVar("T")
KEY = "shard"  # in a shard's file


@dataclass(frozen=True)
class Shard:
    """The `number`-th of `of` parts, counted from 1."""

    number: int
    of: int

    def __str__(self) -> str:
        return f"{self.number}/{self.of}"


@dataclass(frozen=True)
class Sharded:
    """How an experiment is parted whose command has --shard, --run and --jobs. `file`: the whole's name.
    `lists`: its keys whose lists are those of the parts, one after another. `units`: what is to be done, in
    order, from the command's parsed arguments; StudyError for bad ones. `says`: lines of the whole."""

    file: str
    lists: Sequence[str]
    units: Callable[[argparse.Namespace], Sequence[Any]]
    says: Callable[[dict[str, Any], Path], list[str]] | None = None


def parse(text: str) -> Shard:
    """An argparse type: K/N with 1 ≤ K ≤ N."""
    found = re.fullmatch(r"([0-9]{1,9})/([0-9]{1,9})", text, re.ASCII)
    shard = Shard(int(found[1]), int(found[2])) if found else None
    if not shard or not 1 <= shard.number <= shard.of:
        raise argparse.ArgumentTypeError(f"'{text}': must be K/N, the K-th of N parts, 1 <= K <= N")
    return shard


def option(parser: argparse.ArgumentParser, what: str) -> None:
    """--shard; `what`: the units that are parted, in words."""
    about = f"the K-th of N parts of the {what}, into a file of its own; scripts/stepwise farm joins them"
    parser.add_argument("--shard", type=parse, metavar="K/N", help=about)


def part(units: Sequence[T], shard: Shard | None) -> list[T]:
    """The units of a shard: neighbours, and as many as of any other shard or one less. None: all of them.
    Raises StudyError where there are more shards than units."""
    if shard is None:
        return list(units)
    if shard.of > len(units):
        raise StudyError(f"--shard {shard}: N must be at most {len(units)}, the number of units of work")
    first, last = ((number * len(units)) // shard.of for number in (shard.number - 1, shard.number))
    return list(units[first:last])


def file_name(whole: str, shard: Shard | None) -> str:
    """`accuracy.json`, or of a shard `accuracy.shard-2-of-8.json`."""
    if shard is None:
        return whole
    path = Path(whole)
    return f"{path.stem}.shard-{shard.number}-of-{shard.of}{path.suffix}"


def write(folder: Path, whole: str, result: Any, shard: Shard | None) -> Path:
    """The file of a shard, which says of which; None: of the whole, which says nothing."""
    path = folder / file_name(whole, shard)
    about = {KEY: vars(shard)} if shard else {}
    store.write_json(path, about | cli.plain(result))
    return path


def join(parts: Sequence[Mapping[str, Any]], lists: Sequence[str]) -> dict[str, Any]:
    """The whole's content from that of its shards, in order: what one run over all units would have written.
    Raises StudyError for a shard that is missing or twice there, or was made under other settings."""
    about = [one.get(KEY) for one in parts]
    if about != [{"number": number, "of": len(parts)} for number in range(1, len(parts) + 1)]:
        raise StudyError(f"these are not shards 1 to {len(parts)} of {len(parts)}, each once, in order")
    whole = {name: value for name, value in parts[0].items() if name != KEY}
    for name, first in whole.items():
        if name in lists:
            entries = [entry for one in parts for entry in one[name]]
            whole[name] = [entry for i, entry in enumerate(entries) if entry not in entries[:i]]
        elif unlike := [number for number, one in enumerate(parts, 1) if one.get(name) != first]:
            raise StudyError(f"shards 1 and {unlike[0]} of {len(parts)} differ in {name!r}: made elsewhere?")
    return whole
