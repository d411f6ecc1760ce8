"""Labs judged on start and solution alone: bits, counts by Valgrind's model, and the scenes made for them."""

import dataclasses
import functools
import shutil
import subprocess
from collections import Counter

import emitted
import pytest

from study.commands import try_
from study.commands.labs import judge
from study.core import cli, patches, registry
from study.core.registry import ROOT, Spec
from study.counting import cachegrind
from study.labs import crowds

PATCHES = sorted((ROOT / "docs" / "labs").glob("*/*/*.patch"))
SMALL = 1024  # shapes of tests
need_valgrind = pytest.mark.skipif(not shutil.which(cachegrind.TOOL), reason="Valgrind is missing")


real = cachegrind.counted


@functools.cache
def counted(spec, scene, height):
    return real(spec, registry.scene_at(scene), height)


@pytest.fixture
def judged(monkeypatch, capsys):
    """Judges with a smaller scene and made-up times: status and result."""
    plain = {number: lab for number, lab in judge.labs().items() if lab.height}
    small = {
        n: dataclasses.replace(lab, shapes=min(lab.shapes, SMALL), height=lab.height if lab.also else low)
        for n, lab in plain.items()
        for low in [4 if lab.crowd else 45]
    }

    monkeypatch.setattr(judge, "USABLE", [0, 1])

    def times(both, scene, height, launches, seed, threads=1):
        return {both[0]: [2.0] * launches, both[1]: [0.5] * launches}

    def call(*words: object) -> tuple[int, dict]:
        monkeypatch.setattr(judge, "labs", lambda: small)
        monkeypatch.setattr(try_, "times", times)
        monkeypatch.setattr(judge, "of_memory", lambda *_: judge.Check("memory", True, ""))  # test_attacks.py
        status = emitted.told("judge", *words, "--launches", 6, "--seed", 1, "--json")
        return status, emitted.result(capsys.readouterr().out)

    return call


@pytest.mark.slow
@need_valgrind
@pytest.mark.parametrize(
    ("number", "phase", "fails"),
    [
        (7, "opt2+spheres_apart", None),
        (7, "opt2+by_type", "work"),
        (8, "opt2+by_type", None),
        (8, "opt2+spheres_apart", "work"),
        (8, "opt2+fast_root_1", "picture"),
        (9, "opt5_threads", None),
        (9, "opt5_threads+whole_tiles", "picture"),
    ],
)
def test_right_and_wrong_solutions(judged, monkeypatch, number, phase, fails):
    """The layout's solution mispredicts as before, and the branches' fetches as many lines."""
    monkeypatch.setattr(judge.cachegrind, "counted", lambda spec, scene, n: counted(spec, scene.path, n))
    status, told = judged(number, "--phase", phase)
    failing = [one["name"] for one in told["checks"] if not one["passed"]]
    assert failing[:1] == ([fails] if fails else []) and status == (1 if fails else 0)
    assert told["hint"] == (judge.labs()[number].hints[fails] if fails else None)


PRUNING = {"no_blend": "picture", "centres_alone": "picture", "unions_alone": "csg", "sharp_alone": "work"}
PRUNING |= {"slope_one": "twisted", "twists_too": "twisted"}


@pytest.mark.slow
@pytest.mark.parametrize("mistake", ["", *PRUNING])
def test_pruning_is_judged_on_three_scenes(judged, monkeypatch, mistake):
    """One mistake has every bit and evaluates as many shapes as the start; the others lose a child that
    matters. The right one needs 37 % of the start's evaluations."""
    fails = PRUNING.get(mistake)
    if fails not in (None, "work"):
        monkeypatch.setattr(try_, "counted", lambda *_: None)
    status, told = judged(15, "--phase", f"opt7_tiles+{mistake}".rstrip("+"))
    failing = [one["name"] for one in told["checks"] if not one["passed"]]
    assert failing[:1] == ([fails] if fails else []) and status == (1 if fails else 0)
    assert told["hint"] == (judge.labs()[15].hints[fails] if fails else None)


def test_every_mistake_is_judged():
    """That of the lists for bundles by test_judge.py."""
    found = {path.stem for path in (ROOT / "docs" / "labs" / "mistakes" / "opt7_tiles").iterdir()}
    assert found == PRUNING.keys() | {"axis_alone"}


@pytest.mark.parametrize(("now", "passed"), [(599, True), (601, False), (None, True)])
def test_events_are_judged_where_they_are_counted(monkeypatch, now, passed):
    lab = dataclasses.replace(judge.labs()[7], same_bits=False)
    counts = iter([{"lines": 1000} if now else None, {"lines": now} if now else None])
    monkeypatch.setattr(judge.cachegrind, "counted", lambda *_: next(counts))
    monkeypatch.setattr(judge, "build_together", lambda *_: None)
    monkeypatch.setattr(judge, "render", lambda *_, **__: None)
    monkeypatch.setattr(judge.images, "read", lambda _: None)
    monkeypatch.setattr(judge.images, "rgb", lambda _: SimplePicture())
    args = judge.argparse.Namespace(phase="opt2+by_type", untimed=True)
    checks = judge.of_pair(lab, registry.find_scene("scene0"), args)
    assert [(one.name, one.passed) for one in checks] == [("picture", True), ("work", passed)]
    assert now is not None or cachegrind.TOOL in checks[1].said


