"""The source trees of derived phases and of ablations, small patches kept with their phase.

A phase whose phase.json says `"derives": "PARENT"` holds only the files that differ from its parent's; files
of the parent named in `"without"` are left out. Its tree is its folder laid over its parent's.

A phase stands in phases/NAME, systems/NAME, or truth: the folder is its family. A derived phase may have its
parent in another family.

NAME/ablations/TITLE.patch is written NAME+TITLE wherever the name of a phase may stand. Its head,
lines `key: value` (a line that begins with blanks goes on with the one before), says

    what        what is different, in one sentence
    paper       what the paper claims of the step, and in brackets where: a speed-up like 1.2×, "no gain",
                "not satisfying", or other words
    direction   added: the patched phase has the step, removed: it lacks it
    against     the phase, variant or ablation that it is compared with, like opt2@opt3
    after       (optional) title of the patch of the same phase that comes before it
    beside      (optional) a phase timed next to it, against the same
    flags       (optional) the phase whose cflags and instruction set it is built with
    tolerance   (optional) the phase whose tolerance it is held to, where its own phase's does not fit
    error       (optional) why its picture need not be within any tolerance: an approximation
    scenes      (optional) the scenes where the step can matter, separated by blanks
    costs       (optional) why the patched costs.def says nothing of its FLOPs
    idea        (optional) the idea that the patch takes out, in a few words: a row of the lesson's table
    code        (optional) where the idea stands, for its number of lines: FILE or FILE:FUNCTION, by blanks
    counts      (optional) a heading: the patched program counts pixels and ticks by what that names, and at
                its end writes a line of each, "PIXELS TICKS NAME", into the file STEPWISE_COUNTS

and then comes a unified diff (as of `diff -u`, `git diff`; paths a/FILE b/FILE in the phase's tree).

A patch of docs/labs/starts/NAME, or of solutions or mistakes there, is named and built alike, but is no
ablation: no suite of theirs times it.

Run as a program, by make: `patches.py NAME FOLDER` or `patches.py NAME+TITLE FOLDER` writes the tree.
Standard library only: it runs before anything is installed.
"""

import json
import os
import re
import sys
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
FAMILIES = {"phases": "ladder", "systems": "systems", "truth": "truth"}  # by the first folder of the path
REQUIRED = ("what", "paper", "direction", "against")
OPTIONAL = "after", "beside", "flags", "tolerance", "error", "scenes", "costs", "idea", "code", "counts"
SOURCES = ("*.[ch]", "*.def")
OWN_KEYS = "title", "order", "parent", "idea", "paper", "derives", "without"  # never a parent's
HUNK = re.compile(r"@@ -(\d+)(?:,(\d+))? \+\d+(?:,(\d+))? @@")


class PatchError(Exception):
    """One line for the user: which patch, what is wrong with it and what would be right."""


@dataclass(frozen=True)
class Patch:
    """One NAME/ablations/TITLE.patch or a lab's. `diff`: its lines from `--- ` on, `first` the first's."""

    path: Path
    head: dict[str, str]
    diff: tuple[str, ...]
    first: int

    @property
    def name(self) -> str:
        return f"{self.phase}+{self.path.stem}"

    @property
    def phase(self) -> str:
        return self.path.parents[self.path.parent.name == "ablations"].name


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise PatchError(f"{path}: {getattr(error, 'strerror', None) or error}") from None


def read(path: Path) -> Patch:
    """The patch with its head understood. Raises PatchError with file and line."""
    lines = _text(path).splitlines()
    begin = next((i for i, line in enumerate(lines) if line.startswith("--- ")), None)
    if begin is None:
        raise PatchError(f"{path}: no diff (a line that begins with '--- '), as `diff -u` would make it")
    head: dict[str, str] = {}
    key = ""
    for number, line in enumerate(lines[:begin], 1):
        if key and line[:1].isspace() and line.strip():
            head[key] += " " + line.strip()
            continue
        key, colon, value = line.partition(":")
        if not line.strip() or line.startswith(("diff ", "index ", "#")):
            key = ""
        elif not colon or key not in REQUIRED + OPTIONAL:
            known = ", ".join(REQUIRED + OPTIONAL)
            raise PatchError(f"{path}:{number}: '{line[:40]}' is no line 'key: value'; the keys are {known}")
        elif key in head:
            raise PatchError(f"{path}:{number}: a second '{key}:'")
        else:
            head[key] = value.strip()
    if missing := [key for key in REQUIRED if not head.get(key)]:
        raise PatchError(f"{path}: its head lacks '{missing[0]}: …'")
    if head["direction"] not in ("added", "removed"):
        raise PatchError(f"{path}: direction is '{head['direction']}', must be added or removed")
    return Patch(path, head, tuple(lines[begin:]), begin + 1)


