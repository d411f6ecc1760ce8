"""An experiment on a cluster: what the driver is told, what it says, and the run's whole file."""

import json
import math
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import msgspec

from study.core import commands, json_files, registry, store, temporary
from study.core.cli import CANNOT_RUN, StudyError
from study.core.host import child
from study.experiments import experiment, shards, venvs
from study.experiments.farm.schema import Worker
from study.experiments.shards import Shard, Sharded

HOME = registry.ROOT / "build" / "farm"
PACKAGES = ("dask==2026.8.0", "distributed==2026.8.0")
DRIVER = Path(__file__).with_name("driver.py")
COMMAND = [sys.executable, str(registry.ROOT / "scripts" / "stepwise")]
OWN = ("--run", "--shard", "--jobs")  # options of the experiment that the farm gives it
WAIT = 600.0  # s for the first worker


class Found(msgspec.Struct):
    """What the driver says: one line why it ended, or what came of it. `failed`: checks of the experiment."""

    error: str = ""
    workers: list[Worker] = []
    seconds: float = 0.0
    failed: list[str] = []


def able() -> dict[str, Sharded]:
    return {name: one.sharded for name, one in experiment.find_all().items() if one.sharded}


def find_python(install: bool) -> Path:
    """A Python with Dask, in build/farm. Raises StudyError without one that may not be made."""
    python = venvs.python_of(HOME)
    if not venvs.has(python, "dask, distributed"):
        if not install:
            raise StudyError("dask is missing: --install puts it into build/farm", CANNOT_RUN)
        venvs.install(HOME, PACKAGES)
    return python


def units(name: str, words: Sequence[str]) -> int:
    """How many units of work an experiment has by those arguments. Ends as its command does for bad ones."""
    if own := [word for word in words if word.partition("=")[0] in OWN]:
        raise StudyError(f"{own[0]} is no option for behind --: the farm gives it itself")
    args = commands.parser_of(commands.find_all()[name]).parse_args(list(words))
    return len(able()[name].units(args))


def plan(
    name: str, words: Sequence[str], count: int, folder: Path, workers: int | None, scheduler: str | None
) -> dict[str, Any]:
    """The plan for the driver, as JSON. Either `workers` or `scheduler` is given."""
    file = shards.file_name(able()[name].file, Shard(1, count))
    return {
        "command": [*COMMAND, name, *words, "--jobs", "1"],
        "file": file.replace("shard-1-", "shard-{K}-"),
        "shards": count,
        "folder": str(folder.resolve()),
        "wait_s": WAIT,
        "workers": workers,
        "scheduler": scheduler,
    }


def drive(python: Path, told: dict[str, Any]) -> Found:
    """What the driver found. Raises StudyError with its one line."""
    command = [python, "-I", DRIVER]
    with temporary.folder(prefix="stepwise-farm-") as scratch:
        text = json.dumps(told | {"scratch": str(scratch)})
        done = child.run(command, input=text, stdout=subprocess.PIPE, text=True, timeout=math.inf)
    try:
        result = msgspec.json.decode(done.stdout, type=Found)
    except msgspec.DecodeError:
        raise StudyError(f"the farm's driver ended with status {done.returncode}", CANNOT_RUN) from None
    if result.error:
        raise StudyError(f"farm: {result.error}", CANNOT_RUN)
    return result


def join(name: str, folder: Path, count: int) -> list[str]:
    """Writes the run's whole file from FOLDER/shards. Lines that say so. Raises StudyError."""
    one = able()[name]
    files = [shards.file_name(one.file, Shard(number, count)) for number in range(1, count + 1)]
    whole = shards.join([json_files.read_json(folder / "shards" / file) for file in files], one.lists)
    path = folder / one.file
    experiment.find_all()[name].schemas[one.file].of(whole, str(path))
    store.write_json(path, whole)
    return [*(one.says(whole, folder) if one.says else []), str(path)]
