"""stepwise accuracy as a command: rows, verdicts, what cannot be, and one chain against a quadratic."""

from __future__ import annotations

import dataclasses
import json
import math
import shutil
import sys
import types

import emitted
import numpy as np
import pytest
from discs import HEIGHT, WIDTH, made_truth

from study.core import cli, registry, store
from study.core.cli import StudyError
from study.core.registry import ROOT, Spec
from study.core.run import DriverError
from study.experiments.accuracy import command as command_module
from study.experiments.accuracy import tables as accuracy_page
from study.numbers import accuracy
from study.pictures import gallery, gate, images
from study.truth import where


@pytest.fixture
def house(tmp_path, monkeypatch, write_exr, disc):
    """The command with pictures made here: truth is the disc, a phase's picture what `pictures` says."""
    monkeypatch.delenv("STEPWISE_ISA_LIMIT", raising=False)
    pictures = {name: disc for name in ("baseline", "opt4", "opt5")}
    (tmp_path / "bin").mkdir()

    def build(spec: Spec):
        path = tmp_path / "bin" / str(spec)
        path.write_text(str(spec))
        return path

    def render(spec, scene, height, width, *, aov, out, timed):
        made = pictures[str(spec)]
        if isinstance(made, Exception):
            raise made
        write_exr(out, made())

    monkeypatch.setattr(gallery, "build", build)
    monkeypatch.setattr(gallery, "render", render)
    monkeypatch.setattr(command_module.truth, "picture", lambda scene, size: made_truth(disc()))
    opt1 = registry.find_phase("opt1")
    known = {
        name: dataclasses.replace(opt1, name=name, order=order, family=family, tolerance={})
        for name, order, family in (
            ("baseline", 0, "ladder"),
            ("opt4", 4, "ladder"),
            ("opt5", 5, "ladder"),
            ("exact", 0, "truth"),
        )
    }
    monkeypatch.setattr(registry, "phases", lambda root=ROOT: known)
    return types.SimpleNamespace(pictures=pictures, known=known, run=tmp_path / "run")


@pytest.fixture
def command(house, monkeypatch, capsys):
    def call(*words: str) -> tuple[int, str, str]:
        size = ("-n", str(HEIGHT), "-w", str(WIDTH), "--jobs", "1", "--run", str(house.run))
        monkeypatch.setattr(sys, "argv", ["stepwise accuracy", *size, *words])
        status = cli.finish(command_module.main())
        return status, *capsys.readouterr()

    return call


KEYS = (
    *("false_hits_ppm", "false_misses_ppm", "wrong_shape_ppm", "dt_p99", "dt_max", "normal_p99_degrees"),
    *("shadow_rmse", "rmse", "psnr_db", "psnr_ideal_db", "psnr_none_db", "flip_mean", "flip_max"),
    *("fraction_over_1_255", "proved_fraction", "non_finite"),
)


def test_one_row(command, house):
    status, out, _ = command("--phase", "opt4", "--scene", "scene0", "--json")
    (found,) = emitted.result(out)["rows"]
    assert status == 0 and set(KEYS) <= found.keys()
    assert (found["psnr_db"], found["rmse"], found["gated"], found["worse"]) == (None, 0, False, [])
    assert not any(isinstance(found[key], dict | list) for key in KEYS)
    kept = json.loads((house.run / "accuracy.json").read_text())["rows"]
    assert len(kept) == 1 and kept[0].items() <= found.items()
    assert (house.run / found["picture"]).is_file()
    assert (house.run / "figures" / "accuracy-where.png").is_file()


def test_a_gated_phase_that_is_further_than_baseline_fails_with_metric_and_both_values(command, house, disc):
    house.pictures["opt5"] = lambda: disc(1)
    status, out, err = command("--phase", "opt4", "opt5", "--scene", "trio", "--json")
    rows = {row["phase"]: row for row in emitted.result(out)["rows"]}
    assert status == 1
    assert rows["opt5"]["failed"] and {"false_hits_ppm", "false_misses_ppm", "psnr_db"} <= set(
        rows["opt5"]["worse"]
    )
    ppm = f"{1e6 * 23 / (HEIGHT * WIDTH):.6g}"
    assert f"FAIL opt5 on trio: false_hits_ppm: {ppm}, baseline has 0: should be at most that" in err


def test_nobody_need_copy_baselines_errors(command, house, disc):
    house.pictures["baseline"] = lambda: disc(2)
    status, out, _ = command("--phase", "opt5", "--scene", "trio", "--json")
    assert status == 0 and emitted.result(out)["rows"][0]["false_hits_ppm"] == 0


