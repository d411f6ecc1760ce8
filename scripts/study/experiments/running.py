"""What the commands of experiments share: options, the file that they write, figures, and how they end."""

import argparse
import itertools
import secrets
import time
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from study.core import cli, commands, machine, registry, store
from study.core.cli import Outcome, StudyError
from study.core.registry import Spec
from study.experiments.section import Part, where
from study.pictures.draw import Drawing


def options(parser: argparse.ArgumentParser, files: str, home: str, least: int = 1, seed: str = "") -> None:
    """--launches (`least` or more), --seed and --run, for `files`, below build/`home` by default."""
    add = parser.add_argument
    add("--launches", type=cli.at_least(least), default=6, help="process launches of each; default: 6")
    about = f"of {seed or 'order and padding'}; default: random"
    add("--seed", type=int, default=secrets.randbelow(2**32), help=about)
    add("--run", type=Path, metavar="DIR", help=f"for {files}; default: build/{home}")
    parser.set_defaults(home=home)


def height(
    parser: argparse.ArgumentParser, default: int, what: str = "height", name: str = "-n", least: int = 16
) -> None:
    about = f"{what}; default: {default}"
    parser.add_argument(name, type=cli.at_least(least), default=default, metavar="HEIGHT", help=about)


def budget(parser: argparse.ArgumentParser, seconds: float, full: bool = False) -> None:
    """--budget. `full`: None by default, for which --full may stand instead."""
    about, kind = f"for everything; default: {seconds:g}", cli.at_least(1, float)
    default = None if full else seconds
    parser.add_argument("--budget", type=kind, default=default, metavar="SECONDS", help=about)


def programs(names: Iterable[str]) -> tuple[list[Spec], dict[Spec, str]]:
    """Those to be timed that can run here, and why others cannot. StudyError where none can, or for truth."""
    specs = [Spec.parse(name) for name in dict.fromkeys(names)]
    for spec in specs:
        if registry.find_phase(spec.phase).family == registry.TRUTH:
            raise StudyError(f"{spec}: is truth itself; name phases that are to be timed")
    lacking = {
        spec: f"this CPU lacks {' '.join(flags)}" for spec in specs if (flags := registry.missing_isa(spec))
    }
    if len(lacking) == len(specs):
        raise StudyError("no phase of these can run on this CPU", cli.CANNOT_RUN)
    return [spec for spec in specs if spec not in lacking], lacking


def folder(args: argparse.Namespace, *files: str, gallery: str = "") -> Path:
    """--run; else build/HOME or, where that has one of `files`, the next of build/HOME-2, -3 …: a second
    result takes nothing from the first. Shards of one result are together. `gallery`: a folder of pictures by
    the hash of what drew them, which they share."""
    first: Path = registry.ROOT / "build" / args.home
    if args.run or getattr(args, "shard", None):
        return store.writable(args.run or first)
    homes = itertools.chain([first], (first.with_name(f"{first.name}-{n}") for n in itertools.count(2)))
    made = next(home for home in homes if not any((home / file).exists() for file in files))
    if made != first:
        cli.say(f"{first} has a result already, which stays: this one goes to {made}")
    store.writable(made)
    if gallery and not (made / gallery).exists() and (first / gallery).is_dir():
        (made / gallery).symlink_to(Path("..", first.name, gallery))
    return made


def about(args: argparse.Namespace) -> dict[str, Any]:
    """What a Measured says of how it was made: settings, how long it took, the machine."""
    made = {"schema": 1, "launches": args.launches, "seed": args.seed, "cpu": getattr(args, "cpu", None)}
    return {**made, "took_s": time.monotonic() - commands.begun, "context": machine.context()}


def end(
    file: Path,
    result: Any,
    parts: Sequence[Part],
    drawings: Mapping[str, Drawing] | None = None,
    images: Sequence[Path] = (),
    remarks: Sequence[str] | None = None,
    failed: Sequence[str] = (),
) -> Outcome:
    """Writes the result and its figures: how the command ends. For people: the first table, the files, and
    what was left out unless `remarks` say that."""
    if remarks is None:
        names: dict[str, list[str]] = {}
        for one in getattr(result, "left_out", []):
            names.setdefault(one.reason, []).append(" ".join(filter(None, (one.phase, where(one)))))
        remarks = [f"left out {', '.join(some)}: {reason}" for reason, some in names.items()]
    store.write_json(file, cli.plain(result))
    drawn = draw(file.parent, drawings or {})
    lines = [*(one.markdown for one in parts[:1]), *images, *drawn, file]
    return Outcome(result, lines, file.parent, remarks, failed)


def draw(path: Path, drawings: Mapping[str, Drawing]) -> list[Path]:
    return [file for name, made in drawings.items() for file in made.write(path / "figures" / name)]
