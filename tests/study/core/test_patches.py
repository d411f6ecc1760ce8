"""Patches kept with a phase: their heads, how they apply, the trees that they make."""

from __future__ import annotations

import difflib
import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from study.core import patches, registry
from study.core.cli import StudyError
from study.core.patches import PatchError
from study.core.registry import ROOT, Spec

LINES = st.lists(st.sampled_from(["", "a", "b", "c", "-- x", "++ y", "@@ -1 +1 @@", "d d"]), max_size=30)


def patch_of(old: list[str], new: list[str], context: int = 3, path: Path = Path("p/x/ablations/t.patch")):
    diff = difflib.unified_diff(old, new, "a/f", "b/f", lineterm="", n=context)
    return patches.Patch(path, {}, tuple(diff), 1)


def text(lines: list[str]) -> str:
    return "".join(f"{line}\n" for line in lines)


@example(["a"] * 9, ["a", "b", *"aaa", "b", *"aaa", "b", *"aa"], 0)  # three hunks whose places add up
@given(LINES, LINES, st.integers(0, 3))
def test_a_diff_is_undone_by_applying_it(old, new, context):
    assert patches.apply({"f": text(old)}, patch_of(old, new, context)) == {"f": text(new)}


def test_a_place_that_moved_is_found_but_not_guessed():
    old = [f"line {i}" for i in range(20)]
    new = [*old[:10], "added", *old[10:]]
    moved = ["first", "second", *old]
    assert patches.apply({"f": text(moved)}, patch_of(old, new)) == {
        "f": text([*moved[:12], "added", *moved[12:]])
    }
    with pytest.raises(PatchError, match=r"t\.patch:3: .* x/f"):
        patches.apply({"f": text([*moved, *moved])}, patch_of(old, new))  # two places


def test_a_changed_line_of_context_is_refused_with_its_place():
    old = [f"line {i}" for i in range(20)]
    changed = [*old[:9], "edited", *old[10:]]
    with pytest.raises(PatchError, match=r"p/x/ablations/t\.patch:3: .* x/f"):
        patches.apply({"f": text(changed)}, patch_of(old, [*old[:10], "added", *old[10:]]))


@pytest.mark.parametrize(
    ("diff", "line"),
    [
        (["--- a/g", "+++ b/g", "@@ -1 +1 @@", "-a", "+b"], 2),
        (["--- a/f", "+++ b/f", "@@ -1,2 +1,2 @@", "-a", "+b"], 3),
        (["--- a/f", "+++ b/f", "@@ -1 +1 @@", "-a", "-b", "+b"], 3),
        (["--- a/f", "+++ b/f", "nonsense"], 3),
        (["@@ -1 +1 @@", "-a", "+b"], 1),
    ],
)
def test_a_broken_diff_is_refused(diff, line):
    with pytest.raises(PatchError, match=rf"t\.patch:{line}: "):
        patches.apply({"f": "a\n"}, patches.Patch(Path("p/x/ablations/t.patch"), {}, tuple(diff), 1))


HEAD = {"what": "w", "paper": "2× (x)", "direction": "added", "against": "opt1"}


def small_root(root: Path, **heads: dict[str, str | None]) -> Path:
    """A tree with opt1 and ablations of it that change ambient light; None removes a line of the head."""
    shutil.copytree(ROOT / "phases/opt1", root / "phases/opt1", ignore=shutil.ignore_patterns("ablations"))
    (root / "phases/opt1/ablations").mkdir()
    old = (root / "phases/opt1/shade.c").read_text().splitlines()
    new = [line.replace("0.01, color", "0.02, color") for line in old]
    diff = text(list(difflib.unified_diff(old, new, "a/shade.c", "b/shade.c", lineterm="")))
    for title, changes in heads.items():
        head = {k: v for k, v in (HEAD | changes).items() if v is not None}
        body = text([f"{key}: {value}" for key, value in head.items()]) + "\n" + diff
        (root / f"phases/opt1/ablations/{title}.patch").write_text(body)
    return root


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"what": None}, "'what"),
        ({"direction": "up"}, "direction .*'up'"),
        ({"colour": "red"}, r"t\.patch:5: 'colour: red'"),
        ({"after": "gone"}, r"'opt1\+gone', .*t\.patch"),
        ({"after": "t"}, r"t\.patch: .*after"),
    ],
)
def test_a_bad_head_is_refused(tmp_path, changes, words):
    small_root(tmp_path, t=changes)
    with pytest.raises(PatchError, match=words):
        patches.described("opt1+t", tmp_path)
    with pytest.raises(StudyError, match=words):
        registry.find_phase("opt1+t", tmp_path)


def test_a_head_line_may_go_on_and_may_not_come_twice(tmp_path):
    path = small_root(tmp_path, t={"what": "one\n  two"}) / "phases/opt1/ablations/t.patch"
    assert patches.read(path).head["what"] == "one two"
    path.write_text("what: again\n" + path.read_text())
    with pytest.raises(PatchError, match=r"t\.patch:2: .*'what:'"):
        patches.read(path)
    path.write_text("what: only a head\n")
    with pytest.raises(PatchError, match="no diff"):
        patches.read(path)


def test_a_tree_is_written_once_and_without_leftovers(tmp_path):
    small_root(tmp_path, t={"flags": "opt1"})
    made = tmp_path / "out"
    patches.write("opt1+t", made, tmp_path)
    assert "0.02, color" in (made / "shade.c").read_text()
    assert json.loads((made / "phase.json").read_text())["name"] == "opt1+t"
    before = {path.name: path.stat().st_mtime_ns for path in made.iterdir()}
    (made / "old.c").write_text("")
    patches.write("opt1+t", made, tmp_path)
    assert {path.name: path.stat().st_mtime_ns for path in made.iterdir()} == before


def test_a_build_takes_over_what_the_patch_leaves_alone(tmp_path):
    """The patch norm_bounds changes march.c of opt2's sources."""
    sources = sorted(path.stem for path in (ROOT / "phases" / "opt2").glob("*.c"))
    name = "opt2+norm_bounds"
    words = ["make", f"BUILD={tmp_path}", f"{tmp_path}/{name}/phase.o"]

    def compiled() -> list[tuple[str, str]]:
        done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=True)
        return re.findall(rf"/(\w+)\.c -o {tmp_path}/([^/]+)/assembly/", done.stdout)

    whole = [(source, "opt2") for source in sources]
    assert compiled() == [*whole, ("march", name)]
    assert compiled() == []
    parts = {
        part: [(tmp_path / of / f"objects/{part}.o").read_bytes() for of in ("opt2", name)]
        for part in sources
    }
    assert {part for part, (a, b) in parts.items() if a == b} == {*sources} - {"march"}


def test_an_ablation_is_a_phase_by_name():
    phase = registry.find_phase("opt2+horizontal")
    assert (phase.isa, phase.cflags) == (registry.find_phase("opt3").isa, registry.find_phase("opt3").cflags)
    assert phase.tolerance == registry.find_phase("opt2").tolerance
    assert "opt2+horizontal" not in registry.phases()
    assert str(Spec.parse("opt2+norm_bounds@opt3")) == "opt2+norm_bounds@opt3"


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("opt1+arays", r"'arays'.* arrays\?"),
        ("opt1+", "opt1 ''"),
        ("opt1+../../x", "opt1"),
        ("op1+arrays", "'op1'.* opt1"),
    ],
)
def test_an_unknown_ablation_is_refused_with_what_is_near(name, words):
    with pytest.raises(StudyError, match=words):
        Spec.parse(name)
