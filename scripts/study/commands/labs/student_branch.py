"""Makes a branch for students: the labs' starts as phases, no solutions.

Neither the work tree nor the index is touched. The branch has no history of this one. Made again, it gets a
commit more, so that labs can be opened week by week.

A start that is a patched phase becomes a phase of its own, phases/startN. Of the ladder, baseline, opt2 and
opt4 stay where a lab needs them, and lessons without their code. Systems, tests and patches are left out.
"""

import argparse
import json
import os
import re
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from study.commands import new_phase
from study.commands.labs import judge
from study.core import cli, json_files, patches, registry, store, temporary
from study.core.cli import CANNOT_RUN, Outcome, StudyError
from study.truth.subject import FLOAT

LEFT_OUT = (
    "systems",
    "docs/labs/starts",
    "docs/labs/solutions",
    "docs/labs/mistakes",
    ".github/workflows",
    ".ci",
)
WORKFLOW = "docs/labs/autograding/github-classroom.yml"  # becomes the branch's own
CODE = re.compile(r"^```c\n.*?^```\n", re.MULTILINE | re.DOTALL)
CUT = "*The code is left out on this branch.*\n"
KEPT = "calibration"  # of the tests: `make hotspots` needs it
FRONT = """
This is a branch for students: begin with [the labs](docs/labs/README.md). What solves them is left
out, so that not every command below runs.
"""
NOTE = """
Open on this branch: {labs}.

Each start is a phase of its own. What solves a lab is left out: no patch, no phase with the idea, no
test.

```sh
make new-phase NAME=mine FROM={start}
make try NAME=mine               # speed, error, evaluations beside the start
make judge LAB={number} NAME=mine        # is the goal reached? a hint if not
```

Give each lab's phase a name of its own, like `lab{number}`. It holds no file at first: copy those that you
edit from the start's folder to the same place in it.

"""
EXAMPLE = ("\nA start like ", "## How the judge decides\n")  # what the note stands for
TEACHERS = "\n## For teachers\n"
BRANCH = re.compile(r"^## A branch for students\n.*?(?=^## )", re.MULTILINE | re.DOTALL)
Lab = dict[str, Any]


def git(*words: str, at: Path, **told: str) -> str:
    """Standard output. Raises StudyError with git's last line."""
    named = {k: v for k, v in os.environ.items() if not k.startswith(("GIT_DIR", "GIT_INDEX", "GIT_WORK"))}
    try:
        done = subprocess.run(["git", *words], cwd=at, capture_output=True, text=True, env=named | told)
    except FileNotFoundError:
        raise StudyError("git is not installed", CANNOT_RUN) from None
    if done.returncode:
        said = done.stderr.strip().splitlines() or ["no word"]
        raise StudyError(f"git {words[0]}: {said[-1]}", CANNOT_RUN)
    return done.stdout.strip()


def lay_out(lab: Lab, root: Path) -> str:
    """Writes a lab's patched start as a phase without a parent; its name."""
    name = f"start{lab['number']}"
    folder = new_phase.create(name, lab["start"], root, whole=True)
    (folder / "NOTES.md").unlink()
    what = patches.chain(lab["start"], root)[-1].head["what"]
    about = json_files.read_json(folder / "phase.json")
    about |= {"title": f"The start of lab {lab['number']}", "parent": judge.BASE.phase, "idea": what}
    store.write_json(folder / "phase.json", about)
    return name


def kept(opened: Sequence[Lab], root: Path) -> tuple[set[str], set[Path]]:
    """Phases that labs begin with, or that pictures are held against; and the patches that labs name."""
    phases, named = {judge.BASE.phase}, set()
    for lab in opened:
        start, breaks = lab.get("start", ""), lab.get("breaks", "")
        phases |= {
            spec.partition("+")[0] for spec in (start, breaks) if spec and (spec == breaks or "+" not in spec)
        }
        named |= {patch.path for patch in patches.chain(breaks, root)} if breaks else set()
        if lab.get("answers", "").startswith("published"):
            phases |= {"opt2", FLOAT.phase}  # which labs 10 and 12 measure
        above: str | None = start.partition("+")[0]
        while above and above != FLOAT.phase:
            above = registry.parent_of(above, root)
        phases |= {above} if above else set()  # whose ideas the start has
    return phases, named


def without_solutions(root: Path, phases: set[str], named: set[Path]) -> None:
    """Takes out of a tree what its labs' solutions are. Lessons stay without their code."""
    others = [path for path in (root / "tests").iterdir() if path.name != KEPT]
    for path in [*(root / folder for folder in LEFT_OUT), *others]:
        shutil.rmtree(path, ignore_errors=True)
        path.unlink(missing_ok=True)
    for path in sorted((root / "phases").glob("*/**/*"), reverse=True):
        phase = path.relative_to(root / "phases").parts[0]
        lesson = path.name == "NOTES.md" or path.suffix == ".svg"
        if path.is_dir():
            if not any(path.iterdir()):
                path.rmdir()
        elif (path.suffix == ".patch" and path not in named) or not (phase in phases or lesson):
            path.unlink()
        elif path.name == "NOTES.md" and phase not in phases:
            store.write_text(path, CODE.sub(CUT, path.read_text(encoding="utf-8")))


