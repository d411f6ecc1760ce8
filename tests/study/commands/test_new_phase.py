"""A phase from another: what is copied, what is filled in, what is refused."""

import json
import os
import re
import shutil
import subprocess
from pathlib import Path

import copied
import emitted
import pytest

from study.commands import new_phase
from study.core import patches, registry
from study.core.cli import StudyError
from study.core.registry import ROOT


@pytest.fixture
def root(tmp_path):
    """A tree of its own with the phases of this one."""
    return copied.folders(tmp_path, "phases")


def test_a_derived_phase_holds_no_source_at_first(root):
    made = new_phase.create("opt2_b", "opt2", root)
    assert set(os.listdir(made)) == {"phase.json", "NOTES.md"}
    assert patches.files("opt2_b", root) == patches.files("opt2", root)
    assert registry.phases(root)["opt2_b"].derives == "opt2"


@pytest.mark.parametrize("parent", ["opt2", "opt5_threads"])
def test_a_whole_copy_has_every_file_of_its_parents_tree(root, parent):
    made = new_phase.create("mine", parent, root, whole=True)
    tree = patches.files(parent, root)
    tree.pop("residues.def", None)  # was read in the parent's code
    assert tree and tree.keys() == patches.files("mine", root).keys()
    assert all((made / name).read_bytes() == path.read_bytes() for name, path in tree.items())
    assert made == root / "phases" / "mine" and registry.phases(root)["mine"].derives is None


def test_phase_json_is_filled(root):
    before = registry.phases(root)
    new_phase.create("opt4b", "opt4", root)
    after = registry.phases(root)
    made, parent = after["opt4b"], before["opt4"]
    assert (made.name, made.parent, made.paper) == ("opt4b", "opt4", None)
    assert made.order == 1 + max(p.order for p in before.values() if p.family == parent.family)
    assert [name for name, p in after.items() if p.family == parent.family][-1] == "opt4b"
    for same in ("family", "isa", "precision", "lanes", "threads", "algorithm", "cflags"):
        assert getattr(made, same) == getattr(parent, same)
    rounding = after["opt5_threads"].tolerance["truth"]  # opt4 itself is not held against ground truth
    assert made.tolerance == parent.tolerance | {"truth": rounding}
    assert made.title.startswith("FILL IN") and made.idea.startswith("FILL IN")


def test_notes_are_a_fresh_skeleton(root):
    (root / "phases/opt2/NOTES.md").write_text("# opt2\nzebra\n")
    made = new_phase.create("x", "opt2", root)
    notes = (made / "NOTES.md").read_text()
    assert "zebra" not in notes
    headings = [line for line in notes.splitlines() if line.startswith("#")]
    wanted = ["Bottleneck", "Idea", "Prediction", "Result", "Limits", "Read next"]
    assert headings[0].startswith("# x: FILL IN") and headings[1:] == [f"## {title}" for title in wanted]


NO_NAMES = ("", "Opt", "4opt", "opt-4", "opt4@opt2", "../opt", "öpt", "a\n")
REFUSED = [(name, "opt2", f"'{name}'") for name in NO_NAMES]
REFUSED += [(name, "opt2", f"build/{name} ") for name in ("common", "calibration")]
REFUSED += [(name, "opt2", f"phases/{name} ") for name in ("opt1", "half")]
REFUSED += [("x", "op2", "opt2"), ("x", "opt3+sleef", "octahedron_no_exit")]


def test_what_is_refused(root):
    (root / "phases/half").mkdir()
    before = set((root / "phases").iterdir())
    for name, parent, said in REFUSED:
        with pytest.raises(StudyError, match=re.escape(said)):
            new_phase.create(name, parent, root)
    assert set((root / "phases").iterdir()) == before


def test_a_failure_leaves_nothing_behind(root, monkeypatch):
    before = set((root / "phases").iterdir())

    def full(self, target):
        raise OSError(28, "full")

    monkeypatch.setattr(Path, "rename", full)
    with pytest.raises(StudyError, match="phases/x: full"):
        new_phase.create("x", "opt2", root)
    assert set((root / "phases").iterdir()) == before


@pytest.mark.slow
def test_the_new_phase_builds_and_renders_as_its_parent(root):
    copied.folders(root, "common", "scripts/study")
    shutil.copy(ROOT / "Makefile", root)
    new_phase.create("naive2", "baseline", root)
    for name in ("naive2", "baseline"):
        subprocess.run(["make", "-s", "-C", root, f"build/{name}/render"], check=True, capture_output=True)
    command = [root / "build/naive2/render", root / "common/scenes/cubes.json", "-n", "3", "--json"]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    assert json.loads(done.stdout)["phase"] == "naive2"


@pytest.mark.parametrize("as_json", [False, True])
def test_command_says_what_is_next(root, monkeypatch, capsys, as_json):
    monkeypatch.setattr(new_phase, "create", lambda name, parent, whole: registry.ROOT / "phases" / name)
    assert emitted.told("new-phase", "--name", "x", "--from", "opt2", *["--json"] * as_json) == 0
    said = capsys.readouterr().out
    if as_json:
        assert emitted.result(said) == {"phase": "x", "parent": "opt2", "folder": "phases/x"}
    else:
        assert "cp phases/opt2/march.c phases/x/" in said


@pytest.mark.parametrize(
    ("source", "lab"), [("opt6_wide+awake", 4), ("opt7_tiles+whole_trees", 15), ("opt6_wide+rsqrt", 0)]
)
def test_what_is_next_of_an_ablation_compares_with_it(source, lab):
    """So with a lab's start by the lab's own commands, without a copy of the file that its idea stands in."""
    said = "\n".join(new_phase.following("own", source, False))
    tried = re.findall(r"^ *make try (.*)$", said, re.MULTILINE)
    assert tried and all(f'"--against {source}"' in line and "NAME=own" in line for line in tried)
    assert "cp " not in said and all(file in said for file in new_phase.sources(source, ROOT, False))
    assert re.findall(r"judge LAB=(\d+) NAME=own", said) == [str(lab)] * bool(lab)


@pytest.mark.parametrize("whole", [False, True])
def test_what_is_next_is_what_the_tutorial_does(whole):
    """The same make commands in the same order, of a phase called mine."""
    tutorial = (ROOT / "docs" / "tutorial.md").read_text(encoding="utf-8")
    there = re.findall(r"^make .*\b(?:NAME|PHASE)=mine\b.*$", tutorial, re.MULTILINE)
    said = [line.partition("#")[0].strip() for line in new_phase.following("mine", "opt1", whole)]
    assert [line for line in said if line.startswith("make ")] == there[1:]
    assert "new-phase" in there[0]
