"""The labs: each judged on the ladder's solution and on wrong ones. Times are made up, the rest is real."""

import re
import shlex
import shutil
import subprocess
from pathlib import Path
from types import SimpleNamespace

import emitted
import pytest

from study.commands import new_phase, try_
from study.commands.labs import judge
from study.core import cli, json_files, patches, registry
from study.core.registry import ROOT, Spec
from study.numbers import stats

SOLUTIONS = {1: "baseline+1_precomputed", 2: "opt6_wide", 4: "opt6_wide", 5: "opt8_streams", 6: "opt7_tiles"}
SOLUTIONS |= {11: "opt3"}
SMALL = ("--launches", "6", "--seed", "1")
PAGES = ROOT / "docs" / "labs"


@pytest.fixture
def judged(monkeypatch, capsys):
    """Judges in this process, the solution `gain` times as fast as the start: exit status, what is said."""

    def call(*words: object, gain: float = 3.0, spread: float = 1.01, n: int = 45) -> tuple[int, str]:
        def times(both: try_.Sides, scene, height, launches, seed) -> dict[Spec, list[float]]:
            mine = [1 / gain * (spread if i % 2 else 1 / spread) for i in range(launches)]
            return {both[0]: [1.0] * launches, both[1]: mine}

        monkeypatch.setattr(try_, "times", times)
        monkeypatch.setattr(try_, "timed_height", lambda *_: 45)
        monkeypatch.setattr(judge, "of_memory", lambda *_: judge.Check("memory", True, ""))  # test_memory.py
        return emitted.told("judge", *words, "-n", n, *SMALL), capsys.readouterr().out

    return call


@pytest.mark.slow
@pytest.mark.parametrize("number", SOLUTIONS)
def test_the_ladders_solution_is_accepted(judged, monkeypatch, number):
    """Counting programs are built and run of the lab alone that asks for lanes."""
    if lacking := registry.missing_isa(Spec.parse(SOLUTIONS[number])):
        pytest.skip(f"the CPU lacks {' '.join(lacking)}")
    if number not in (1, 5):
        monkeypatch.setattr(judge, "_calls", lambda side, _: 50 if side.name == SOLUTIONS[number] else 100)
        monkeypatch.setattr(try_, "build_together", lambda *_: None)
        monkeypatch.setattr(try_, "counted", lambda *_: None)
    status, said = judged(number, "--phase", SOLUTIONS[number], *["--untimed"] * (number == 1))
    assert status == 0 and "MISSED" not in said, said
    assert said.endswith("reached; speed was not judged.\n" if number == 1 else "reached.\n")


WRONG = {
    (2, "opt6_wide+rsqrt"): "picture",
    (4, "opt6_wide+first_packet"): "picture",
    (4, "opt6_wide"): "work",
    (6, "opt7_tiles+axis_alone"): "picture",
    (6, "opt7_tiles"): "work",
    (11, "opt3+one_for_all"): "picture",
    (14, "opt4+rsqrt"): "picture",
    (14, "opt2+norm_bounds"): None,
}


@pytest.mark.slow
@pytest.mark.parametrize("number, phase", WRONG)
def test_a_wrong_solution_is_refused(judged, monkeypatch, number, phase):
    """As many calls are counted as of the start. The project has no start; there one is right."""
    if lacking := registry.missing_isa(Spec.parse(phase)):
        pytest.skip(f"the CPU lacks {' '.join(lacking)}")
    monkeypatch.setattr(judge, "_calls", lambda *_: 100)
    monkeypatch.setattr(try_, "build_together", lambda *_: None)
    monkeypatch.setattr(try_, "counted", lambda *_: None)
    status, said = judged(number, "--phase", phase)
    fails = WRONG[number, phase]
    hint = f"Hint: {judge.labs()[number].hints[fails]}" if fails else "All of it reached."
    assert status == (1 if fails else 0) and said.splitlines()[-1] == hint, said


@pytest.mark.slow
def test_other_bits_are_refused(judged, monkeypatch):
    """opt2 is fast, and its picture is another; who made it is not looked at here."""
    monkeypatch.setattr(judge, "of_source", lambda *_: judge.Check("start", True, ""))
    status, said = judged(1, "--phase", "opt2")
    assert status == 1
    assert said.splitlines()[-1] == f"Hint: {judge.labs()[1].hints['picture']}"


