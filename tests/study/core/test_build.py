"""Builds: what is built, and what is said when it cannot be."""

import json
import os
import re
import shutil
import subprocess
import sys

import copied
import pytest

from study.core import build as module
from study.core.cli import CANNOT_RUN, StudyError
from study.core.registry import ROOT, Spec

TOOLS = ["make", "head", "sh", "python3", "sed", "mkdir", "rm", "basename", "ld", "pkg-config"]
TOOLS += ["dirname", "mv", "cmp", "grep", "objcopy", "nm"]


@pytest.fixture
def root(tmp_path, monkeypatch):
    """A small tree of its own, and no binary remembered."""
    copied.folders(tmp_path, "common", "scripts/study", "phases/baseline")
    shutil.copy(ROOT / "Makefile", tmp_path)
    monkeypatch.setattr(module, "ROOT", tmp_path)
    module._build.cache_clear()
    yield tmp_path
    module._build.cache_clear()


def test_render_and_probe_are_built():
    for target in ("render", "probe"):
        path = module.build(Spec("baseline", "baseline"), target)
        assert path == ROOT / "build" / "baseline" / target
        assert os.access(path, os.X_OK)


def test_a_phase_that_does_not_compile_shows_the_compilers_lines(root):
    with open(root / "phases/baseline/march.c", "a") as source:
        source.write("int broken(void) { return undeclared_thing; }\n")
    with pytest.raises(StudyError, match="baseline") as error:
        module.build("baseline")
    assert "undeclared_thing" in str(error.value)
    assert error.value.exit_status == 2


def test_what_is_not_linked_shows_the_linker_s_first_line(monkeypatch):
    said = ["note"] * 30 + ["x.c:7: undefined reference to `f'", "collect2: error: ld returned 1 exit status"]
    failed = subprocess.CompletedProcess([], 2, "", "\n".join(said))
    monkeypatch.setattr(module.child, "run", lambda *_, **__: failed)
    with pytest.raises(StudyError) as error:
        module.build("opt2+linked_to_nothing")
    assert str(error.value).splitlines()[1].strip() == said[30]


@pytest.mark.parametrize(("tools", "missing"), [(TOOLS, "gcc"), ([], "make")])
def test_a_missing_tool_is_named(root, monkeypatch, tools, missing):
    (root / "tools").mkdir()
    for name in tools:
        if found := os.path.realpath(sys.executable) if name == "python3" else shutil.which(name):
            (root / "tools" / name).symlink_to(found)
    monkeypatch.setenv("PATH", str(root / "tools"))
    with pytest.raises(StudyError, match=missing) as error:
        module.build("baseline")
    assert error.value.exit_status == CANNOT_RUN


def test_what_the_run_of_the_tests_has_built_is_not_asked_of_make(root, monkeypatch):
    """That program alone, by its whole path."""
    built = root / "build" / "baseline" / "render"
    monkeypatch.setenv(module.BUILT, os.pathsep.join(["/elsewhere/build/baseline/probe", str(built)]))
    monkeypatch.setenv("PATH", str(root))  # where there is no make
    assert module.build("baseline") == built
    with pytest.raises(StudyError, match="make"):
        module.build("baseline", "probe")


def test_presenting_leaves_no_upper_half_in_use():
    """As the renderers' own objects do it: sanitizers clear what an optimised build may leave."""
    done = subprocess.run([module.build("tests", "test_upper_halves")], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    if skipped := re.search("^skipped: (.*)", done.stdout, re.MULTILINE):
        pytest.skip(skipped[1])


@pytest.mark.slow
def test_only_what_changed_is_compiled_again(root):
    """An object is kept while its command and all that it includes are as they were."""

    def compiled(changed: str) -> list[str]:
        with open(root / "phases/baseline" / changed, "a") as source:
            source.write("// another line\n")
        command = ["make", "-C", str(root), "build/baseline/render"]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        return [line for line in done.stdout.splitlines() if " -S " in line]

    files = len([*(root / "phases/baseline").glob("*.c")])
    assert len(compiled("shade.c")) == files  # for the first time
    (again,) = compiled("shade.c")
    assert "shade.c" in again
    assert len(compiled("sdf.h")) == files  # each includes trace.h, which includes sdf.h


@pytest.mark.parametrize(
    ("goals", "compiled"),
    [
        (["opt8_streams/render"], ["opt8_streams"]),
        (["opt8_streams/render", "opt7_tiles/syntax/read"], ["opt8_streams"]),
        (["opt8_streams/render", "opt7_tiles/probe"], ["opt7_tiles", "opt8_streams"]),
    ],
)
def test_a_parent_is_built_first_and_only_where_it_is_asked_for(goals, compiled, tmp_path):
    words = ["make", "-n", f"BUILD={tmp_path}", *(f"{tmp_path}/{goal}" for goal in goals)]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=True)
    assert re.findall(r"compile\.py assembly \S+/(\w+)/phase\.o", done.stdout) == compiled


def derive(root, name, **keys):
    """A phase derived from baseline, without files of its own."""
    about = {"name": name, "title": "t", "family": "ladder", "order": 9, "parent": "baseline"}
    about |= {"idea": "i", "paper": None, "derives": "baseline"} | keys
    (root / "phases" / name).mkdir()
    (root / "phases" / name / "phase.json").write_text(json.dumps(about))
    return root / "phases" / name


@pytest.mark.slow
def test_a_derived_phase_is_its_folder_laid_over_its_parents(root):
    """A mend in the parent reaches it, and the compiler names the file that a person edits."""
    derive(root, "child")
    grandchild = derive(root, "grandchild", derives="child")
    text = (root / "phases/baseline/shade.c").read_text()
    (grandchild / "shade.c").write_text(text + "int grandchild_only;\n")
    assert module.build("grandchild").exists()
    laid = root / "build/grandchild/source"
    assert "grandchild_only" in (laid / "shade.c").read_text()
    assert (laid / "march.c").read_text().startswith('#line 1 "phases/baseline/march.c"\n')
    march = root / "phases/baseline/march.c"
    whole = march.read_text()
    march.write_text(whole + "int broken(void) { return undeclared_thing; }\n")
    module._build.cache_clear()
    with pytest.raises(StudyError, match=r"phases/baseline/march\.c:\d+:\d+: error: .undeclared_thing"):
        module.build("child")
    march.write_text(whole)
    (grandchild / "march.c").write_text("#error this one\n")
    with pytest.raises(StudyError, match=r"phases/grandchild/march\.c:1:2: error"):
        module.build("grandchild")


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"derives": "nobody"}, "'nobody'"),
        ({"derives": "child"}, "child .* child"),
        ({"without": ["nothing.c"]}, "'nothing.c'"),
    ],
)
def test_a_lineage_that_is_none_is_said_in_a_line(root, keys, said):
    derive(root, "child", **keys)
    with pytest.raises(StudyError, match=said):
        module.build("child")
