"""Beside Dr.Jit: what is missing is said, ratios and goals by arithmetic, a program in Dr.Jit's place."""

from __future__ import annotations

import json
import math
import os
import stat
import sys
from pathlib import Path

import complete
import numpy as np
import pytest
import started

from study.core import cli, registry, run
from study.core.cli import StudyError
from study.core.registry import ROOT, Spec
from study.experiments.drjit import chapter as drjit_chapter
from study.experiments.drjit import measure as drjit_measure
from study.experiments.drjit import tables as drjit_page
from study.experiments.drjit.measure import DRJIT, OWN, SAME, Measuring, Point, Rival
from study.numbers import verdicts
from study.numbers.stats import Interval

SCRIPT = (ROOT / "scripts" / "stepwise", "drjit")
OPT4, OPT5 = Spec("opt4", "opt4"), Spec("opt5_threads", "opt5_threads")
# Prints and writes what Dr.Jit's program does: a flat grey wall at t = 5, in 7 ms.
STAND_IN = """#!{python}
import json, sys
import numpy as np
_, path, width, height, threads, frames, *out = [word for word in sys.argv if word != "-I"][1:]
assert json.load(open(path))["light"]["shadows"] == "none"
size = int(height), int(width)
if out:
    np.savez(out[0], rgb=np.full((*size, 3), 0.5), t=np.full(size, 5.0), id=np.zeros(size))
print(json.dumps({{"ns": [7e6] * int(frames), "first_ns": 1e8, "drjit": "0"}}))
"""


def test_without_llvm_it_is_said_what_is_missing_and_what_it_would_add(tmp_path: Path) -> None:
    with pytest.raises(StudyError, match=r"libLLVM 17 or newer is missing \(found: none\)") as error:
        drjit_measure.find_llvm(None, [tmp_path])
    assert error.value.exit_status == cli.CANNOT_RUN and "it would add the ratio" in str(error.value)
    (tmp_path / "libLLVM-15.so").write_text("no library")
    with pytest.raises(StudyError, match=r"\(found: libLLVM-15\.so\)"):
        drjit_measure.find_llvm(None, [tmp_path])
    with pytest.raises(StudyError, match="DRJIT_LIBLLVM_PATH"):
        drjit_measure.find_llvm(str(tmp_path / "gone.so"))


def test_the_newest_llvm_is_taken(tmp_path: Path, monkeypatch) -> None:
    versions = {"libLLVM-15.so.1": 15, "libLLVM.so.19.1": 19, "libLLVM-17.so": 17, "libLLVM-9.so": None}
    for name in versions:
        (tmp_path / name).write_text("")
    monkeypatch.setattr(drjit_measure, "llvm_version", lambda path: versions[path.name])
    assert drjit_measure.find_llvm(None, [tmp_path]).name == "libLLVM.so.19.1"
    assert drjit_measure.find_llvm(str(tmp_path / "libLLVM-17.so")).name == "libLLVM-17.so"
    with pytest.raises(StudyError, match="libLLVM 17"):
        drjit_measure.find_llvm(str(tmp_path / "libLLVM-15.so.1"))


def test_without_drjit_it_is_said() -> None:
    environment = os.environ | {"DRJIT_LIBLLVM_PATH": "/nowhere/libLLVM.so"}
    words = [sys.executable, *SCRIPT, "--phase", "opt1", "--python", "/nowhere/python"]
    done = started.run(words, env=environment)
    assert done.returncode == cli.CANNOT_RUN and "libLLVM 17 or newer is missing" in done.stderr
    with pytest.raises(StudyError, match="is no Python with drjit and numpy; it would add"):
        drjit_measure.find_python(Path("/nowhere/python"))


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--phase", "opt9x"], "no phase 'opt9x'"),
        (["--scene", "trio"], "invalid choice: 'trio'"),
        (["-n", "8"], "'8': must be a whole number of at least 16"),
        (["--threads", "4096"], "--threads 4096: there are"),
    ],
)
def test_bad_input_is_one_line(words: list[str], said: str, tmp_path: Path) -> None:
    done = started.run([sys.executable, *SCRIPT, *words, "--run", tmp_path])
    assert done.returncode == cli.BAD_INPUT and said in done.stderr and "Traceback" not in done.stderr