@pytest.mark.parametrize(
    ("lab", "phase", "fails"),
    [
        (1, "opt1", "start"),  # the ladder's, whatever its parent
        (4, "opt2", "start"),
        (1, "baseline", "unchanged"),
        (4, "opt6_wide+awake", "unchanged"),
        (1, "baseline+1_precomputed", None),
        (5, "opt8_streams", None),
    ],
)
def test_what_is_handed_in_is_made_from_the_start(lab, phase, fails):
    check = judge.of_source(judge.labs()[lab], phase)
    assert check.passed == (fails is None) and (fails is None or check.name == fails)


@pytest.mark.parametrize(
    ("name", "start", "fails"),
    [
        ("mine", "opt6_wide+awake", "unchanged"),
        ("mine", "opt6_wide", None),
        ("mine", "opt2", "start"),
        ("opt6_mine", "opt6_wide", "start"),
    ],
)
def test_a_student_s_own_phase_is_judged(name, start, fails, tmp_path):
    """As new-phase makes it, from the start of lab 4 (without an edit), from its solution, or from others."""
    (tmp_path / "phases").mkdir()
    for one in {"opt6_wide", *patches.lineage("opt2"), *patches.lineage("opt5_threads")}:
        (tmp_path / "phases" / one).symlink_to(ROOT / "phases" / one)
    (tmp_path / "docs").symlink_to(ROOT / "docs")
    new_phase.create(name, start, tmp_path)
    registry.phases.cache_clear()
    check = judge.of_source(judge.labs()[4], name, tmp_path)
    assert check.passed == (fails is None) and (fails is None or check.name == fails)