def folders(root: Path = ROOT) -> dict[str, Path]:
    """Every phase's folder by its name. A folder whose name begins with a dot is in the making."""
    found = [path for family in FAMILIES for path in root.glob(f"{family}/[!.]*/phase.json")]
    return {path.parent.name: path.parent for path in sorted([*found, *root.glob("truth/phase.json")])}


def folder(phase: str, root: Path = ROOT) -> Path:
    """The phase's folder. Raises PatchError if there is no such phase."""
    for place in ("phases/" + phase, "systems/" + phase, *(["truth"] if phase == "truth" else [])):
        if (root / place / "phase.json").is_file():
            return root / place
    raise PatchError(f"no phase '{phase}'; there are {', '.join(sorted(folders(root)))}")


def titles(phase: str, root: Path = ROOT) -> list[str]:
    """Names of the phase's ablations, sorted."""
    return sorted(path.stem for path in (folder(phase, root) / "ablations").glob("[!.]*.patch"))


def file(phase: str, title: str, root: Path = ROOT) -> Path:
    """Where NAME+TITLE would stand: among the phase's ablations or, if it is there, among the labs'."""
    own = folder(phase, root) / "ablations" / f"{title}.patch"
    return own if own.is_file() else next(root.glob(f"docs/labs/*/{phase}/{title}.patch"), own)


def chain(name: str, root: Path = ROOT) -> list[Patch]:
    """The patches that make NAME+TITLE, in the order in which they are applied. Raises PatchError."""
    phase, _, title = name.partition("+")
    found: list[Patch] = []
    while title:
        path = file(phase, title, root)
        if not path.is_file():
            known = ", ".join(titles(phase, root)) or "none"
            wanted = f", which {found[0].path} comes after" if found else ""
            raise PatchError(f"no ablation '{phase}+{title}'{wanted}; {phase} has {known}")
        if path in [patch.path for patch in found]:
            raise PatchError(f"{path}: comes after itself")
        found.insert(0, read(path))
        title = found[0].head.get("after", "")
    return found


def _place(lines: list[str], old: list[str], expected: int) -> int | None:
    """Where the hunk's old lines stand: where expected, else at the only other place that has them."""
    if lines[expected : expected + len(old)] == old and expected >= 0:
        return expected
    first = [i for i in range(len(lines) - len(old) + 1) if old and lines[i : i + len(old)] == old]
    return first[0] if len(first) == 1 else None


def apply(files: dict[str, str], patch: Patch) -> dict[str, str]:
    """The files (name → text) with the patch applied, whole or not at all: every line of context must be
    there as it is. Raises PatchError with the patch's line."""
    made = {name: text.splitlines() for name, text in files.items()}
    name, shift, i = "", 0, 0

    def bad(what: str, at: int) -> PatchError:
        return PatchError(f"{patch.path}:{patch.first + at}: {what}")

    while i < len(patch.diff):
        line, at = patch.diff[i], i
        i += 1
        if line.startswith("--- "):
            target = patch.diff[i] if i < len(patch.diff) else ""
            match = re.match(r"\+\+\+ (?:b/)?([^\t]+)", target)
            if not match or match[1] not in made:
                known = ", ".join(made)
                raise bad(f"'{target}' names no file of the phase; there are {known}", i)
            name, shift, i = match[1], 0, i + 1
        elif hunk := HUNK.match(line):
            if not name:
                raise bad("a hunk before its file", at)
            counts = [int(n) if n is not None else 1 for n in hunk.groups()[1:]]
            old: list[str] = []
            new: list[str] = []
            while len(old) < counts[0] or len(new) < counts[1]:
                body = patch.diff[i] if i < len(patch.diff) else "end"
                if body[:1] not in (" ", "-", "+", ""):
                    raise bad("the hunk ends early", at)
                old += [body[1:]] if body[:1] != "+" else []
                new += [body[1:]] if body[:1] != "-" else []
                i += 1
            if [len(old), len(new)] != counts:
                raise bad("the hunk's lines are not as many as its head says", at)
            begin = int(hunk[1]) - (1 if old else 0)  # of nothing: the line behind which it goes
            where = _place(made[name], old, begin + shift)
            if where is None:
                what = f"does not apply to {patch.phase}/{name}, which has changed there"
                raise bad(f"{what}; make the patch again", at)
            made[name][where : where + len(old)] = new
            shift = where - begin + len(new) - len(old)
        elif line.strip() and not line.startswith(("diff ", "index ")):
            raise bad(f"'{line[:40]}' is no line of a unified diff", at)
    return {file: "".join(f"{line}\n" for line in lines) for file, lines in made.items()}


