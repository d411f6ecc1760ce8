"""scripts/stepwise breakeven: frames to break even by arithmetic, its table, its budget, a run end to end."""

from __future__ import annotations

import json
import math
import shutil
import sys
from pathlib import Path

import complete
import emitted
import pytest

from study.core import cli, registry, run, show
from study.core.cli import StudyError
from study.core.registry import Spec
from study.experiments.breakeven import command
from study.experiments.breakeven import measure as breakeven
from study.experiments.breakeven import tables as breakeven_page
from study.experiments.breakeven.measure import Settings
from study.numbers.stats import Interval

SPECS = Spec.parse("opt9_convex"), Spec.parse("opt10_scene")


def test_break_even_by_arithmetic() -> None:
    """2 s of set-up at a gain of 2.5 ms a frame are 800 frames; the ends of both intervals 2.8 and 2.2 ms."""
    assert breakeven.break_even(2, 12.5, 10) == 800
    assert breakeven.break_even(2, 10, 10) == math.inf == breakeven.break_even(2, 10, 12)
    assert breakeven.break_even(1, 10, 9.997) == 333334  # the first frame at which it has paid
    general, generated = Interval(12.5, 12.4, 12.6, 6, True), Interval(10, 9.8, 10.2, 6, True)
    found = breakeven.break_even_interval(2, general, generated)
    assert found == {"value": 800, "low": 715, "high": 910}  # 2000/2.8 = 714.3, 2000/2.2 = 909.1
    apart = breakeven.break_even_interval(2, Interval(10.3, 9.9, 12, 6, True), generated)
    assert apart == {"value": 6667, "low": 910, "high": None}
    few = Interval(12.5, math.nan, math.nan, 3, False)
    assert breakeven.break_even_interval(2, few, generated) == {"value": 800, "low": None, "high": None}
    assert breakeven.reps_of(1e-3) == 10 and breakeven.reps_of(0.1) == 5 and breakeven.reps_of(9) == 2


def row(scene: str = "scene0") -> dict:
    ends = {"value": 12.5, "low": 12.4, "high": 12.6, "launches": 6, "sufficient": True}
    return {
        **{
            "scene": scene,
            "n": 720,
            "width": 1280,
            "generated": True,
            "compiler": "gcc 12",
            "hash": "0" * 16,
        },
        **{"compile_s": 1.75, "generate_ms": 0.3, "load_ms": 0.2, "setup_s": 1.76, "setup_found_ms": 1.25},
        **{"general_ms": ends, "generated_ms": {**ends, "value": 10, "low": 9.8, "high": 10.2}},
        "gain": {"value": 1.25, "low": 1.2, "high": 1.3, "launches": 6, "sufficient": True},
        "break_even_frames": {"value": 1800, "low": 715, "high": None},
        "error": {"psnr_db": 140.0, "rmse": 1e-7, "averaged": False, "non_finite": 0},
    }


def test_the_page(tmp_path: Path) -> None:
    assert breakeven_page.section(tmp_path).parts == []
    none = {"scene": "cubes", "n": 720, "width": 1280, "generated": False, "reason": "it is marched"}
    result = {"phase": "opt10_scene", "against": "opt9_convex", "launches": 6, "rows": [row(), none]}
    complete.write(tmp_path / breakeven.FILE, result | {"left_out": []})
    chapter = breakeven_page.section(tmp_path)
    text = chapter.parts[0].markdown.replace("\u00a0", " ")
    assert "opt9_convex" in text and "12.50 [12.40, 12.60]" in text and "10.00 [9.80, 10.20]" in text
    assert "1.75 |" in text and "1,800 [715, never]" in text and "| 140 |" in text
    assert "it is marched | never: no kernel |" in chapter.parts[1].markdown
    (drawing,) = chapter.drawn.values()
    assert "gcc 12" in drawing.note
    assert (
        chapter.answer.startswith("On scene0 at n = ") and "after 1,800 [715, never] frames" in chapter.answer
    )
    assert "breaks even after 1,800" in breakeven_page.sentence(row(), "opt9_convex")
    said = [{"value": None, "low": 900, "high": None}, {"value": 5, "low": None, "high": None}, None]
    texts = [breakeven_page.frames_needed({"break_even_frames": one}) for one in said]
    assert texts == ["never", "5 (insufficient)", show.NOTHING]
    for broken in ('{"rows": [1]}', json.dumps({"rows": [{"scene": "x", "n": 1, "generated": True}]})):
        (tmp_path / breakeven.FILE).write_text(broken)
        with pytest.raises(StudyError, match=r"breakeven\.json.*scripts/stepwise breakeven"):
            breakeven_page.section(tmp_path)


