"""scripts/stepwise breakeven: frames to break even by arithmetic, its table, its budget, a run end to end."""

from __future__ import annotations

import math
import shutil
from pathlib import Path

import pytest

from study.core import cli, commands, registry, run, show, store
from study.core.cli import Outcome, StudyError
from study.core.registry import Spec
from study.experiments.breakeven import command, experiment, tables
from study.experiments.breakeven import measure as breakeven
from study.experiments.breakeven.measure import Settings
from study.experiments.breakeven.schema import Breakeven, Row
from study.numbers import stats
from study.numbers.schema import Interval, PictureErrors, Range

SPECS = Spec.parse("opt9_convex"), Spec.parse("opt10_scene")


def test_break_even_by_arithmetic() -> None:
    """2 s of set-up at a gain of 2.5 ms a frame are 800 frames; the ends of both intervals 2.8 and 2.2 ms."""
    assert breakeven.break_even(2, 12.5, 10) == 800
    assert breakeven.break_even(2, 10, 10) is None is breakeven.break_even(2, 10, 12)
    assert breakeven.break_even(1, 10, 9.997) == 333334  # the first frame at which it has paid
    general, generated = stats.Interval(12.5, 12.4, 12.6, 6, True), stats.Interval(10, 9.8, 10.2, 6, True)
    found = breakeven.break_even_range(2, general, generated)
    assert (found.value, found.low, found.high) == (800, 715, 910)  # 2000/2.8 = 714.3, 2000/2.2 = 909.1
    apart = breakeven.break_even_range(2, stats.Interval(10.3, 9.9, 12, 6, True), generated)
    assert (apart.value, apart.low, apart.high) == (6667, 910, None)
    few = breakeven.break_even_range(2, stats.Interval(12.5, math.nan, math.nan, 3, False), generated)
    assert (few.value, few.low, few.high) == (800, None, None)
    assert [breakeven.reps_of(seconds) for seconds in (1e-3, 0.1, 9)] == [10, 5, 2]


def of(value: float, low: float, high: float) -> Interval:
    return Interval(value=value, low=low, high=high, launches=6, sufficient=True)


def row() -> Row:
    return Row(
        **{"scene": "scene0", "n": 720, "width": 1280, "generated": True, "compiler": "gcc 12"},
        **{"compile_s": 1.75, "setup_s": 1.76, "setup_found_ms": 1.25},
        **{"general_ms": of(12.5, 12.4, 12.6), "generated_ms": of(10, 9.8, 10.2), "gain": of(1.25, 1.2, 1.3)},
        break_even_frames=Range(value=1800, low=715, high=None),
        error=PictureErrors(psnr_db=140.0, rmse=1e-7, averaged=False),
    )


def test_the_chapter_is_made_from_the_file_alone(tmp_path: Path) -> None:
    data = type("Data", (), {"path": tmp_path})()
    assert experiment.section(data).parts == []
    none = Row(scene="cubes", n=720, width=1280, generated=False, reason="it is marched")
    about = {"schema": 1, "phase": "opt10_scene", "against": "opt9_convex", "launches": 6, "left_out": []}
    store.write_json(tmp_path / command.FILE, Breakeven(**about, rows=[row(), none]))
    chapter = experiment.section(data)
    text = chapter.parts[0].markdown.replace("\u00a0", " ")
    assert "12.50 [12.40, 12.60]" in text and "10.00 [9.80, 10.20]" in text and "| 140 |" in text
    assert "1.75 |" in text and "1,800 [715, never]" in text and "1,800 [715, never]" in chapter.answer
    assert "it is marched" in chapter.parts[1].markdown
    (drawing,) = chapter.drawn.values()
    assert "gcc 12" in drawing.note and drawing.make().axes


def test_frames_needed_are_said() -> None:
    made = row()
    told = [Range(value=None, low=900, high=None), Range(value=5, low=None, high=None), None]
    texts = []
    for made.break_even_frames in told:
        texts.append(tables.frames_needed(made))
    assert texts == ["never", "5 (insufficient)", show.NOTHING]


def test_every_shipped_scene_with_a_closed_form_is_asked_and_the_tuned_first() -> None:
    assert set(breakeven.scenes()) == set(registry.scenes()) - {"mandelbulb_closeup"}
    assert breakeven.scenes()[:2] == ["scene0", "mandelbulb"]


def test_the_seconds_are_kept_to(monkeypatch) -> None:
    """A scene takes 15 s: after two there is no room for a third in 40."""
    now = [0.0]

    def measured(specs, scene, settings, folder) -> Row:
        now[0] += 15
        return Row(scene=scene.name, n=9, width=16, generated=False)

    monkeypatch.setattr(breakeven, "measure", measured)
    monkeypatch.setattr(breakeven.time, "monotonic", lambda: now[0])
    scenes = [registry.find_scene(name) for name in ("scene0", "trio", "mandelbulb")]
    rows, left_out = breakeven.study(SPECS, scenes, Settings(90, 6, 40, 1))
    assert [r.scene for r in rows] == ["scene0", "trio"] and [r.scene for r in left_out] == ["mandelbulb"]


def called(*words: object) -> Outcome:
    return commands.called("breakeven", [str(word) for word in words])[0]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--phase", "opt10"], "opt10"),
        (["--phase", "opt4"], "opt4"),
        (["--against", "truth"], "truth"),
        (["--scene", "nowhere"], "nowhere"),
    ],
)
def test_bad_input_is_said(words: list[str], said: str, tmp_path: Path) -> None:
    with pytest.raises(StudyError, match=said):
        called(*words, "--run", tmp_path)


lacking = pytest.mark.skipif(
    any(map(registry.missing_isa, SPECS)) or not shutil.which("gcc"),
    reason="no gcc, or the CPU lacks what the phases need",
)


@pytest.mark.slow
@lacking
def test_from_end_to_end(tmp_path: Path, monkeypatch) -> None:
    """With a compiler two_spheres has a kernel, spheres40, a crowd, none; without it neither."""
    words = ["--scene", "two_spheres", "spheres40", "-n", 16, "--launches", 1, "--run", tmp_path]
    monkeypatch.setenv("STEPWISE_CC", "gcc")
    outcome = called(*words)
    made = Breakeven.load(tmp_path / command.FILE)
    assert outcome.ended == cli.OK and cli.plain(outcome.result) == cli.plain(made)
    spheres, crowd = made.rows
    assert spheres.generated and 0 < spheres.compile_s <= spheres.setup_s
    assert 0 < spheres.setup_found_ms < 1e3 * spheres.compile_s
    assert spheres.error.level > 100
    assert not crowd.generated and "BVH" in crowd.reason
    monkeypatch.setenv("STEPWISE_CC", "none")
    assert called(*words).ended == cli.OK
    rows = Breakeven.load(tmp_path / command.FILE).rows
    assert [r.generated for r in rows] == [False, False] and "STEPWISE_CC" in rows[0].reason


@pytest.mark.slow
@lacking
def test_what_counts_runs_the_general_code(tmp_path: Path, monkeypatch) -> None:
    """No kernel is made for a profile."""
    monkeypatch.setenv("STEPWISE_CC", "gcc")
    monkeypatch.setenv("STEPWISE_CACHE", str(tmp_path / "cache"))
    scene = registry.find_scene("two_spheres")
    made = run.render(SPECS[1], scene.path, 16, target="render-blocks", timed=False)
    assert made["kernel"].startswith("general: ") and not (tmp_path / "cache").exists()
