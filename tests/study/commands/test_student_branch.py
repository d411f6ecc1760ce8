"""The branch for students: what is not on it, what stays as it was, and a lab that is judged on it."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
from pathlib import Path

import copied
import pytest

from study.commands.labs import judge, student_branch
from study.core.cli import StudyError
from study.core.registry import ROOT

if not (ROOT / ".git").exists():
    pytest.skip("this is no git repository", allow_module_level=True)


def git(folder: Path, *words: str) -> str:
    done = subprocess.run(["git", *words], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def clone(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """This repository, with branches of labs 1 and 11, of 2 and 3, and of all labs."""
    clone = tmp_path_factory.mktemp("clone") / "stepwise"
    git(ROOT, "clone", "-q", "--shared", str(ROOT), str(clone))
    for key, value in (("user.name", "A Teacher"), ("user.email", "teacher@example.org")):
        git(clone, "config", key, value)
    (clone / "README.md").write_text("an edit that is not committed\n")
    student_branch.make(clone, "two", [1, 11])
    student_branch.make(clone, "three", [3, 2])
    student_branch.make(clone, "all", None)
    return clone


def files(clone: Path, branch: str) -> set[str]:
    return set(git(clone, "ls-tree", "-r", "--name-only", branch).split("\n"))


def phases_of(names: set[str]) -> set[str]:
    return {
        name.split("/")[1] for name in names if name.startswith("phases/") and name.endswith("phase.json")
    }


def test_no_file_of_solutions(clone: Path) -> None:
    patched = {f"start{number}" for number, lab in judge.labs().items() if "+" in lab.start}
    assert phases_of(files(clone, "all")) == {"baseline", "opt2", "opt4", *patched}
    assert phases_of(files(clone, "two")) == {"baseline", "start11"}
    assert student_branch.kept([vars(judge.labs()[12])], clone)[0] == {"baseline", "opt2", "opt4"}
    for branch in ("two", "all"):
        names = files(clone, branch)
        assert not [name for name in names if name.startswith(("systems/", "docs/labs/so", "docs/labs/st"))]
        assert {name.split("/")[1] for name in names if name.startswith("tests/")} == {"calibration"}
        named = {"phases/opt2/ablations/fast_root_1.patch", "phases/opt2/ablations/fast_root_2.patch"}
        assert {name for name in names if name.endswith(".patch")} == (named if branch == "all" else set())
        assert "truth/phase.json" in names and ".github/workflows/lab.yml" in names
        others = {name.split("/")[1] for name in names if name.startswith("phases/")} - phases_of(names)
        for phase in others:
            kept = {name for name in names if name.startswith(f"phases/{phase}/")}
            assert {Path(name).suffix for name in kept} <= {".md", ".svg"}
            assert "```c" not in git(clone, "show", f"{branch}:phases/{phase}/NOTES.md")
        assert others


def test_no_solution_in_its_history(clone: Path) -> None:
    """And nothing else of the clone is touched. A second time the branch gets a commit more."""
    head = git(clone, "rev-parse", "HEAD")
    assert git(clone, "rev-list", "--count", "two").strip() == "1"
    assert git(clone, "rev-parse", "HEAD") == head and git(clone, "status", "--porcelain") == " M README.md\n"
    first = git(clone, "rev-parse", "two")
    student_branch.make(clone, "two", [1, 11, 4])
    assert git(clone, "rev-parse", "two^") == first and "start4" in phases_of(files(clone, "two"))
    git(clone, "branch", "mine", "HEAD")
    with pytest.raises(StudyError, match="mine"):
        student_branch.make(clone, "mine", [1])
    git(clone, "update-ref", "refs/heads/two", first.strip())


def test_labs_and_pages_name_the_starts_of_the_branch(clone: Path) -> None:
    labs = json.loads(git(clone, "show", "two:docs/labs/labs.json"))["labs"]
    assert {lab["number"]: lab["start"] for lab in labs} == {1: "baseline", 11: "start11"}
    page = git(clone, "show", "two:docs/labs/11-intrinsics.md")
    assert "FROM=start11\n" in page and "scalar_octahedron" not in page and "phases/start11/vec.h" in page
    readme = git(clone, "show", "two:docs/labs/README.md")
    assert "## For teachers" not in readme and re.findall(r"FROM=(\S+)", readme) == ["baseline"]
    assert "FROM=start2\n" in git(clone, "show", "three:docs/labs/README.md")
    assert "## A branch for students" not in git(clone, "show", "two:docs/labs/COURSE.md")
    assert "phases/start4/core/packet_group.h" in git(clone, "show", "all:docs/labs/4-sleeping-shapes.md")


@pytest.mark.slow
def test_a_lab_is_judged_on_it(clone: Path, tmp_path: Path) -> None:
    """Lab 11: as it was, and with the lanes' octahedron."""
    work = tmp_path / "work"
    git(clone, "worktree", "add", "-q", str(work), "two")
    for name in git(work, "ls-files").splitlines():
        os.utime(work / name, (0, 0))
    (copied.built(work, "baseline") / ".venv").symlink_to(ROOT / ".venv")

    def stepwise(*words: object) -> subprocess.CompletedProcess[str]:
        command = [work / "scripts/stepwise", *words]
        return subprocess.run(list(map(str, command)), cwd=work, capture_output=True, text=True)

    assert stepwise("new-phase", "--name", "mine", "--from", "start11").returncode == 0
    for fails in ("unchanged", ""):
        done = stepwise("judge", 11, "--phase", "mine", "--untimed", "-n", 36, "--json")
        assert done.returncode == (1 if fails else 0), done.stdout + done.stderr
        checks = json.loads(done.stdout)["result"]["checks"]
        assert [one["name"] for one in checks if not one["passed"]] == [fails] * bool(fails)
        shutil.copyfile(ROOT / "phases/opt3/sdf.h", work / "phases/mine/sdf.h")
