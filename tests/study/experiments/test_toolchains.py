"""Compilers and flags: what is asked for is what is built, and a changed bit is a changed pixel."""

import json
import os
import subprocess
import sys
from pathlib import Path

import emitted
import numpy as np
import pytest
import started

from study.core import cli, commands, registry
from study.core.cli import StudyError
from study.core.registry import ROOT, Spec
from study.experiments.toolchains import chapter
from study.experiments.toolchains import measure as toolchains
from study.experiments.toolchains.measure import BASE, SETS, Program
from study.experiments.toolchains.schema import Row, Toolchains
from study.pictures import images

pytestmark = pytest.mark.slow


def picture(height: int = 4, width: int = 5) -> images.Picture:
    made = images.Picture({name: np.ones((height, width), np.float32) for name in images.AOVS})
    return made | {"id": np.zeros((height, width), np.float32)}


def test_one_ulp_in_one_channel_changes_that_pixel_alone() -> None:
    a, b = picture(), picture()
    b["G"][1, 2] = np.nextafter(np.float32(1), np.float32(2))
    assert toolchains.changed(a, b) == 1 / 20
    b["Z"][0, 0] = -1
    assert toolchains.changed(a, b) == 2 / 20


def test_a_nan_is_no_equal_of_itself_unless_its_bits_are() -> None:
    a, b = picture(), picture()
    a["R"][0, 0] = np.nan
    assert toolchains.changed(a, b) == 1 / 20


def test_the_base_is_built_whatever_is_asked_for() -> None:
    made = toolchains.programs(["clang"], ["and fast-math"], [Spec.parse("opt4")])
    assert made == [Program(*BASE, "opt4"), Program("clang", "and fast-math", "opt4")]
    assert len({(one.folder, one.phase) for one in made}) == 2


def test_flags_reach_the_program_behind_the_phases_own() -> None:
    program = Program("gcc", "and contraction", "opt1")
    assert toolchains.built([program]) == ([program], [])
    scene = registry.find_scene("two_spheres")
    done = subprocess.run([program.path, scene.path, "-n", "8", "--json"], capture_output=True, check=True)
    flags = json.loads(done.stdout)["flags"]
    assert flags == f"{registry.find_phase('opt1').cflags} {SETS['and contraction']}"