def test_every_phase_stands_beside_it_by_both_limits(tmp_path: Path) -> None:
    made = drjit_measure.points([OPT4, OPT5], ["mandelbulb"], [1, 2])
    assert [(p.program, p.limits, p.threads) for p in made] == [
        *((DRJIT, SAME, 1), ("opt4", OWN, 1), ("opt5_threads", OWN, 1)),
        *(("opt4", SAME, 1), ("opt5_threads", SAME, 1)),
        *((DRJIT, SAME, 2), ("opt5_threads", OWN, 2), ("opt5_threads", SAME, 2)),
    ]
    bulb = registry.find_scene("mandelbulb").data
    own, same = (
        json.loads(drjit_measure.scene_of("mandelbulb", k, tmp_path).read_text()) for k in (OWN, SAME)
    )
    assert own == bulb | {"light": bulb["light"] | {"shadows": "none"}}
    assert same["march"] == bulb["march"] | {"max_steps": 100, "hit_distance": 1e-3}


def row(ms: float, errors: dict | None = None) -> list[dict]:
    times = {
        Point(DRJIT, "scene0_plain", SAME, 2): [80e6] * 6,
        Point("opt4", "scene0_plain", OWN, 2): [ms * 1e6] * 6,
    }
    found = {Point(p.program, p.scene, p.limits, 1): errors or {} for p in times}
    return drjit_measure.rows(times, found, published=True)


def test_the_ratio_is_theirs_over_ours_on_as_many_threads() -> None:
    theirs, ours = row(8)
    assert ours["ratio"].value == pytest.approx(10) and (ours["goal"], ours["verdict"]) == (8, "met")
    assert (theirs["ratio"], theirs["verdict"], theirs["published_ms"]) == (None, None, 40)
    assert row(11)[1]["verdict"] == "missed"
    assert verdicts.goal(Interval(8, 7.9, 8.2, 6, True), 8) == "cannot be told apart here"
    assert verdicts.goal(Interval(9, math.nan, math.nan, 5, False), 8) == "too few launches"


def test_a_program_in_its_place_is_timed_and_judged(tmp_path: Path) -> None:
    stand_in = tmp_path / "python"
    stand_in.write_text(STAND_IN.format(python=sys.executable))
    stand_in.chmod(stand_in.stat().st_mode | stat.S_IXUSR)
    work = Measuring(Rival(stand_in, tmp_path / "libLLVM.so"), 16, run.FASTEST, tmp_path)
    point = Point(DRJIT, "scene0_plain", SAME, 1)
    assert work.once(point, 100) == 7e6
    picture = work.picture(point)
    assert picture["Z"].shape == (16, 28) and np.all(picture["R"] == 0.5) and np.all(picture["id"] == 0)
    assert registry.find_phase(work.reference).precision == "double"
    found = work.errors(point)
    assert found["psnr_db"] < 10 and found["to_own"]["wrong_ppm"] > 1e5  # a wall is not scene0
    alike = work.errors(Point(work.reference, "scene0_plain", SAME, 1))
    assert alike["psnr_db"] == math.inf and alike["wrong_ppm"] == 0 < alike["to_own"]["wrong_ppm"]
    assert work.once(Point("opt4", "scene0_plain", OWN, 1), 0) > 0


def test_the_chapter_is_made_from_the_file_alone(tmp_path: Path) -> None:
    errors = {
        "psnr_db": 50.0,
        "rmse": 0.003,
        "averaged": False,
        "wrong_ppm": 3.0,
        "depth_agree_fraction": 1.0,
    }
    errors |= {"reference": "opt3", "to_own": errors | {"psnr_db": 16.0}, "non_finite": 0}
    result = {"schema": 1, "n": 720, "launches": 6, "drjit": "1.5.0", "llvm": "libLLVM.so.19.1 (19)"}
    assert drjit_chapter.rival(tmp_path).parts == []
    made = cli.plain(result | {"rows": row(8, errors)})
    complete.write(tmp_path / drjit_measure.FILE, made)
    chapter = drjit_chapter.rival(tmp_path)
    text = chapter.parts[0].markdown
    assert "10.0× [10.0" in text and "goal" not in text and "| 40.0 |" in text and "16.0" in text
    assert "drjit 1.5.0" in drjit_page.note(made)
    assert "10.0× [10.0" in chapter.answer and "16.0 dB" in chapter.answer
    (tmp_path / drjit_measure.FILE).write_text('{"rows": [1]}')
    with pytest.raises(StudyError, match=r"drjit\.json: not what scripts/stepwise drjit writes"):
        drjit_chapter.rival(tmp_path)