def _own_json(phase: str, root: Path) -> dict:
    path = folder(phase, root) / "phase.json"
    try:
        data = json.loads(_text(path))
    except json.JSONDecodeError as error:
        raise PatchError(f"{path}:{error.lineno}:{error.colno}: {error.msg}") from None
    if not isinstance(data, dict):
        raise PatchError(f"{path}: must be a JSON object")
    return data


def lineage(phase: str, root: Path = ROOT) -> list[str]:
    """The phase, what it derives from, what that derives from, and so on. Raises PatchError."""
    found = [phase]
    while parent := _own_json(found[-1], root).get("derives"):
        path = folder(found[-1], root) / "phase.json"
        if parent in found:
            raise PatchError(f"{path}: derives: {parent} derives from {phase} itself")
        if parent not in folders(root):
            raise PatchError(f"{path}: derives: there is no phase '{parent}'")
        found.append(parent)
    return found


def about(phase: str, root: Path = ROOT) -> dict:
    """phase.json of a phase. What a derived phase leaves out (a key, a class of `tolerance`) is its parent's;
    a class that is null there it has not. Raises PatchError."""
    data: dict = {}
    for name in reversed(lineage(phase, root)):
        own, parents = _own_json(name, root), data.get("tolerance", {})
        data = {key: value for key, value in data.items() if key not in OWN_KEYS} | own
        if parents and isinstance(own.get("tolerance"), dict):
            both = parents | own["tolerance"]
            data["tolerance"] = {key: value for key, value in both.items() if value is not None}
    return data | {"family": FAMILIES[folder(phase, root).relative_to(root).parts[0]]}


def described(name: str, root: Path = ROOT) -> dict:
    """phase.json of NAME or NAME+TITLE: its phase's, with what the head of the patch changes."""
    data = about(name.partition("+")[0], root)
    if "+" not in name:
        return data
    head = chain(name, root)[-1].head
    data |= {"name": name, "title": head["what"], "idea": head["what"]}
    if "flags" in head:
        other = about(head["flags"], root)
        data |= {key: other[key] for key in ("cflags", "isa")}
    if "tolerance" in head:
        data["tolerance"] = about(head["tolerance"], root)["tolerance"]
    return data


def files(phase: str, root: Path = ROOT) -> dict[str, Path]:
    """Every source file of a phase by its path in the tree: its own, else the nearest ancestor's."""
    found: dict[str, Path] = {}
    for name in reversed(lineage(phase, root)):
        place = folder(name, root)
        for left_out in _own_json(name, root).get("without", []):
            if found.pop(left_out, None) is None:
                raise PatchError(f"{place / 'phase.json'}: without: the parent has no '{left_out}'")
        for pattern in SOURCES:
            for path in sorted(place.rglob(pattern)):
                found[str(path.relative_to(place))] = path
    return found


def tree(name: str, root: Path = ROOT) -> dict[str, str]:
    """Every source file of NAME or NAME+TITLE (path in the tree -> text), and its phase.json. A C file that
    no patch changed begins with #line: the compiler names the file that is edited. Raises PatchError."""
    paths = files(name.partition("+")[0], root)
    texts = {file: _text(path) for file, path in sorted(paths.items())}
    made = texts
    for patch in chain(name, root):
        made = apply(made, patch)
    for file, text in made.items():
        if text == texts[file] and file.endswith((".c", ".h")):
            made[file] = f'#line 1 "{paths[file].relative_to(root)}"\n{text}'
    return made | {"phase.json": json.dumps(described(name, root), indent=4, ensure_ascii=False) + "\n"}


def write(name: str, target: Path, root: Path = ROOT) -> None:
    """The tree into a folder: only what changed, so that make rebuilds only what must be."""
    texts = tree(name, root)
    for path in [path for path in target.rglob("*") if path.is_file()]:
        if str(path.relative_to(target)) not in texts and not path.name.endswith(".tmp"):
            path.unlink(missing_ok=True)
    for file, text in texts.items():
        path = target / file
        if not path.is_file() or path.read_text(encoding="utf-8") != text:
            path.parent.mkdir(parents=True, exist_ok=True)
            temporary = path.with_name(f"{path.name}.{os.getpid()}.tmp")
            temporary.write_text(text, encoding="utf-8")
            temporary.rename(path)


def main() -> None:
    if len(sys.argv) != 3:
        sys.exit("usage: patches.py NAME|NAME+TITLE FOLDER")
    try:
        write(sys.argv[1], Path(sys.argv[2]))
    except (PatchError, OSError) as error:
        sys.exit(f"patches: {error}")
    print(sys.argv[2])  # for make: the tree is there


if __name__ == "__main__":
    main()
