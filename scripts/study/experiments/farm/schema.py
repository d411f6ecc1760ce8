"""farm.json."""

from typing import Annotated, ClassVar, Literal

from study.core.schema import Record, key
from study.numbers.schema import Result


class Worker(Record, kw_only=True):
    """A worker of the cluster: a process of one thread."""

    name: Annotated[str, key("", "its name in the cluster")]
    shards: Annotated[int, key("shards", "that it has drawn")]


class Farm(Result, kw_only=True):
    """How an experiment was measured in shards on a cluster."""

    made_by: ClassVar[str] = "farm"
    schema: Annotated[Literal[1], key("", "version of the form")]
    experiment: Annotated[str, key("", "its name")]
    arguments: Annotated[list[str], key("", "of its command")]
    shards: Annotated[int, key("shards", "that the work was parted into")]
    workers: Annotated[list[Worker], key("", "who has drawn a shard")]
    seconds: Annotated[float, key("s", "that the cluster worked")]


FILE = "farm.json"
SCHEMAS = {FILE: Farm}