def test_baseline_compiles_where_its_calls_are_inlined(tmp_path):
    """As a student of lab 1 tries: a warning in a file that is not theirs would stop them."""
    shutil.copytree(ROOT / "phases" / "baseline", tmp_path, dirs_exist_ok=True)
    header = (tmp_path / "vec.h").read_text()
    call = "__attribute__((noipa, unused)) static"
    assert call in header
    (tmp_path / "vec.h").write_text(header.replace(call, "__attribute__((unused)) static inline"))
    words = shlex.split("gcc -std=c11 -D_GNU_SOURCE -O3 -Wall -Wextra -Werror -Icommon -c -o /dev/null")
    for source in tmp_path.glob("*.c"):
        done = subprocess.run([*words, source], cwd=ROOT, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("kept", [None, ("near", 3), ("far", 3), ("near", 1), ("near", 2)])
def test_a_frame_that_is_kept_is_seen(monkeypatch, kept):
    """Made up: after so many frames the driver shows another picture. The real one does not. A phase that
    draws its first and fourth frame alone is timed by its second to fourth."""
    render = judge.render

    def stale(spec, path, height, width, *, warmup, **words):
        if kept == ("far" if "animation" in words else "near", warmup):
            shown = registry.find_scene("trio").path
            return render(spec, shown, height, width, out=words["out"], timed=False)
        return render(spec, path, height, width, warmup=warmup, **words)

    monkeypatch.setattr(judge, "render", stale)
    check = judge.of_views(Spec("opt2", "opt2"), registry.find_scene("scene0"), 36)
    assert check.passed == (kept is None)


def test_what_does_not_compile_has_a_status_and_the_compiler_s_text(judged, monkeypatch):
    def fails(spec):
        raise cli.StudyError("cannot build:\n  a.c:1:2: error")

    monkeypatch.setattr(judge, "build", fails)
    status, said = judged(1, "--phase", "baseline+1_precomputed", "--json")
    assert status == judge.DOES_NOT_COMPILE
    assert "a.c:1:2: error" in emitted.result(said)["compiler"]


@pytest.mark.slow
def test_untimed_in_gradescope_s_form(judged, tmp_path, monkeypatch):
    """No time is measured, and each check is a point."""
    monkeypatch.setattr(try_, "timed_height", None)
    out = tmp_path / "results.json"
    words = ("--phase", "baseline+1_precomputed", "--untimed", "--gradescope", out)
    status, said = judged(1, *words)
    assert status == 0 and "MISSED" not in said
    tests = json_files.read_json(out)["tests"]
    assert [one["name"] for one in tests] == ["unchanged", "memory", "views", "picture", "work"]
    assert all(one["score"] == one["max_score"] == 1 for one in tests)


@pytest.mark.parametrize(("calls", "passed"), [(100, True), (101, False)])
def test_work_is_judged_beside_time(monkeypatch, calls, passed):
    """A phase that is faster and does the same work has not had the lab's idea."""
    counts = {"baseline": {"rotate": {"sin": 400, "cos": 600, "pow": 900}}, "opt1": {"shade": {"cos": calls}}}
    monkeypatch.setattr(judge.flops, "missing", lambda _: None)
    monkeypatch.setattr(
        judge.flops, "measure", lambda _, spec, *__: SimpleNamespace(edges=counts[spec.phase])
    )
    sides = [SimpleNamespace(name=name, calls=None, lanes_at_work=None, fails=[]) for name in counts]
    ratio = stats.Interval(2, 1.9, 2.1, 12, True)
    told = SimpleNamespace(sides=sides, same_bits=True, ratio=ratio)
    checks = {one.name: one.passed for one in judge.of_phase(judge.labs()[1], told)}
    assert checks == {"picture": True, "work": passed, "speed": True}


@pytest.mark.slow
def test_idle_lanes_are_refused(judged, monkeypatch):
    """As many lanes at work as before, however fast it is."""
    monkeypatch.setattr(try_.work, "efficiency", lambda counts: 0.3)
    status, said = judged(5, "--phase", "opt8_streams", "--json")
    result = emitted.result(said)
    passed = [one["passed"] for one in result["checks"]]
    assert (status, passed) == (1, [True, True, True, True, False, True])
    assert result["hint"] == judge.labs()[5].hints["lanes"]


def test_the_start_is_no_solution(judged, monkeypatch):
    monkeypatch.setattr(judge, "build", lambda spec: None)
    status, said = judged(5, "--phase", "opt8_streams+whole_packets")
    line = 'make try NAME={0} SCENE=mandelbulb ARGS="--against {0}"'.format("opt8_streams+whole_packets")
    assert status == 1 and said.splitlines()[-1] == f"Hint: {judge.HINTS['unchanged'].format(line)}"


@pytest.mark.parametrize("lab", [one for one in judge.labs().values() if not (one.answers or one.breaks)])
def test_the_line_that_measures_is_the_page_s(lab):
    """It names the start, where that is not the parent, and the scene."""
    scene = registry.find_scene("trio") if lab.crowd else None  # in place of one that is made
    line = judge.measuring(lab, "own", scene)
    assert "own" in line and not re.search(r"mine|SCENE |\\n|#", line)
    assert lab.scene in ("scene0", "") or lab.scene in line
    assert not scene or "common/scenes/trio.json" in line
    if line.startswith("make try"):
        assert "+" not in lab.start or f'"--against {lab.start}"' in line
    else:
        assert re.match(r"make .*phase-own && ", line)  # what it times is built
        assert lab.height and re.search(f" -n {lab.height}( |$)", line)


@pytest.mark.slow
@pytest.mark.parametrize(("gain", "spread", "hint"), [(1.1, 1.001, "speed"), (1.2, 1.2, "")])
def test_too_slow_and_not_known(judged, gain, spread, hint):
    """1.2 times is asked: surely less, and an interval that holds it."""
    status, said = judged(1, "--phase", "baseline+1_precomputed", gain=gain, spread=spread)
    assert status == 1
    assert said.splitlines()[-1] == f"Hint: {judge.labs()[1].hints.get(hint, judge.UNSURE)}"


@pytest.mark.parametrize("others", [1.0, 10.0])
def test_a_gain_beyond_belief_is_named(others):
    """Where the whole interval is, not where noise makes it wide."""
    ratio = stats.ratio_interval([18.0] * 6, [1.0] * 4 + [others] * 2)
    (check,) = judge.of_ratio(judge.labs()[4], ratio)
    assert ("no such change" in check.said) == (others == 1.0)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scene", "fails"),
    [
        ("tests/labs/planet.json", None),
        ("common/scenes/scene0.json", "breaks"),
        ("common/scenes/mandelbulb_closeup.json", "shape"),
    ],
)
def test_a_scene_is_judged(judged, scene, fails):
    status, said = judged(3, "--file", ROOT / scene, n=180)
    assert status == (1 if fails else 0), said
    assert fails is None or said.splitlines()[-1] == f"Hint: {judge.labs()[3].hints[fails]}"


