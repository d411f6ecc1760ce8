"""Ranks students' phases, timed in one interleaved run; writes a page.

FOLDER has a folder a student, with the files of a phase as in phases/NAME. Each is put into phases/ under a
name of its own while it is judged. It is built and run in a sandbox where bubblewrap works.

Out of the ranking is what does not compile, has a fault of memory by the judge's sanitizers, keeps something
of a frame, or is further from ground truth than --decibels allows. Ties are ties: a phase shares the rank of
a faster one where the interval of their ratio holds 1.
"""

import argparse
import contextlib
import difflib
import html
import json
import random
import secrets
import shutil
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from study.commands import try_
from study.commands.labs import judge
from study.core import cli, json_files, patches, registry, show, store
from study.core.build import ERROR, build
from study.core.cli import Outcome, StudyError
from study.core.registry import Scene, Spec
from study.labs import memory
from study.numbers import stats
from study.numbers.stats import Interval

PROJECT = 14  # the lab whose scene and error are asked for
STATUSES = {cli.FAILED: "an entry is out of the ranking"}
HEADS = (
    "rank",
    "entry",
    "time of a frame, ms [95 %]",
    "dB to truth",
    "evaluations of a camera ray",
    "parent, lines changed",
)


@dataclass(frozen=True)
class Entry:
    """`out`: why it is not ranked; `rank`: from 1; `changed`: lines added and taken against its parent."""

    name: str
    parent: str
    changed: int
    out: str = ""
    rank: int = 0
    ms: Interval = stats.UNKNOWN
    psnr_db: float = 0.0
    evaluations: float = 0.0


def changed(name: str, parent: str) -> int:
    """Lines added and lines taken."""
    mine, theirs = patches.tree(name), patches.tree(parent)
    count = 0
    for file in {*mine, *theirs} - {"phase.json"}:
        texts = (
            [line for line in tree.get(file, "").splitlines() if not line.startswith("#line ")]
            for tree in (theirs, mine)
        )
        count += sum(line[:1] in "+-" for line in list(difflib.unified_diff(*texts, n=0))[2:])
    return count


@contextlib.contextmanager
def placed(folder: Path) -> Iterator[dict[str, str]]:
    """Puts each entry into phases/; name there → name of its folder. Raises StudyError without any."""
    found = sorted(path.parent for path in folder.glob("*/phase.json"))
    if not found:
        raise StudyError(f"{folder}: no phase in it; there should be folders with a phase.json")
    made: dict[str, str] = {}
    try:
        for number, source in enumerate(found, 1):
            name = f"entry{number}"
            target = registry.ROOT / "phases" / name
            if target.exists():
                raise StudyError(
                    f"{target} is there already: another leaderboard runs, or was killed; remove it"
                )
            about = json_files.read_json(source / "phase.json")
            made[name] = source.name
            shutil.copytree(source, target, ignore=shutil.ignore_patterns("ablations"))
            (target / "phase.json").write_text(json.dumps(about | {"name": name}), encoding="utf-8")
            registry.phases.cache_clear()
            try:
                registry.phases()
            except StudyError as error:
                raise StudyError(str(error).replace(str(target), str(source))) from None
        yield made
    finally:
        for name in made:
            shutil.rmtree(registry.ROOT / "phases" / name, ignore_errors=True)
        registry.phases.cache_clear()


def verified(name: str, scene: Scene, height: int, least: float) -> Entry:
    """An entry with its error, or with why it is out."""
    parent = registry.parent_of(name) or judge.BASE.phase
    entry = Entry(name, parent, changed(name, parent))
    if not entry.changed:
        return replace(entry, out=f"{parent} as it was")
    spec = Spec.parse(name)
    if lacking := registry.missing_isa(spec):
        return replace(entry, out=f"needs {', '.join(lacking)}")
    try:
        build(spec)
        if fault := memory.looked(spec, scene, height):
            return replace(entry, out=f"a fault of memory: {fault.said.replace(f'phases/{name}/', '')}")
        seen = judge.of_views(spec, scene, height)
        side = try_.errors((judge.BASE, spec), scene, height)[0][spec]
    except StudyError as error:
        said = str(error).splitlines()
        why = next(filter(ERROR.search, said), said[-1] if said[0].endswith(":") else said[0]).strip()
        return replace(entry, out=why.replace(f"phases/{name}/", ""))
    entry = replace(entry, psnr_db=side.truth.shown.psnr_db, evaluations=side.evaluations)
    if not seen.passed:
        return replace(entry, out="a frame keeps something of another")
    why = f"less than {least:g} dB to ground truth: {show.number(entry.psnr_db)}"
    return entry if entry.psnr_db >= least else replace(entry, out=why)