def with_note(text: str, opened: Sequence[Lab], starts: dict[str, str]) -> str:
    """The labs' README with the branch's own commands, where a lab begins with a phase."""
    before, _, after = text.partition(EXAMPLE[0])
    begun = next((lab for lab in opened if lab.get("start") and not lab.get("breaks")), opened[0])
    start = starts.get(begun.get("start", ""), begun.get("start") or judge.BASE.phase)
    labs = f"lab{'s' * (len(opened) > 1)} {', '.join(str(lab['number']) for lab in opened)}"
    note = NOTE.format(labs=labs, start=start, number=begun["number"])
    return before + note + EXAMPLE[1] + after.partition(EXAMPLE[1])[2]


def renamed(opened: Sequence[Lab], starts: dict[str, str], root: Path) -> None:
    """Writes the labs that are open, with the names of their starts, into labs.json and the pages."""
    place, front = root / "docs" / "labs", root / "README.md"
    store.write_text(front, front.read_text(encoding="utf-8").replace("\n", f"\n{FRONT}", 1))
    for page in place.glob("*.md"):
        text = page.read_text(encoding="utf-8")
        own = next((lab for lab in opened if lab["page"] == page.name), None)
        if own and own.get("start") in starts:
            base = own["start"].partition("+")[0]
            text = re.sub(rf"\bphases/{base}/(?!NOTES|lesson)", f"phases/{starts[own['start']]}/", text)
        for old, new in starts.items():
            text = text.replace(old, new)
        if page.name == "README.md":
            text = with_note(text.partition(TEACHERS)[0], opened, starts)
        store.write_text(page, BRANCH.sub("", text))
    labs = [lab | {"start": starts.get(lab.get("start", ""), lab.get("start", ""))} for lab in opened]
    store.write_text(place / "labs.json", json.dumps({"labs": labs}, indent=4, ensure_ascii=False) + "\n")


def make(repository: Path, branch: str, numbers: Sequence[int] | None) -> dict[str, Any]:
    """Makes the branch, or a commit more on it. Raises StudyError for one that shares history with HEAD."""
    head = git("rev-parse", "--verify", "HEAD", at=repository)
    old = git("for-each-ref", "--format=%(objectname)", f"refs/heads/{branch}", at=repository)
    ours, theirs = ({*git("rev-list", one, at=repository).split()} if one else set() for one in (head, old))
    if ours & theirs:
        raise StudyError(
            f"branch {branch} has commits of this one, and with them the solutions; name another"
        )
    with temporary.folder() as room:
        tree = room / "tree"
        tree.mkdir()
        place = git("rev-parse", "--absolute-git-dir", at=repository)
        told = {"GIT_DIR": place, "GIT_INDEX_FILE": str(room / "index"), "GIT_WORK_TREE": str(tree)}
        git("read-tree", head, at=tree, **told)
        git("checkout-index", "-a", "-q", at=tree, **told)
        labs: list[Lab] = json_files.read_json(tree / "docs" / "labs" / "labs.json")["labs"]
        opened = [lab for lab in labs if not numbers or lab["number"] in numbers]
        patched = [lab for lab in opened if "+" in lab.get("start", "")]
        phases, named = kept(opened, tree)
        starts = {lab["start"]: lay_out(lab, tree) for lab in patched}
        workflow = (tree / WORKFLOW).read_text(encoding="utf-8")
        without_solutions(tree, phases | {*starts.values()}, named)
        renamed(opened, starts, tree)
        (tree / ".github" / "workflows").mkdir(parents=True)
        store.write_text(tree / ".github" / "workflows" / "lab.yml", workflow)
        git("add", "-A", at=tree, **told)
        made = git("write-tree", at=tree, **told)
        count = len(git("ls-files", at=tree, **told).splitlines())
        about = f"Labs {', '.join(str(lab['number']) for lab in opened)}, without their solutions"
        commit = git("commit-tree", made, *(["-p", old] if old else []), "-m", about, at=repository)
    git("update-ref", f"refs/heads/{branch}", commit, old or "0" * 40, at=repository)
    numbered = [lab["number"] for lab in opened]
    return {"branch": branch, "commit": commit, "labs": numbered, "starts": starts, "files": count}


def options(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("--branch", default="student", metavar="NAME", help="default: student")
    about = "the labs that are open; default: all. A start can hold the idea of another lab"
    add("--labs", type=int, nargs="+", choices=sorted(judge.labs()), metavar="LAB", help=about)


def run(args: argparse.Namespace) -> Outcome:
    made = make(registry.ROOT, args.branch, args.labs)
    cli.say("the work tree is as it was")
    starts = [f"  {new} stands for {old}" for old, new in made["starts"].items()]
    labs = ", ".join(map(str, made["labs"]))
    lines = [f"Branch {args.branch} has labs {labs} in {made['files']} files.", *starts]
    return Outcome(made, [*lines, f"Hand it out: git push COURSE {args.branch}:main"])