def test_every_shipped_scene_with_a_closed_form_is_asked_and_the_tuned_first() -> None:
    assert set(breakeven.scenes()) == set(registry.scenes()) - {"mandelbulb_closeup"}
    assert breakeven.scenes()[:2] == ["scene0", "mandelbulb"]


def test_the_seconds_are_kept_to(monkeypatch) -> None:
    """A scene takes 15 s: after two there is no room for a third in 40."""
    now = [0.0]

    def measured(specs, scene, settings):
        now[0] += 15
        return {"scene": scene.name, "generated": False, "reason": ""}

    monkeypatch.setattr(breakeven, "measure", measured)
    scenes = [registry.find_scene(name) for name in ("scene0", "trio", "mandelbulb")]
    found = breakeven.study(SPECS, scenes, Settings(90, 6, 40, 1), clock=lambda: now[0])
    assert [r["scene"] for r in found["rows"]] == ["scene0", "trio"]
    assert found["left_out"] == [{"scene": "mandelbulb", "reason": breakeven.NO_TIME}]


def run_command(monkeypatch, *arguments: str) -> int:
    monkeypatch.setattr(sys, "argv", ["stepwise breakeven", *arguments])
    with pytest.raises(SystemExit) as ended:
        cli.main(command.main)
    return ended.value.code


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--phase", "opt10"], "no phase 'opt10'"),
        (["--phase", "opt4"], "opt4 generates no kernels; opt10_scene does"),
        (["--phase", "truth"], "truth: is truth itself"),
        (["--against", "truth"], "truth: is truth itself"),
        (["--scene", "nowhere"], "no scene 'nowhere'"),
        (["--run", "{tmp}/file/run"], "cannot be written to"),
        (["-n", "0"], "'0': must be"),
    ],
)
def test_bad_input_is_one_line(words: list[str], said: str, refused) -> None:
    refused(command.main, "stepwise breakeven", ["--run", "{tmp}/out", *words], said)


lacking = pytest.mark.skipif(
    any(map(registry.missing_isa, SPECS)) or not shutil.which("gcc"),
    reason="no gcc, or the CPU lacks what the phases need",
)


@pytest.mark.slow
@lacking
def test_from_end_to_end(tmp_path: Path, monkeypatch, capsys) -> None:
    """With a compiler two_spheres has a kernel, spheres40, a crowd, none; without it neither."""
    words = [
        "--scene",
        "two_spheres",
        "spheres40",
        "-n",
        "16",
        "--launches",
        "1",
        "--run",
        str(tmp_path),
        "--json",
    ]
    monkeypatch.setenv("STEPWISE_CC", "gcc")
    assert run_command(monkeypatch, *words) == cli.OK
    made = emitted.result(capsys.readouterr().out)
    assert made == json.loads((tmp_path / breakeven.FILE).read_text())
    spheres, crowd = made["rows"]
    assert spheres["generated"] and 0 < spheres["compile_s"] <= spheres["setup_s"]
    assert 0 < spheres["setup_found_ms"] < 1e3 * spheres["compile_s"]
    assert spheres["error"]["psnr_db"] is None or spheres["error"]["psnr_db"] > 100
    assert not crowd["generated"] and "BVH" in crowd["reason"]
    monkeypatch.setenv("STEPWISE_CC", "none")
    assert run_command(monkeypatch, *words) == cli.OK
    capsys.readouterr()
    rows = json.loads((tmp_path / breakeven.FILE).read_text())["rows"]
    assert [r["generated"] for r in rows] == [False, False] and "STEPWISE_CC" in rows[0]["reason"]


@pytest.mark.slow
@lacking
@pytest.mark.parametrize("target", ["render-count", "render-blocks"])
def test_what_counts_runs_the_general_code(target: str, tmp_path: Path, monkeypatch) -> None:
    """Declared costs are those of the general code: no kernel is made for a count or a profile."""
    monkeypatch.setenv("STEPWISE_CC", "gcc")
    monkeypatch.setenv("STEPWISE_CACHE", str(tmp_path / "cache"))
    scene = registry.find_scene("two_spheres")
    made = run.render(SPECS[1], scene.path, 16, target=target, timed=False)
    assert made["kernel"].startswith("general: ") and not (tmp_path / "cache").exists()
