""".github/gate.sh in a repository whose setup and commands are stand-ins, and what the workflow calls."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from study.core import commands
from study.core.registry import ROOT

GATE = ROOT / ".github" / "gate.sh"
# Writes its words and where it is down; `sweep` prints a run, `compare --by` ends with the status asked for.
STAND_IN = """\
#!/usr/bin/env -S python3 -I
import json, os, sys
log = os.environ["LOG"]
here = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
with open(log, "a") as file:
    print(json.dumps([here, *sys.argv[1:]]), file=file)
if os.environ.get("BREAK") == sys.argv[1]:
    sys.exit(3)
if sys.argv[1] == "sweep":
    print(json.dumps({"run": sys.argv[sys.argv.index("--results") + 1] + "/machine/run"}))
if "--fail-on-slower" in sys.argv:
    print("the comparison")
    sys.exit(int(os.environ["SLOWER"]))
"""
MAKEFILE = f"setup:\n\t@mkdir -p .venv/bin && ln -sf '{sys.executable}' .venv/bin/python\n"


def git(folder: Path, *words: str) -> str:
    about = ["-c", "user.name=a", "-c", "user.email=a@b.c", "-c", "protocol.file.allow=always"]
    return subprocess.check_output(["git", "-C", folder, *about, *words], text=True, stderr=subprocess.PIPE)


@pytest.fixture
def here(tmp_path: Path) -> Path:
    """A clone whose path has a space in it."""
    clone = tmp_path / "a clone"
    (clone / "scripts").mkdir(parents=True)
    (clone / ".github").mkdir()
    shutil.copy(GATE, clone / ".github")
    (clone / "scripts" / "stepwise").write_text(STAND_IN)
    (clone / "scripts" / "stepwise").chmod(0o755)
    (clone / "Makefile").write_text(MAKEFILE)
    git(clone, "init", "-q")
    git(clone, "add", ".")
    git(clone, "commit", "-q", "-m", "all")
    return clone


def gate(clone: Path, *arguments: object, **variables: str) -> subprocess.CompletedProcess[str]:
    told = {"LOG": str(clone.parent / "log"), "SLOWER": "0"} | variables
    command = [".github/gate.sh", *map(str, arguments)]  # a relative path, which CDPATH would turn elsewhere
    how = {"capture_output": True, "text": True, "timeout": 60, "cwd": clone}
    return subprocess.run(command, env=os.environ | told, **how)


def called(clone: Path) -> list[list[str]]:
    return [json.loads(line) for line in (clone.parent / "log").read_text().splitlines()]


@pytest.mark.parametrize("arguments", [(), ("HEAD",), ("HEAD", "a", "b")])
def test_it_asks_for_a_commit_and_a_folder(here: Path, arguments: tuple[str, ...]) -> None:
    done = gate(here, *arguments)
    assert done.returncode == 2 and done.stderr.count("\n") == 1 and "two arguments" in done.stderr


def test_an_unknown_commit_ends_it(here: Path, tmp_path: Path) -> None:
    done = gate(here, "no-such-commit", tmp_path / "out")
    assert done.returncode not in (0, 1) and not (tmp_path / "out" / "base").exists()


@pytest.mark.parametrize("variables", [{"GATE_BY": "money"}, {"GATE_LEAST": "2"}, {"GATE_LEAST": "%"}])
def test_a_verdict_that_there_is_not_is_refused_before_an_hour_of_measuring(
    here: Path, tmp_path: Path, variables: dict[str, str]
) -> None:
    done = gate(here, "HEAD", tmp_path / "out", **variables)
    assert done.returncode == 2 and done.stderr.count("\n") == 1 and not (tmp_path / "log").exists()


def test_it_measures_both_and_confirms_with_the_programs_of_the_base(here: Path, tmp_path: Path) -> None:
    """Whatever CDPATH, PYTHONHOME and paths are. The status is that of the comparison, which is kept."""
    elsewhere = tmp_path / "elsewhere"
    (elsewhere / ".github").mkdir(parents=True)
    (elsewhere / "an out").mkdir()
    out = here / "an out"
    for status in ("0", "1"):
        done = gate(here, "HEAD", "an out", CDPATH=str(elsewhere), PYTHONHOME="/nowhere", SLOWER=status)
        assert done.returncode == int(status), done.stderr
        assert not (out / "base").exists() and (out / "comparison.txt").read_text() == "the comparison\n"
    first, second, verify, export, compare = called(here)[:5]
    assert (first[0], second[0]) == (str(out / "base"), str(here))
    assert [line[1] for line in (first, second, verify, export)] == ["sweep", "sweep", "verify", "compare"]
    assert compare[1:4] == ["compare", f"{out}/before/machine/run", f"{out}/after/machine/run"]
    told = dict(zip(compare[4:-1:2], compare[5::2], strict=True))
    assert told == {"--by": "baseline", "--least": "2%", "--confirm": str(out / "base")}


def test_by_instructions_both_are_counted(here: Path, tmp_path: Path) -> None:
    assert gate(here, "HEAD", tmp_path / "out", GATE_BY="instructions", GATE_LEAST=".5%").returncode == 0
    found = commands.find_all()
    for _, name, *words in called(here):
        commands.parser_of(found[name]).parse_args(words)  # SystemExit for what it does not know
    counted = [line for line in called(here) if line[1] == "flops"]
    assert [line[-1].split("/")[-3] for line in counted] == ["before", "after"]
    assert called(here)[-1][4:8] == ["--by", "instructions", "--least", ".5%"]


@pytest.mark.parametrize("broken", ["sweep", "flops"])
def test_a_side_that_cannot_be_measured_ends_it(here: Path, tmp_path: Path, broken: str) -> None:
    done = gate(here, "HEAD", tmp_path / "out", GATE_BY="instructions", BREAK=broken)
    assert done.returncode == 3 and called(here)[-1][1] == broken and not (tmp_path / "out" / "base").exists()


LEFT = [pytest.param(name, marks=pytest.mark.slow) for name in ("locked", "entry", "of a clone that is gone")]


@pytest.mark.parametrize("left", ["whole", *LEFT])
def test_what_a_killed_job_left_behind_is_replaced(here: Path, tmp_path: Path, left: str) -> None:
    base = tmp_path / "out" / "base"
    owner = here
    if left.startswith("of"):
        git(tmp_path, "clone", "-q", str(here), str(tmp_path / "other"))
        owner = tmp_path / "other"
    git(owner, "worktree", "add", "--detach", str(base), "HEAD")
    (base / "half-built").write_text("")
    if left == "locked":
        git(here, "worktree", "lock", str(base))
    if left == "entry":
        shutil.rmtree(base)
    if left.startswith("of"):
        shutil.rmtree(owner)
    assert gate(here, "HEAD", tmp_path / "out").returncode == 0
    assert not base.exists() and len(git(here, "worktree", "list").splitlines()) == 1


@pytest.mark.parametrize("what", ["a folder", "another repository", "its worktree"])
def test_what_is_not_its_own_is_left_alone(here: Path, tmp_path: Path, what: str) -> None:
    base, other = tmp_path / "out" / "base", tmp_path / "other"
    if what == "a folder":
        base.mkdir(parents=True)
    elif what == "another repository":
        git(tmp_path, "clone", "-q", str(here), str(base))
    else:
        git(tmp_path, "clone", "-q", str(here), str(other))
        git(other, "worktree", "add", "--detach", str(base), "HEAD")
    (base / "precious").write_text("")
    done = gate(here, "HEAD", tmp_path / "out")
    assert done.returncode == 2 and str(base) in done.stderr and (base / "precious").exists()


def test_the_workflow_calls_what_is_there() -> None:
    """Its scripts and make's targets exist."""
    text = (ROOT / ".github" / "workflows" / "gate.yml").read_text(encoding="utf-8")
    runs = re.findall(r"- run: (.*)", text)
    assert [line.split()[0] for line in runs] == ["make", ".github/gate.sh"]
    assert re.search(rf"^{runs[0].split()[1]}:", (ROOT / "Makefile").read_text(), re.MULTILINE)
