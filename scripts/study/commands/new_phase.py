"""Starts a phase from another, with a phase.json and NOTES.md to be filled in.

The new phase is derived: its folder holds only the files that differ from the parent's, none at first. From
an ablation (opt6_wide+awake) it gets the files that the patch changes. With --whole it gets a copy of every
source file.
"""

import argparse
import json
import os
import re
from pathlib import Path

from study.core import patches, registry, temporary
from study.core.cli import Outcome, StudyError
from study.labs.lab import labs, measuring

TAKEN = """accuracy asan calibration ceilings clang common emulated frames functions
hard-fma judge labs leaderboard pdf sandbox scaling systems test-opinions test-results test-scenes tests
toolchains tsan views"""
ROUNDED = "opt5_threads"  # not on a students' branch
BUILD_FOLDERS = {*TAKEN.split()}  # what else is made in build/, where a phase would be built too

NOTES = """\
# {name}: FILL IN the idea in a few words

## Bottleneck

What bounds `{parent}`, and the measurement that shows it.

## Idea

About five sentences, and an excerpt of the code in a block of c, at most 15 lines: first the
parent's, then this phase's own. `make tree-{name}` shows all of its files.

## Prediction

How much faster, on which scenes, and at what error. Written down before it is measured.

## Result

One table (median, 95 % interval, unit, machine, command), and why if it is not what was predicted.

## Limits

Where it loses, and what it cannot do. What was tried and lost is a row of docs/what-did-not-pay.md.

## Read next

Papers, with authors, title and year.
"""


def create(name: str, parent: str, root: Path = registry.ROOT, whole: bool = False) -> Path:
    """Make phases/NAME, beside its parent, visible only when it is complete. Returns the new folder.

    Derived from `parent`, or `whole`: with a copy of each of the parent's sources but residues.def. Of an
    ablation PHASE+TITLE it has the patched files, and PHASE is its parent.

    Raises StudyError for a bad or taken name, an unknown parent, and a disk that does not take it.
    """
    if not re.fullmatch(r"[a-z][a-z0-9_]*", name):
        raise StudyError(f"'{name}' is no phase name; use a-z, 0-9 and _, a letter first, like opt4b")
    if name in BUILD_FOLDERS:
        raise StudyError(f"'{name}' is no phase name: build/{name} is taken; choose another")
    phases = registry.phases(root)
    source, parent = parent, parent.partition("+")[0]
    base = registry.find_phase(parent, root)
    room = base.path.parent if base.family != registry.TRUTH else root / "phases"
    target, said = room / name, f"{room.name}/{name}"
    if name in phases or target.exists():
        raise StudyError(f"{said} exists already; choose another name")
    inherited = {k: v for k, v in patches.about(parent, root).items() if k not in ("derives", "without")}
    inherited.pop("family")
    described = dict(inherited) if whole else {}
    described |= {
        "name": name,
        "title": f"FILL IN: what {name} is called in tables, in a few words",
        "order": 1 + max(phase.order for phase in phases.values() if phase.family == base.family),
        "parent": parent,
        **({} if whole else {"derives": parent}),
        "idea": f"FILL IN: what changes against {parent} and why that should be faster, in one sentence",
        "paper": None,
    }
    if "truth" not in (held := inherited.get("tolerance") or {}) and ROUNDED in phases:
        described["tolerance"] = {**(held if whole else {}), "truth": rounding(root)}
    try:
        with temporary.folder(room, f".{name}.") as made:
            for file, content in sources(source, root, whole).items():
                (made / file).parent.mkdir(parents=True, exist_ok=True)
                (made / file).write_text(content, encoding="utf-8")
            text = json.dumps(described, indent=4, ensure_ascii=False)
            (made / "phase.json").write_text(text + "\n", encoding="utf-8")
            (made / "NOTES.md").write_text(NOTES.format(name=name, parent=parent), encoding="utf-8")
            os.chmod(made, base.path.stat().st_mode)
            made.rename(target)
    except OSError as error:
        raise StudyError(f"{said}: {error.strerror or error}") from None
    registry.phases.cache_clear()
    return target


def sources(name: str, root: Path, whole: bool) -> dict[str, str]:
    """File → text of what the new phase's folder holds: what the ablation changes, or `whole` everything.
    residues.def is left out: its entries were read in the parent's code. Raises StudyError."""
    files = patches.files(name.partition("+")[0], root)
    texts = {file: path.read_text(encoding="utf-8") for file, path in files.items() if file != "residues.def"}
    made = texts
    try:
        for patch in patches.chain(name, root):
            made = patches.apply(made, patch)
    except patches.PatchError as error:
        raise StudyError(str(error)) from None
    return made if whole else {file: text for file, text in made.items() if text != texts[file]}


def rounding(root: Path) -> dict[str, object]:
    """How much further from ground truth than baseline float's rounding may be: as opt5_threads declares it,
    the paper's last phase with nothing changed but its threads."""
    return dict(patches.about(ROUNDED, root)["tolerance"]["truth"])


def following(name: str, source: str, whole: bool) -> list[str]:
    """What is said of the new phase: what it is, and the commands of docs/tutorial.md in their order. Of an
    ablation, its lab's: they compare with the ablation."""
    parent = source.partition("+")[0]
    beside = patches.folder(parent).relative_to(registry.ROOT)
    folder = str(beside.parent / name) if len(beside.parts) > 1 else f"phases/{name}"
    if source != parent:
        lab = next((one for one in labs().values() if one.start == source), None)
        line = measuring(lab, name) if lab else f'make try NAME={name} ARGS="--against {source}"'
        return [
            f"{folder} is {source}. Edit its {', '.join(sources(source, registry.ROOT, False))}. Next:",
            f"  {line}",
            *([f"  make judge LAB={lab.number} NAME={name}"] if lab else []),
            f"  make verify PHASE={name} N=90",
            *([f"docs/labs/{lab.page} says what to do."] if lab else []),
        ]
    lines = [f"{folder} {'is a copy of' if whole else 'derives from'} {beside}. Next:"]
    if not whole:
        tree = patches.files(parent)
        file = next((one for one in ("march.c", "march/march.c") if one in tree), next(iter(tree)))
        copied, into = tree[file].relative_to(registry.ROOT), str(Path(folder, file).parent)
        made = "" if into == folder else f"mkdir -p {into} && "
        lines.append(f"  {made}cp {copied} {into}/   # or another file that you want to change; edit it")
    return [
        *lines,
        f"  make try NAME={name}                # beside {parent}: speed, error, work; WATCH=1: at each save",
        f"  make try NAME={name} SCENE=cubes    # where does it not pay?",
        f"  make verify PHASE={name} N=90       # is it right on every scene?",
        f"Then fill in {folder}/phase.json and NOTES.md, and declare its FLOPs: make flops PHASE={name}.",
        "docs/tutorial.md goes through these steps; CONTRIBUTING.md has the rest.",
    ]


def options(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("--name", required=True, help="of the new phase, like opt4b")
    about = "its parent, like opt4; or an ablation"
    add("--from", required=True, dest="parent", metavar="PHASE", help=about)
    add("--whole", action="store_true", help="copy every source file of the parent")


def run(args: argparse.Namespace) -> Outcome:
    folder = create(args.name, args.parent, whole=args.whole).relative_to(registry.ROOT)
    parent = args.parent.partition("+")[0]
    result = {"phase": args.name, "parent": parent, "folder": folder}
    return Outcome(result, following(args.name, args.parent, args.whole))
