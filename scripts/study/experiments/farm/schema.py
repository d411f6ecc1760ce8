"""farm.json."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from study.core.schema import Record, key
from study.numbers.schema import Result


class Worker(Record, kw_only=True):
    """A worker of the cluster: a process of one thread."""

    name: Annotated[str, key("", "its name in the cluster")]
    shards: Annotated[int, key("shards", "that it has drawn, those of checks too")]


class Mismatch(Record, kw_only=True):
    """A shard of which workers have different results."""

    shard: Annotated[int, key("", "its number, from 1")]
    workers: Annotated[list[str], key("", "who drew it: the first, the second, and a third if there is one")]
    odd: Annotated[str | None, key("", "whose result two others contradict; null: nobody can tell")]


class Farm(Result, kw_only=True):
    """How an experiment was measured in shards on a cluster."""

    made_by: ClassVar[str] = "farm"
    schema: Annotated[Literal[1], key("", "version of the form")]
    experiment: Annotated[str, key("", "its name")]
    arguments: Annotated[list[str], key("", "of its command")]
    workers: Annotated[list[Worker], key("", "who has drawn a shard")]
    shards: Annotated[int, key("shards", "that the work was parted into")]
    done: Annotated[int, key("shards", "with a result that no other contradicts")]
    recomputed: Annotated[int, key("shards", "drawn again: their worker is the odd one")]
    drawn_twice: Annotated[int, key("shards", "on two workers, to compare")]
    mismatches: Annotated[list[Mismatch], key("", "shards of which results differ")]
    seconds: Annotated[float, key("s", "that the cluster worked")]


FILE = "farm.json"
SCHEMAS = {FILE: Farm}