def test_what_does_not_build_says_why(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(toolchains.SETS, "as shipped", "-mno-such-flag")
    shipped = Program("gcc", "as shipped", "opt1")
    able, (failed,) = toolchains.built([shipped])
    assert not able and "no-such-flag" in failed.reason
    monkeypatch.setitem(toolchains.SETS, "as shipped", "")
    assert toolchains.built([shipped])[0] == [shipped]


def test_a_missing_compiler_is_named_and_gcc_is_needed(monkeypatch: pytest.MonkeyPatch) -> None:
    found, lacking = toolchains.present(["gcc", "no-such-cc"])
    assert found == ["gcc"] and lacking[0].compiler == "no-such-cc"
    assert toolchains.present(["no-such-cc"])[0] == []  # gcc is there, though nobody asked for it
    monkeypatch.setenv("PATH", os.devnull)
    with pytest.raises(StudyError, match="gcc is missing") as caught:
        toolchains.present(["gcc"])
    assert caught.value.exit_status == cli.CANNOT_RUN


def test_native_is_recorded_as_what_it_stands_for() -> None:
    assert "-march=" in toolchains.resolved("gcc")
    assert toolchains.resolved("no-such-cc") == ""


def test_the_command_writes_its_rows(tmp_path: Path) -> None:
    words = ["--phase", "opt1", "--scene", "two_spheres", "--compiler", "gcc", "-n", "16", "--launches", "1"]
    words += ["--flags", "and contraction", "--no-truth", "--json", "--run", str(tmp_path)]
    done = started.run([sys.executable, ROOT / "scripts" / "stepwise", "toolchains", *words])
    assert done.returncode == cli.OK, done.stderr
    found = Toolchains.load(tmp_path / "toolchains.json")
    assert [row.flags for row in found.rows] == ["as shipped", "and contraction"]
    assert found.rows[0].changed_fraction == 0 and len(emitted.result(done.stdout)["rows"]) == 2


def test_a_spec_with_flags_of_its_own_is_refused() -> None:
    with pytest.raises(StudyError, match="opt2@opt4"):
        commands.called("toolchains", ["--phase", "opt2@opt4"])


def test_a_null_psnr_of_a_broken_picture_is_not_identical() -> None:
    row = measured(exact(), shipped(), shipped(), "two_spheres")
    assert chapter.psnr(row) == "identical"
    row.rmse_to_shipped = None
    assert chapter.psnr(row) == "not finite"
    row.psnr_to_shipped_db = 42.0
    assert chapter.psnr(row) == "42.0"


def measured(truth: images.Picture, mine: images.Picture, theirs: images.Picture, scene: str) -> Row:
    """The row of gcc with fast-math against these pictures."""
    one, base = Program("gcc", "and fast-math", "opt1"), Program(*BASE, "opt1")
    times = {one: [1e6] * 6, base: [2e6] * 6}
    return toolchains.row(one, registry.find_scene(scene), 8, times, {one: mine, base: theirs}, truth)


def exact(height: int = 8, width: int = 12) -> images.Picture:
    """Truth's picture of a floor, every pixel proved."""
    made = picture(height, width) | {name: np.zeros((height, width), np.float32) for name in ("N.x", "N.z")}
    made |= {"none." + c: made[c] for c in "RGB"} | {"ideal." + c: made[c] for c in "RGB"}
    made |= {name: np.full((height, width), 2, np.float32) for name in ("status", "status.all")}
    return made | {"shadow": np.ones((height, width), np.float32)}


def shipped() -> images.Picture:
    return images.Picture({name: exact()[name] for name in images.AOVS})


@pytest.mark.parametrize("scene", ["two_spheres", "mandelbulb"])
def test_what_truth_does_not_know_is_left_out(scene: str) -> None:
    """One pixel undecided, with NaN for a colour: the others are off by 1/16 in red, 24.08 + 4.77 dB."""
    truth = exact()
    mine = images.Picture({name: truth[name].copy() for name in images.AOVS})
    mine["R"] -= np.float32(1 / 16)
    for prefix in ("", "none.", "ideal."):
        truth[prefix + "R"][0, 0] = np.nan
    truth["status"][0, 0] = truth["status.all"][0, 0] = 0
    truth["Z"][0, 0] = np.nan
    mine["id"][0, 1], mine["Z"][0, 1] = -1, np.inf
    row = measured(truth, mine, mine, scene)
    assert row.non_finite == 0 and row.changed_fraction == 0
    assert row.truth_psnr_db == pytest.approx(-10 * np.log10(1 / 3 / 256), abs=1e-4)
    assert row.truth_false_misses_ppm == pytest.approx(1e6 / 95)
    assert row.truth_false_hits_ppm == row.truth_wrong_shape_ppm == row.truth_dt_p99 == 0


def test_non_finite_is_of_the_picture_itself() -> None:
    """A shipped picture with a NaN does not make the other one broken, nor the same."""
    kept = {name: plane.copy() for name, plane in exact().items() if name in images.AOVS}
    broken = images.Picture(kept)
    broken["R"][3, 3] = np.nan
    sound = shipped()
    row = measured(exact(), sound, broken, "two_spheres")
    assert row.ms.value == 1 and row.speedup.value == 2  # it takes 1 ms where gcc as shipped takes 2
    assert row.non_finite == 0 and row.truth_psnr_db is None and row.truth_rmse == 0
    assert chapter.psnr(row) == "not finite"
    assert measured(exact(), broken, sound, "two_spheres").non_finite == 1