class SimplePicture:
    def tobytes(self) -> bytes:
        return b""


@need_valgrind
def test_lines_and_mispredictions_of_a_known_program(tmp_path, monkeypatch):
    """64 passes of 1 MiB are 64 · 16,384 lines, read or written by turns; of the highest bit of a random
    number half the guesses are wrong."""
    source = tmp_path / "known.c"
    source.write_text("""
static char data[1 << 20];
int main(void) {
    unsigned state = 1;
    volatile int heads = 0;
    for (int pass = 0; pass < 64; pass++)
        for (int i = 0; i < 1 << 20; i += 64)
            if (i & 64)
                *(volatile char *)&data[i];
            else
                *(volatile char *)&data[i] = 1;
    for (int i = 0; i < 200000; i++) {
        state = state * 1664525 + 1013904223;
        if (state >> 31)
            heads++;
    }
    return 0;
}
""")
    program = tmp_path / "known"
    subprocess.run(["gcc", "-O1", "-fno-if-conversion", "-o", program, source], check=True)
    monkeypatch.setattr(cachegrind, "build", lambda _: program)
    found = cachegrind.counted(Spec("opt2", "opt2"), registry.find_scene("scene0"), 4)
    assert found["lines"] == pytest.approx(64 * 16384, rel=0.02)
    assert found["mispredictions"] == pytest.approx(100_000, rel=0.05)


def test_what_valgrind_cannot_run(monkeypatch):
    monkeypatch.setattr(cachegrind.shutil, "which", lambda _: None)
    assert cachegrind.counted(Spec("opt2", "opt2"), registry.find_scene("scene0"), 4) is None
    monkeypatch.undo()
    if shutil.which(cachegrind.TOOL):
        monkeypatch.setattr(cachegrind, "build", lambda _: "/bin/false")
        with pytest.raises(cli.StudyError, match="opt2"):
            cachegrind.counted(Spec("opt2", "opt2"), registry.find_scene("scene0"), 4)


def test_a_crowd_is_the_student_s_own():
    """Each kind about as often, the same for the same number, and fewer shapes are larger."""
    kinds = ("sphere", "box", "octahedron", "torus")
    made = [crowds.scene(kinds, SMALL, student) for student in (1, 2)]
    assert made[0].data == crowds.scene(kinds, SMALL, 1).data != made[1].data
    counts = Counter(shape["type"] for shape in made[0].data["shapes"])
    assert sum(counts.values()) == SMALL and min(counts.values()) > SMALL / 5
    radii = [
        max(shape["radius"] for shape in crowds.scene(["sphere"], count, 1).data["shapes"])
        for count in (64, SMALL)
    ]
    assert radii[0] > 2 * radii[1]


def test_a_molecule_is_one_group():
    made = [crowds.scene(["molecule"], 50, student) for student in (1, 2)]
    assert made[0].data == crowds.scene(["molecule"], 50, 1).data != made[1].data
    assert [len(shape["shapes"]) for shape in made[0].data["shapes"]] == [50]


def test_where_the_scene_is_is_said(judged):
    status, told = judged(7, "--student", 3)
    assert (status, told["scene"]) == (0, "build/labs/scenes/sphere-1024-3.json")


def test_threads_want_as_many_cpus(monkeypatch):
    monkeypatch.setattr(judge, "USABLE", [0])
    monkeypatch.setattr(judge, "build_together", lambda *_: None)
    monkeypatch.setattr(judge, "render", lambda *_, **__: None)
    monkeypatch.setattr(judge.images, "read", lambda _: None)
    monkeypatch.setattr(judge.images, "rgb", lambda _: SimplePicture())
    args = judge.argparse.Namespace(phase="opt2+by_type", untimed=False)
    lab = dataclasses.replace(judge.labs()[9], start="opt2")
    with pytest.raises(cli.StudyError, match="2 CPUs") as raised:
        judge.of_pair(lab, registry.find_scene("scene0"), args)
    assert raised.value.exit_status == cli.CANNOT_RUN


@pytest.mark.parametrize("path", PATCHES, ids=lambda path: path.stem)
def test_a_patch_of_a_lab_applies_and_is_no_ablation(path):
    name = f"{path.parent.name}+{path.stem}"
    assert patches.read(path).name == name and patches.tree(name)
    assert registry.find_phase(name) and path.stem not in patches.titles(path.parent.name)