@pytest.mark.slow
def test_a_fractal_may_be_as_far_as_opt4_and_no_other_scene(command, house, disc):
    house.pictures["opt4"] = house.pictures["opt5"] = lambda: disc(1)
    assert command("--phase", "opt5", "--scene", "mandelbulb")[0] == 0
    assert command("--phase", "opt5", "--scene", "trio")[0] == 1
    shutil.rmtree(house.run)  # pictures are kept
    house.pictures["opt5"] = lambda: disc(2)
    status, _, err = command("--phase", "opt5", "--scene", "mandelbulb")
    assert status == 1 and "opt4 has" in err
    shutil.rmtree(house.run)
    house.pictures["opt4"] = DriverError(4, "none today")
    status, _, err = command("--phase", "opt5", "--scene", "mandelbulb")
    assert status == 1 and "baseline has" in err


@pytest.mark.slow
def test_outlines_as_fat_as_declared_are_granted(command, house, disc):
    """And what lies beyond them is not: a false hit in the corner, far from the disc, and that one alone."""
    granted = dict.fromkeys(gate.TRUTH_METRICS, 1e6) | {"false_hits_ppm": 0, "outline_pixels": 2}
    tolerance = {gate.TRUTH: granted | {"reason": "rays as wide as a pixel"}}
    house.known["opt5"] = dataclasses.replace(house.known["opt5"], tolerance=tolerance)
    house.pictures["opt5"] = lambda: disc(1)
    status, out, err = command("--phase", "opt5", "--scene", "trio", "--json")
    (row,) = emitted.result(out)["rows"]
    assert status == 0 and row["false_hits_ppm"] > 0 and row["beyond_outlines"]["false_hits_ppm"] == 0, err
    shutil.rmtree(house.run)

    def spotted() -> dict[str, np.ndarray]:
        made = disc(1)
        for plane in made.values():
            plane[0, 0] = plane[HEIGHT // 2, WIDTH // 2]
        return made

    house.pictures["opt5"] = spotted
    status, out, err = command("--phase", "opt5", "--scene", "trio", "--json")
    assert status == 1 and emitted.result(out)["rows"][0]["worse"] == ["false_hits_ppm"]
    assert f"false_hits_ppm: {1e6 / (HEIGHT * WIDTH):.6g}, baseline has 0" in err
    shutil.rmtree(house.run)
    house.pictures["baseline"] = lambda: disc(1)  # whose 23 false hits are at the outline
    status, out, err = command("--phase", "opt5", "--scene", "trio", "--json")
    assert status == 1 and emitted.result(out)["rows"][0]["worse"] == ["false_hits_ppm"], (
        "allowed what baseline is granted"
    )
    assert f"false_hits_ppm: {1e6 / (HEIGHT * WIDTH):.6g}, baseline has 0" in err


def test_a_declared_margin_is_granted(command, house, disc):
    house.pictures["opt5"] = lambda: disc(1)
    reason = {"reason": "a test", **dict.fromkeys(gate.TRUTH_METRICS, 1e5)}
    house.known["opt5"] = dataclasses.replace(house.known["opt5"], tolerance={"truth": reason})
    assert command("--phase", "opt5", "--scene", "trio")[0] == 0
    del reason["false_misses_ppm"]
    status, _, err = command("--phase", "opt5", "--scene", "trio")
    assert status == 1 and "false_misses_ppm" in err and "false_hits_ppm" not in err


def test_an_ungated_phase_is_shown_with_a_mark(command, house, disc):
    house.pictures["opt4"] = lambda: disc(1)
    status, out, _ = command("--phase", "opt4", "--scene", "trio")
    line = next(line for line in out.splitlines() if line.startswith("trio"))
    assert status == 0 and f"9,583 {accuracy_page.MARK}" in line and "further than baseline" in line


def test_a_picture_that_is_not_finite_fails_gated_or_not(command, house, disc):
    def broken():
        picture = disc()
        picture["G"][20, 20] = np.nan
        return picture

    house.pictures["opt4"] = broken
    status, _, err = command("--phase", "opt4", "--scene", "trio")
    assert status == 1 and "non_finite: 2 samples" in err


def test_what_cannot_be_is_said(command, house):
    from study.core.run import DriverError

    house.pictures["opt4"] = DriverError(4, "no planes here")
    status, _, err = command("--phase", "opt4", "opt5", "--scene", "trio")
    assert status == 0 and "skipped opt4 on trio: no planes here" in err
    house.pictures["opt4"] = DriverError(-11, "killed by SIGSEGV")
    status, _, err = command("--phase", "opt4", "--scene", "trio")
    assert status == 1 and "FAIL opt4 on trio: killed by SIGSEGV" in err
    with pytest.raises(StudyError, match="exact: is truth itself"):
        command("--phase", "exact", "--scene", "trio")


# --- the page


def test_tables_and_figures_from_the_file_alone(command, house, disc):
    house.pictures["opt4"] = lambda: disc(1)
    command("--phase", "baseline", "opt4", "--scene", "trio", "mandelbulb", "--json")
    result = accuracy.read(house.run)
    names = [name for name, *_ in accuracy_page.tables(result)]
    assert names == ["accuracy", "accuracy-averaged", "accuracy-where"]
    text = accuracy_page.text(result)
    assert text.count("identical") and accuracy_page.MARK in text
    (draw,) = accuracy_page.drawings(result).values()
    figure = draw()
    bars = figure.axes[0].containers[where.CLASSES.index("silhouette")]
    bad = next(row for row in result["rows"] if row["phase"] == "opt4")["bad_pixels"]
    assert [bar.get_width() for bar in bars] == [0, pytest.approx(1e6 * bad / (HEIGHT * WIDTH))]


def test_another_things_json_is_one_clear_line(tmp_path):
    assert accuracy.rows(tmp_path) == []
    for wrong in ({"rows": [{}]}, {"rows": 5}, []):
        store.write_json(tmp_path / "accuracy.json", wrong)
        with pytest.raises(StudyError, match=r"not what scripts/stepwise accuracy writes"):
            accuracy.rows(tmp_path)


# --- the whole chain, against a program that knows spheres only


def rays(scene, width: int, height: int) -> tuple[np.ndarray, np.ndarray]:
    """Origin, and unit directions through the middles of pixels (height × width × 3)."""
    camera = scene.data["camera"]
    position, target, up = (np.array(camera[k], float) for k in ("position", "look_at", "up"))
    forward = (target - position) / np.linalg.norm(target - position)
    right = np.cross(up, forward) / np.linalg.norm(np.cross(up, forward))
    above = np.cross(forward, right)
    tangent = math.tan(math.radians(camera["vertical_fov_degrees"]) / 2)
    x = (2 * (np.arange(width) + 0.5) / width - 1) * width / height * tangent
    y = (1 - 2 * (np.arange(height) + 0.5) / height) * tangent
    directions = forward + x[None, :, None] * right + y[:, None, None] * above
    return position, directions / np.linalg.norm(directions, axis=-1, keepdims=True)


def test_twenty_steps_lose_the_spheres_rims(tmp_path, monkeypatch, capsys):
    """two_spheres has a cap of 20 steps: baseline's misses and |Δt| by the discriminant of a quadratic."""
    n = 48
    words = ("--phase", "baseline", "--scene", "two_spheres", "-n", str(n), "--json", "--jobs", "1")
    monkeypatch.setattr(sys, "argv", ["stepwise accuracy", *words, "--run", str(tmp_path)])
    assert cli.finish(command_module.main()) == 0
    (found,) = emitted.result(capsys.readouterr().out)["rows"]

    scene = registry.find_scene("two_spheres")
    origin, directions = rays(scene, n, n)
    depth = np.full((2, n, n), np.inf)
    for i, shape in enumerate(scene.data["shapes"]):
        offset = origin - np.array(shape.get("position", (0, 0, 0)), float)
        half = directions @ offset
        inside = half**2 - (offset @ offset - shape["radius"] ** 2)
        first = -half - np.sqrt(np.maximum(inside, 0))
        depth[i][(inside >= 0) & (first > 0)] = first[(inside >= 0) & (first > 0)]
    exact = depth.min(axis=0)
    (path,) = tmp_path.glob("images/two_spheres-baseline-*.exr")
    made = images.read(path)
    hit = made["id"] >= 0
    assert found["false_misses_ppm"] == pytest.approx(1e6 * (np.isfinite(exact) & ~hit).sum() / n**2) != 0
    assert found["false_hits_ppm"] == pytest.approx(1e6 * (np.isinf(exact) & hit).sum() / n**2)
    same = hit & (made["id"] == depth.argmin(axis=0)) & np.isfinite(exact)
    off = np.abs(made["Z"].astype(float)[same] - exact[same])
    assert found["dt_max"] == pytest.approx(off.max(), abs=1e-5)
    assert found["dt_p99"] == pytest.approx(np.percentile(off, 99), abs=1e-5)
    assert found["proved_fraction"] == 1


def test_a_shard_of_a_fractal_is_held_against_opt4_too(command, house, disc):
    """Whatever phases the shard itself has: its rows are those of a run without shards."""
    house.pictures["opt4"] = house.pictures["opt5"] = lambda: disc(1)
    asked = ("--phase", "opt4", "opt5", "--scene", "mandelbulb", "--json")
    _, out, _ = command(*asked)
    whole = emitted.result(out)["rows"]
    shutil.rmtree(house.run)
    status, out, _ = command(*asked, "--shard", "2/2")
    assert status == 0 and emitted.result(out)["rows"] == whole[1:]
    assert sorted(path.name for path in house.run.glob("*.json")) == ["accuracy.shard-2-of-2.json"]