@pytest.mark.parametrize(
    "words, asked",
    [((1,), "NAME="), ((3,), "SCENE="), ((3, "--phase", "opt2"), "SCENE="), ((5, "--phase", "opt4"), "45")],
)
def test_what_a_lab_asks_for(judged, words, asked):
    with pytest.raises(cli.StudyError, match=asked):
        judged(*words, n=44)


def test_pages_say_what_the_judge_asks():
    """Start, goal and minutes of the table; each page has its command."""
    table = (PAGES / "README.md").read_text(encoding="utf-8")
    for number, lab in judge.labs().items():
        (row,) = re.findall(rf"^\| \[{number}\]\({lab.page}\).*$", table, re.MULTILINE)
        assert row.endswith(f" {lab.minutes} |")
        page = (PAGES / lab.page).read_text(encoding="utf-8")
        assert f"make judge LAB={number} " in page
        assert re.search(r"^!\[.+\]\(\.\./\.\./[\w./-]+\.(svg|png)\)$", page, re.MULTILINE)
        if lab.answers:
            assert lab.hints and not lab.start
            continue
        if lab.truth_db:
            assert (
                f"{lab.truth_db} dB" in row
                and f"{lab.truth_db} dB" in page
                and registry.find_scene(lab.scene)
            )
            continue
        if lab.breaks:
            assert f"`{lab.breaks}`" in row and f"{lab.below_db} dB" in page
            continue
        Spec.parse(lab.start)
        assert lab.crowd or registry.find_scene(lab.scene)
        assert f"`{lab.start}`" in row and f"{lab.speedup}×" in row and f"{lab.speedup}×" in page
        assert f" FROM={lab.start}\n" in page
        assert lab.hints.keys() >= {"picture", "speed"} | ({"lanes"} if lab.lanes else set())


def test_the_course_has_every_lab_and_a_hundred_points():
    text = (PAGES / "COURSE.md").read_text(encoding="utf-8")
    weeks = [row.split("|")[1:-1] for row in re.findall(r"^\| \d+ \|.*$", text, re.MULTILINE)]
    assert [int(row[0]) for row in weeks] == list(range(1, 14))
    given = {int(number) for row in weeks for number in re.findall(r"\[(\d+)\]", row[3])}
    assert given == judge.labs().keys() - {14}  # the project
    assert sum(int(number) for row in weeks for number in re.findall(r"\d+", row[4])) == 100


@pytest.mark.parametrize("start", [lab.start for lab in judge.labs().values() if "+" in lab.start])
def test_a_start_is_the_ablation_as_a_phase(start, tmp_path):
    """The same tree, and only the patched files in its folder."""
    phase = start.partition("+")[0]
    (tmp_path / "phases").mkdir()
    for name in {*patches.lineage(phase), *patches.lineage("opt5_threads")}:  # whose tolerance it gets
        (tmp_path / "phases" / name).symlink_to(ROOT / "phases" / name)
    (tmp_path / "docs").symlink_to(ROOT / "docs")
    folder = new_phase.create("mine", start, tmp_path)
    registry.phases.cache_clear()

    def texts(name: str, root: Path) -> dict[str, str]:
        tree = {file: re.sub(r"\A#line .*\n", "", text) for file, text in patches.tree(name, root).items()}
        return {file: text for file, text in tree.items() if file not in ("phase.json", "residues.def")}

    wanted, made = texts(start, ROOT), texts("mine", tmp_path)
    assert made == wanted
    own = {str(path.relative_to(folder)) for path in folder.rglob("*.[chd]*")} - {"phase.json"}
    plain = texts(phase, ROOT)
    assert own == {file for file in wanted if wanted[file] != plain[file]} and own