def ranked(entries: Sequence[Entry], ms: dict[str, list[float]]) -> list[Entry]:
    """Ranks by median; then come those that are out."""
    order = sorted(
        (one for one in entries if not one.out), key=lambda one: stats.median_interval(ms[one.name]).value
    )
    made: list[Entry] = []
    first = 0
    for place, one in enumerate(order):
        ratio = stats.ratio_interval(ms[one.name], ms[order[first].name])
        if ratio.excludes_one:
            first = place
        made.append(replace(one, rank=first + 1, ms=stats.median_interval(ms[one.name])))
    return [*made, *(one for one in entries if one.out)]


def cells(one: Entry) -> tuple[str, ...]:
    about = f"{one.parent}, {one.changed}"
    if one.out:
        return ("–", one.name, one.out, "", "", about)
    numbers = show.spread(one.ms, 4), show.number(one.psnr_db), show.number(one.evaluations, 4)
    return (str(one.rank), one.name, *numbers, about)


def page(entries: Sequence[Entry], about: str) -> str:
    def row(words: Sequence[str], tag: str) -> str:
        return "<tr>" + "".join(f"<{tag}>{html.escape(word)}</{tag}>" for word in words) + "</tr>"

    rows = "\n".join([row(HEADS, "th"), *(row(cells(one), "td") for one in entries)])
    style = (
        "body{font:16px sans-serif;margin:2em;max-width:70em}td,th{text-align:left;padding:.3em 1em .3em 0}"
    )
    style += "table{display:block;overflow-x:auto}tr{border-bottom:1px solid #ccc}"
    return f"""<!doctype html>
<html lang="en"><meta charset="utf-8"><meta name="viewport" content="width=device-width">
<title>Leaderboard</title><style>{style}</style>
<h1>Leaderboard</h1><p>{html.escape(about)}</p>
<table>
{rows}
</table></html>
"""


def options(parser: argparse.ArgumentParser) -> None:
    add, lab = parser.add_argument, judge.labs()[PROJECT]
    add("folder", type=Path, metavar="FOLDER", help="with a folder a student")
    add("--scene", default=lab.scene, metavar="SCENE", help=f"default: {lab.scene}")
    about = f"least PSNR to ground truth; default: {lab.truth_db:g}"
    add("--decibels", type=cli.at_least(0, float), default=lab.truth_db, metavar="DB", help=about)
    add("-n", type=cli.at_least(16), default=180, metavar="HEIGHT", help="of the pictures; default: 180")
    add("--launches", type=cli.at_least(6), default=12, help="process launches of each; default: 12")
    add("--seed", type=int, default=secrets.randbelow(2**32), help="of order and padding; default: random")
    add("--hidden", action="store_true", help="entries are letters in random order; names stand in no file")
    home = registry.ROOT / "build" / "leaderboard" / "index.html"
    add("-o", "--out", type=Path, default=home, metavar="PATH", help="default: build/leaderboard/index.html")


def named(found: dict[str, str], hidden: bool, seed: int) -> dict[str, str]:
    """Name in phases/ → what is shown."""
    if not hidden:
        return found
    letters = [f"entry {chr(ord('A') + i % 26)}{i // 26 or ''}" for i in range(len(found))]
    return dict(zip(found, random.Random(seed).sample(letters, len(letters)), strict=True))


def run(args: argparse.Namespace) -> Outcome:
    scene = registry.find_scene(args.scene)
    with placed(args.folder) as found, judge.sandboxed(True):
        entries = [verified(name, scene, args.n, args.decibels) for name in found]
        specs = [Spec.parse(one.name) for one in entries if not one.out]
        ms: dict[str, list[float]] = {}
        height = args.n
        if specs:
            height = try_.timed_height(specs, scene)
            times = try_.times(specs, scene, height, args.launches, args.seed)
            ms = {str(spec): values for spec, values in times.items()}
        shown = named(found, args.hidden, args.seed)
        result = [replace(one, name=shown[one.name]) for one in ranked(entries, ms)]
    about = f"{scene.name}, pictures at height {args.n}, times at height {height}, one thread,"
    about += f" {args.launches} launches in turns; at least {args.decibels:g} dB to ground truth."
    about += " Entries of one rank cannot be told apart."
    args.out.parent.mkdir(parents=True, exist_ok=True)
    store.write_text(args.out, page(result, about))
    rows = [HEADS, *map(cells, result)]
    wide = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = [
        "  ".join(f"{word:{width}}" for word, width in zip(row, wide, strict=True)).rstrip() for row in rows
    ]
    status = cli.FAILED if any(one.out for one in result) else cli.OK
    return Outcome(
        {"entries": result, "about": about, "page": args.out}, [*lines, f"Page: {args.out}"], status=status
    )
